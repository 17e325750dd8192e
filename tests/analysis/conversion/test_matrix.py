"""Every light and every material in every pair of formats."""

from __future__ import annotations

import math
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path
from typing import get_args

import numpy as np
import pytest

from analysis.command.progress import Task
from analysis.conversion.matrix import BOUND, FINER, GROUPS, differences, losses, matrix_rows, read, worst
from analysis.conversion.media_specimens import FOG, MEDIA, SCATTERING
from analysis.conversion.options import FORMATS_OF
from analysis.conversion.specimens import CELL_PX, DISTANT, LAMPS, MATERIALS
from scenes.canonical import Material, Metal
from scenes.formats.conversion import load_scene_file, save_scene_file

SINGLE = {name: scene for make in GROUPS.values() for name, scene in make().single.items()}


def test_the_matrix_has_every_material_of_the_canonical_scene() -> None:
    assert set(get_args(Material)) == {type(material) for material, _ in MATERIALS.values()}
    assert set(SINGLE) == {*MATERIALS, *LAMPS, *DISTANT, *MEDIA, *SCATTERING, FOG}


needs_usd = pytest.param("usd", marks=pytest.mark.skipif(find_spec("pxr") is None, reason="usd-core is missing"))
FORMATS = [needs_usd if name == "usd" else name for name in FORMATS_OF]


@pytest.mark.parametrize("target", FORMATS)
def test_every_specimen_is_written_and_read_again(target: str, tmp_path: Path) -> None:
    for scene in SINGLE.values():
        losses(scene, "scene", target, tmp_path)


@pytest.mark.slow
@pytest.mark.parametrize("source", FORMATS)
def test_every_specimen_of_every_format_becomes_every_other(source: str, tmp_path: Path) -> None:
    for scene in SINGLE.values():
        for target in FORMATS_OF:
            losses(scene, source, target, tmp_path)


@pytest.mark.parametrize(("specimen", "loss"), [("normal-mapped", "a normal map"), ("height field", "a height field"),
                         ("metallic-roughness", "a metallic-roughness surface")])  # fmt: skip
def test_what_no_format_has_is_a_loss(specimen: str, loss: str, tmp_path: Path) -> None:
    for target in set(FORMATS_OF) - {"usd" if find_spec("pxr") is None else ""}:
        if target in ("gltf", "usd") and specimen != "height field":
            continue  # they have both
        if (specimen, target) == ("normal-mapped", "mitsuba3"):
            continue  # it has normal maps
        assert any(one.startswith(loss) for one in losses(SINGLE[specimen], "scene", target, tmp_path)[0])


def test_a_coloured_mirror_of_the_fourth_pbrt_is_a_metal(tmp_path: Path) -> None:
    mirror = Metal((0.0,) * 3, (1.0,) * 3, reflectance_scale=MATERIALS["mirror"][0].reflectance)  # type: ignore[union-attr]
    scene = SINGLE["mirror"]
    (instance,) = scene.instances
    save_scene_file(replace(scene, instances=(replace(instance, material=mirror),)), tmp_path / "a.pbrt", "pbrt4")
    assert '"conductor"' in (text := (tmp_path / "a.pbrt").read_text()) and "namedmaterial1" not in text
    assert isinstance(load_scene_file(tmp_path / "a.pbrt").instances[0].material, Metal)


def test_an_even_height_is_left_out_as_luxcore_refuses_it(tmp_path: Path) -> None:
    for name, to in (("a.lxs", "luxrender"), ("a.pbrt", "pbrt"), ("b.pbrt", "pbrt4")):
        save_scene_file(SINGLE["matte, bumped"], tmp_path / name, to)
        text = (tmp_path / name).read_text()
        assert "bumpmap" not in text and "displacement" not in text


@pytest.mark.parametrize("specimen", ["matte", "glass", "normal-mapped", "glowing"])
def test_gltf_holds_these_materials_without_a_loss_under_the_sky_of_the_furnace(specimen: str, tmp_path: Path) -> None:
    """glTF has no light all around, and gets it back for the picture."""
    found = GROUPS["materials"]()
    assert losses(SINGLE[specimen], "scene", "gltf", tmp_path)[0] != []
    lost, _ = losses(SINGLE[specimen], "scene", "gltf", tmp_path, None, found.sky)
    allowed = {"glowing": "a surface that shines on both sides", "glass": "sphere"}  # Mitsuba has no such surface
    assert all(allowed.get(specimen, "nothing") in loss for loss in lost), lost
    save_scene_file(SINGLE[specimen], tmp_path / "a.gltf")
    lit, bare = (read(tmp_path / "a.gltf", SINGLE[specimen], sky) for sky in (True, False))
    assert lit.lights == SINGLE[specimen].lights != bare.lights and lit.integrator == bare.integrator


