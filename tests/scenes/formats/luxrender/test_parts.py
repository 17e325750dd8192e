"""LuxRender scenes in three files."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from scenes import catalog
from scenes.formats.comparison import difference
from scenes.formats.conversion import load_scene_file, save_scene_file
from tests.scenes.formats.files import DELIVERED, MITSUBA, REAL, needs_data, real, seen


@needs_data
@pytest.mark.parametrize("name", [*REAL, *MITSUBA])
def test_three_files_are_the_same_scene_as_one(name: str, tmp_path: Path) -> None:
    scene = real(name)
    save_scene_file(scene, tmp_path / "one.lxs")
    save_scene_file(scene, tmp_path / "three.lxs", "luxrender-parts")
    once = load_scene_file(tmp_path / "one.lxs")
    assert difference(once, load_scene_file(tmp_path / "three.lxs")) is None
    texts = {ending: (tmp_path / f"three{ending}").read_text() for ending in (".lxs", ".lxm", ".lxo")}
    words = {ending: {line.split()[0] for line in text.splitlines()} for ending, text in texts.items()}
    assert words[".lxm"] <= {"Texture", "MakeNamedMaterial"} and "MakeNamedMaterial" in words[".lxm"]
    assert "Shape" in words[".lxo"] and not words[".lxo"] & {"Texture", "MakeNamedMaterial", "LightSource"}
    assert not words[".lxs"] & {"Texture", "MakeNamedMaterial", "Shape", "NamedMaterial"}
    save_scene_file(once, tmp_path / "again.lxs", "luxrender-parts")
    assert difference(once, load_scene_file(tmp_path / "again.lxs")) is None


def test_luxcore_draws_three_files_as_one(tmp_path: Path) -> None:
    scene = load_scene_file(DELIVERED / "cornell-box.pbrt")
    save_scene_file(scene, tmp_path / "one.lxs")
    save_scene_file(scene, tmp_path / "three.lxs", "luxrender-parts")
    one, three = (seen("luxcore", tmp_path / name, 16, 64) for name in ("one.lxs", "three.lxs"))
    assert one.mean() > 0.1
    np.testing.assert_allclose(three, one, rtol=0.3, atol=0.1 * one.mean())
    assert three.mean() == pytest.approx(one.mean(), rel=0.02)


def test_a_name_with_quotes_is_found_again(tmp_path: Path) -> None:
    file = tmp_path / 'a"b c.lxs'
    save_scene_file(catalog.load("quad-light"), file, "luxrender-parts")
    assert len(load_scene_file(file).instances) == len(catalog.load("quad-light").instances)
