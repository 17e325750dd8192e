"""USD files as scenes for conversion: what comes back, and the pictures that renderers make of it."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from scenes.canonical import (
    ConstantTexture,
    EnvironmentLight,
    Film,
    Glass,
    Instance,
    Matte,
    MetallicRough,
    Rectangle,
    Sphere,
)
from scenes.formats.comparison import difference
from scenes.formats.conversion import load_scene_file, save_scene_file
from scenes.formats.losses import LossReport
from tests.scenes.formats.files import DELIVERED, MITSUBA, REAL, drawn, needs_data, real
from tests.scenes.formats.gltf.files import GREY
from tests.scenes.formats.gltf.test_read import SIDE_PX, blocks, scene_of

pytest.importorskip("pxr")


@needs_data
@pytest.mark.parametrize("name", [*REAL, *MITSUBA])
def test_real_scenes_come_back_from_usd(name: str, tmp_path: Path) -> None:
    """The same scene after the first trip, in text, in binary and in a package."""
    scene = real(name)
    save_scene_file(scene, tmp_path / "a.usda")
    trips = [load_scene_file(tmp_path / "a.usda")]
    for file in ("b.usdc", "c.usdz"):
        save_scene_file(trips[-1], tmp_path / file)
        trips.append(load_scene_file(tmp_path / file))
    assert difference(trips[0], trips[1]) is None and difference(trips[1], trips[2]) is None
    assert len(trips[0].instances) == len(scene.instances)
    save_scene_file(scene, tmp_path / "again" / "a.usda")
    assert (tmp_path / "again" / "a.usda").read_bytes() == (tmp_path / "a.usda").read_bytes()


@pytest.mark.parametrize("name", ["a.usda", "a.usdz"])
def test_mitsuba_draws_a_scene_and_its_file_alike(name: str, tmp_path: Path) -> None:
    """Mitsuba's pictures of a scene and of what comes back from its USD file: metal, matte, glass, a sky of a picture,
    a lamp alone and one that reflects."""
    gradient = np.linspace(0.1, 0.6, 8 * 16 * 3, dtype=np.float32).reshape(8, 16, 3)
    turn = np.array([[0.0, 0, 1, 0], [0, 1, 0, 0], [-1, 0, 0, 0], [0, 0, 0, 1]])
    down = np.array([[0.5, 0, 0, -2], [0, 0, 1, 4.0], [0, -0.5, 0, 1], [0, 0, 0, 1]])
    down = down @ np.diag([1.0, -1.0, -1.0, 1.0])
    black = Matte(ConstantTexture((0.0, 0.0, 0.0)))
    scene = scene_of(
        MetallicRough(ConstantTexture((0.9, 0.6, 0.3)), 1.0, 0.5), Matte(ConstantTexture((0.2, 0.4, 0.6))), Glass()
    )
    ball = np.diag([0.3, 0.3, 0.3, 1.0])
    ball[:3, 3] = (2.5, 3.0, 1.0)
    lamps = (
        Instance(Rectangle(), black, down, emission=(12.0, 9.0, 6.0)),
        Instance(Sphere(), GREY, ball, emission=(6.0, 6.0, 9.0)),
    )
    scene = dataclasses.replace(
        scene, instances=(*scene.instances, *lamps), lights=(*scene.lights, EnvironmentLight(gradient, turn, 0.7))
    )
    report = LossReport()
    save_scene_file(scene, tmp_path / name, None, report)
    assert not [str(loss) for loss in report.losses if loss.picture]
    read = dataclasses.replace(load_scene_file(tmp_path / name, None, report), film=Film(SIDE_PX, SIDE_PX))
    direct, through = (drawn(one, "mitsuba", tmp_path, SIDE_PX, 512) for one in (scene, read))
    assert direct.mean() > 0.1
    np.testing.assert_allclose(blocks(through), blocks(direct), rtol=0.06, atol=0.02 * direct.mean())


@pytest.mark.parametrize("ending", [".pbrt", ".xml"])
def test_the_cornell_box_is_the_same_picture_by_way_of_usd(ending: str, tmp_path: Path) -> None:
    scene = load_scene_file(DELIVERED / f"cornell-box{ending}")
    save_scene_file(scene, tmp_path / "a.usdc")
    read = dataclasses.replace(
        load_scene_file(tmp_path / "a.usdc"), film=Film(SIDE_PX, SIDE_PX), integrator=scene.integrator
    )
    direct, through = (drawn(one, "mitsuba", tmp_path, SIDE_PX, 512) for one in (scene, read))
    np.testing.assert_allclose(blocks(through), blocks(direct), rtol=0.08, atol=0.03 * direct.mean())