@pytest.mark.parametrize("specimen", ["matte", "glass", "environment, even", "point", "lamp, sphere", "directional"])
def test_usd_holds_these_without_a_loss_but_for_the_depth_of_paths(specimen: str, tmp_path: Path) -> None:
    assert losses(SINGLE[specimen], "scene", "usd", tmp_path)[0] == []
    found = read(tmp_path / "single.usda", SINGLE[specimen], True)
    assert found.integrator == SINGLE[specimen].integrator and len(found.lights) == len(SINGLE[specimen].lights)


@pytest.mark.slow
def test_glass_and_metal_of_gltf_are_as_bright_in_mitsuba(tmp_path: Path) -> None:
    pytest.importorskip("mitsuba")
    rows = matrix_rows(tmp_path, 64, 120.0, Task(), ("materials",), ("mitsuba3", "gltf"))
    for row in rows:
        if row["specimen"] in ("matte", "glass", "metallic-roughness", "normal-mapped", "mask", "glass, rough"):
            assert row["off"] < BOUND and not row["note"], row


def test_differences_are_those_of_the_cells() -> None:
    found = GROUPS["materials"]()
    first = np.ones((found.size_px[1], found.size_px[0], 3), np.float32)
    second = first.copy()
    second[CELL_PX // 2, CELL_PX + CELL_PX // 2] += 6.4  # one of the 8 x 8 pixels that count
    off = differences(found, first, second)
    names = list(MATERIALS)
    assert off[names[1]][0] == pytest.approx(0.1, rel=1e-6)
    assert all(off[name][0] == 0.0 for name in names if name != names[1])
    assert math.isnan(differences(found, first, "no picture")["matte"][0])


def test_pairs_that_differ_in_silence_are_drawn_again_with_more_samples(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The noise of few samples is no difference; that of a spot, whose loss is reported, is drawn once."""
    asked: list[tuple[str, int]] = []

    def noisy(
        program: str, files: list[tuple[Path, Path]], size: tuple[int, int], samples: int, limit_s: float
    ) -> dict:
        asked.append((program, samples))
        dark = 0.1 * (program == "luxcore" and samples == 4)
        return {out: np.full((size[1], size[0], 3), 1.0 - dark, np.float32) for _, out in files}

    monkeypatch.setattr("analysis.conversion.matrix.drawn", noisy)
    rows = matrix_rows(tmp_path, 4, 1.0, Task(), ("point",), ("mitsuba3", "luxrender"))
    assert {row["off"] for row in rows} == {0.0} and {samples for _, samples in asked} == {4, 4 * FINER}
    asked.clear()
    rows = matrix_rows(tmp_path, 4, 1.0, Task(), ("spot, hermite",), ("mitsuba3", "luxrender"))
    across = [row for row in rows if {row["from"], row["to"]} == {"mitsuba3", "luxrender"}]
    assert all(row["losses"] and row["off"] == pytest.approx(0.1, rel=0.2) for row in across)
    assert {samples for _, samples in asked} == {4}


def test_the_worst_pair_of_a_specimen_is_named() -> None:
    row = {"specimen": "a", "from": "pbrt", "to": "mitsuba3", "off": 0.1, "note": "", "losses": []}
    rows = [row, {**row, "to": "pbrt", "off": 0.5, "losses": ["all"]}, {**row, "off": float("nan")}]
    (found,) = worst(rows)
    assert found["worst silent"] == 0.1 and found["pair, silent"] == "pbrt to mitsuba3" and found["pairs"] == 2
    assert found["worst reported"] == 0.5 and found[f"silent beyond {BOUND:.0%}"] == 1
    first, second = worst([*rows, {**row, "specimen": "b", "off": 0.3}], pairs=True)
    assert (first["pair"], first["specimen, silent"], first["worst silent"], first["specimens"]) == (
        "pbrt to mitsuba3", "b", 0.3, 2)  # fmt: skip
    assert (second["pair"], second["specimen, reported"]) == ("pbrt to pbrt", "a")


@pytest.mark.slow
def test_point_lights_are_as_bright_in_every_pair(tmp_path: Path) -> None:
    pytest.importorskip("mitsuba")
    pytest.importorskip("pyluxcore")
    pytest.importorskip("pxr")
    rows = matrix_rows(tmp_path, 64, 120.0, Task(), ("point",))
    assert len(rows) == 56 and all(row["note"] == "" and row["off"] < BOUND for row in rows), rows


def _media_are_alike(folder: Path, samples: int, groups: tuple[str, ...], formats: tuple[str, ...]) -> None:
    pytest.importorskip("mitsuba")
    pytest.importorskip("pyluxcore")
    for row in matrix_rows(folder, samples, 120.0, Task(), groups, formats):
        lost = any("a medium" in loss or "Schlick" in loss for loss in row["losses"])
        assert not row["note"] and (lost or row["off"] < BOUND), row


def test_media_are_as_bright_in_both_renderers(tmp_path: Path) -> None:
    _media_are_alike(tmp_path, 16, ("media", "fog"), ("mitsuba3", "luxrender"))


@pytest.mark.slow
def test_media_are_as_bright_in_every_pair(tmp_path: Path) -> None:
    _media_are_alike(tmp_path, 64, ("media", "media in the sun", "fog"), tuple(FORMATS_OF))
