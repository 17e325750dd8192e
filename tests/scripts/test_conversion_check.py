"""The command that renders converted scenes with the renderers they are for."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest

from analysis.conversion.check import plain
from analysis.conversion.markers import MARKERS, SIZES, SOURCES, expected_px, farthest_px, marker_offsets
from analysis.conversion.peers import rendered
from renderer.frames import render_image
from renderer.sampling.plan import SamplePlan
from renderer.trace import Renderer
from scenes.canonical import (
    Bumped,
    ConstantTexture,
    Film,
    Glossy,
    Instance,
    Integrator,
    Masked,
    Matte,
    Metal,
    PerspectiveCamera,
    Rectangle,
    Scene,
    SunSky,
)
from scenes.catalog import load_any
from scenes.formats.conversion import save_scene_file
from scenes.loading import asset
from tests.scripts.commands import call_script


def peers() -> None:
    pytest.importorskip("mitsuba")
    pytest.importorskip("pyluxcore")


def test_the_box_is_the_same_in_both_renderers(tmp_path: Path, monkeypatch, capsys) -> None:
    """Also the framing: LuxCore from the same file, as it is and read and written again, to the noise."""
    peers()
    files = [str(asset(f"cornell-box/cornell-box{ending}")) for ending in (".lxs", ".xml")]
    size = ("--width-px", "32", "--samples", "64", "--out", str(tmp_path))
    assert call_script("conversion_check.py", monkeypatch, *files, *size) == 0, capsys.readouterr().err
    rows = json.loads((tmp_path / "summary.json").read_text())["rows"]
    assert [(row["first"], row["second"]) for row in rows] == [
        (f"{own}, as it is", other) for own in ("luxcore", "mitsuba") for other in ("mitsuba", "luxcore")
    ]
    for row in rows:
        same = row["first"].startswith(row["second"])
        assert row["note"] == "" and row["flip"] < (0.5 if same else 1.5) * row["flip_noise"] + 0.01
        assert row["mean_r"] == pytest.approx(1.0, abs=0.01 if same else 0.05)
    assert rows[2]["flip"] == 0.0  # the importer and the tree alone make the same scene for Mitsuba
    assert (tmp_path / "pictures.jpg").stat().st_size > 1000


def test_a_plain_scene_has_the_shapes_lights_and_colours(tmp_path: Path) -> None:
    green, grey = ConstantTexture((0.1, 0.6, 0.1)), ConstantTexture((0.5, 0.5, 0.5))
    materials = (Masked(Bumped(Glossy(green, grey), grey), grey), Metal((1.0,) * 3, (2.0,) * 3), Matte(green, 20.0))
    scene = Scene(PerspectiveCamera(), tuple(Instance(Rectangle(), material) for material in materials))
    found = plain(scene).instances
    assert [one.material for one in found] == [Matte(green), Matte(grey), Matte(green)]
    assert all(one.shape == Rectangle() for one in found)


@pytest.mark.parametrize("source", ["pbrt", pytest.param("all", marks=pytest.mark.slow)])
def test_markers_are_where_they_must_be(source: str, tmp_path: Path) -> None:
    """To a pixel, in every format and renderer; PBRT's own ``LookAt`` is a mirrored view."""
    peers()
    sources, sizes = (SOURCES, tuple(SIZES)) if source == "all" else ((source,), ("landscape",))
    rows = marker_offsets(tmp_path, 120.0, sources, sizes)
    assert {row["to"] for row in rows} >= {"pbrt", "luxrender", "mitsuba", "mitsuba3"}
    assert all(row["offset_px"] < 0.2 for row in rows), rows


def test_markers_that_are_not_there_are_found_out() -> None:
    size = SIZES["landscape"]
    picture = np.zeros((size[1], size[0], 3), np.float32)
    assert farthest_px(picture, size, False) == math.inf
    for center, radiance in MARKERS:
        x, y = expected_px(center, size, False).astype(int)
        picture[y - 1 : y + 2, x - 1 : x + 2] = radiance
    assert farthest_px(picture, size, False) < 1.0
    assert farthest_px(np.roll(picture, 3, axis=1), size, False) > 2.0
    assert farthest_px(picture[:, ::-1], size, False) == math.inf
    assert farthest_px(picture[..., ::-1], size, False) == math.inf


@pytest.mark.parametrize("part", ["sun", "sky"])
def test_daylight_is_as_bright_in_every_renderer(part: str, tmp_path: Path) -> None:
    """On a white plane under it: Mitsuba, LuxCore, and ours from the file for PBRT, which has a map."""
    peers()
    light = SunSky((0.6, 0.0, 0.8), 3.0, 0.5, part, (0.0, 0.0, 1.0), 0.0)  # type: ignore[arg-type]
    plane = Instance(Rectangle(), Matte(ConstantTexture((1.0, 1.0, 1.0))), np.diag([50.0, 50.0, 1.0, 1.0]))
    view = np.eye(4)
    view[2, 3] = 10.0
    scene = Scene(PerspectiveCamera(view, 10.0), (plane,), (light,), Film(16, 16), integrator=Integrator("path", 1))
    found = {}
    for program, name, to in (("mitsuba", "a3.xml", "mitsuba3"), ("luxcore", "a.lxs", "luxrender")):
        save_scene_file(scene, tmp_path / name, to)  # type: ignore[arg-type]
        picture = rendered(program, tmp_path / name, tmp_path / "picture.npy", (16, 16), 256, 120.0)
        assert not isinstance(picture, str), picture
        found[program] = picture.mean(axis=(0, 1))
    save_scene_file(scene, tmp_path / "a.pbrt")
    ours, _ = load_any(str(tmp_path / "a.pbrt"))
    found["ours"] = render_image(Renderer(ours), SamplePlan(256), 16, 16, 0.0, (0.0, 0.0)).mean(dim=(0, 1)).numpy()
    # LuxCore's sun is bluer than Mitsuba's
    np.testing.assert_allclose(found["luxcore"], found["mitsuba"], rtol=0.01 if part == "sky" else 0.15)
    np.testing.assert_allclose(found["ours"], found["mitsuba"], rtol=0.02)


def test_a_renderer_that_fails_is_a_line(tmp_path: Path) -> None:
    assert isinstance(rendered("mitsuba", tmp_path / "none.xml", tmp_path / "a.npy", (8, 8), 1, 60.0), str)
    found = rendered("luxcore", tmp_path / "none.lxs", tmp_path / "b.npy", (8, 8), 1, 60.0)
    assert isinstance(found, str) and "\n" not in found
