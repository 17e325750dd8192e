"""Mitsuba as a peer: the same picture, and the message if it cannot run."""

from pathlib import Path

import numpy as np
import pytest

from analysis.bench import mitsuba as bench_mitsuba
from analysis.bench import shading as bench_shading
from analysis.bench.mitsuba import VARIANTS, find_llvm, missing, still
from analysis.bench.mitsuba_scene import mean_reflectance
from analysis.bench.options import BenchOptions
from analysis.bench.rows import NOT_INSTALLED
from analysis.bench.scenes import bumpy_scene, driving_scenes, renderer_of
from analysis.bench.shading import DRIVING_S, Still, compare, mean_difference, stills
from analysis.command.progress import Task
from scenes.canonical import ConstantTexture, Phong

SMALL = BenchOptions(Path("unused"), resolution_px=64, batch_size=4, scenes=("fly-by",))
USABLE = [variant for variant in VARIANTS if not missing(variant)]

usable = pytest.mark.parametrize("variant", USABLE or ["none"])


@pytest.fixture(autouse=True)
def _needs_mitsuba() -> None:
    pytest.importorskip("mitsuba")


@usable
def test_the_bumpy_sphere_is_as_bright_as_ours(variant: str) -> None:
    scene = bumpy_scene()
    ours = renderer_of(scene, SMALL).render_frame(0.0, 64, 64, 4).numpy()
    theirs = still(scene, 0.0, 64, "direct", variant).render(16)
    assert ours.shape == theirs.shape == (64, 64, 3) and theirs.dtype == np.float32
    assert ours.mean() > 0.05
    assert mean_difference(ours, theirs) < 0.01
    # pixel by pixel too, up to the noise of edges: nothing is mirrored or shifted
    assert np.abs(ours - theirs).mean() < 0.02 * ours.mean()
    assert np.abs(ours[:, ::-1] - theirs).mean() > 0.2 * ours.mean()


@usable
def test_a_driving_scene_looks_like_ours(variant: str) -> None:
    """The car in its place, the sky and its clouds; light on diffuse surfaces differs, as its translation says."""
    scene = driving_scenes(SMALL)["fly-by"]
    renderer = renderer_of(scene, SMALL)
    theirs = _brightness(still(scene, DRIVING_S, 64, "path", variant).render(64))
    for shift_s, low, high in ((-0.1, -1.0, 0.8), (0.0, 0.9, 1.0), (0.1, -1.0, 0.8)):
        ours = _brightness(renderer.render_frame(DRIVING_S + shift_s, 64, 64, 4).numpy())
        assert low < np.corrcoef(ours, theirs)[0, 1] < high, shift_s


def _brightness(picture: np.ndarray) -> np.ndarray:
    return np.log(0.02 + picture.mean(axis=2).ravel())


def test_the_mean_of_the_fresnel_term_is_its_integral() -> None:
    material = Phong(ConstantTexture((0.0, 0.0, 0.0)), fresnel_min=0.2, fresnel_max=0.8, fresnel_exponent=5.0)
    cosine = (np.arange(20_000) + 0.5) / 20_000
    reflectance = 0.2 + 0.6 * (1.0 - cosine) ** 5
    assert mean_reflectance(material) == pytest.approx((2.0 * cosine * reflectance).mean(), abs=1e-6)


def test_rows_of_one_picture_beside_all_variants() -> None:
    scene = bumpy_scene(3)
    picture = Still("bumpy", scene, 0.0, "direct", 2, VARIANTS)
    rows = list(compare(picture, renderer_of(scene, SMALL), SMALL, Task()))
    assert [row.name for row in rows] == ["bumpy, llvm_ad_rgb", "bumpy, scalar_rgb"]
    assert [row.target for row in rows] == [1.2, 3.0]
    for row in rows:
        ran = row.name.rpartition(" ")[2] in USABLE
        assert (row.peer is not None) == ran and ("mean colour differs by 0." in row.note) == ran


def test_pictures_of_the_group() -> None:
    found = list(stills(BenchOptions(scenes=("chase", "fly-by"))))
    assert [picture.samples_per_axis for picture in found] == [2, 4, 4, 2, 2, 2, 2]
    assert [picture.integrator for picture in found] == ["direct"] * 2 + ["path"] + ["path", "direct"] * 2
    wanted = [True] * 2 + [False, True, False, True, False]
    assert [bool(picture.targets["scalar_rgb"]) for picture in found] == wanted


def test_without_mitsuba_rows_say_so(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(bench_mitsuba, "installed", lambda module: False)
    scene = bumpy_scene(3)
    picture = bench_shading.Still("bumpy", scene, 0.0, "direct", 2, VARIANTS)
    rows = list(compare(picture, renderer_of(scene, SMALL), SMALL, Task()))
    assert [row.note for row in rows] == [NOT_INSTALLED] * 2
    assert all(row.peer is None and row.met is None and row.ours > 0.0 for row in rows)


def test_a_library_that_is_named_is_taken(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("DRJIT_LIBLLVM_PATH", "/somewhere/libLLVM.so")
    assert find_llvm() == "/somewhere/libLLVM.so"


def test_without_the_library_only_its_variant_is_missing(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("DRJIT_LIBLLVM_PATH", raising=False)
    monkeypatch.setattr(bench_mitsuba, "_LLVM_FOLDERS", ("/nowhere",))
    assert "libllvm19" in missing("llvm_ad_rgb") and missing("scalar_rgb") == ""
