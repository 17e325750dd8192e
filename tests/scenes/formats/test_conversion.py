"""Scenes of other renderers into the canonical scene and out again."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from scenes.canonical import (
    ConstantTexture,
    Cube,
    EnvironmentLight,
    Glass,
    Glossy,
    ImageTexture,
    Matte,
    Metal,
    MixMaterial,
    Rectangle,
    SceneError,
    Translucent,
)
from scenes.formats.comparison import difference
from scenes.formats.conversion import load_scene_file, save_scene_file
from scenes.formats.losses import LossReport
from tests.scenes.formats.files import DELIVERED, HEAD, MITSUBA, REAL, needs_data, pbrt, real


@needs_data
@pytest.mark.parametrize("ending", [".pbrt", ".lxs"])
@pytest.mark.parametrize("name", REAL)
def test_real_scenes_come_back_the_same_after_the_first_trip(name: str, ending: str, tmp_path: Path) -> None:
    scene = real(name)
    save_scene_file(scene, tmp_path / f"first{ending}")
    once = load_scene_file(tmp_path / f"first{ending}")
    save_scene_file(once, tmp_path / f"second{ending}")
    assert difference(once, load_scene_file(tmp_path / f"second{ending}")) is None
    assert len(once.instances) == len(scene.instances) and len(once.lights) == len(scene.lights)
    assert difference(once.camera, scene.camera) is None
    if name.startswith("pbrt") and ending == ".pbrt":
        assert difference(scene, once) is None
    assert not list(tmp_path.glob(".partial*"))


def test_the_same_box_in_all_formats_is_the_same_scene() -> None:
    """Files of one author in three syntaxes: cameras, walls, boxes, light and colours agree."""
    ours, other, third = (load_scene_file(DELIVERED / f"cornell-box{ending}") for ending in (".pbrt", ".lxs", ".xml"))
    assert difference(ours.camera, third.camera) is None
    for mine in ours.instances:
        twin = next(one for one in third.instances if np.allclose(one.to_world[:3, 3], mine.to_world[:3, 3], atol=1e-4))
        assert type(twin.shape) is type(mine.shape) and difference(twin.material, mine.material) is None
        assert difference(twin.emission, mine.emission) is None
        if isinstance(mine.shape, Cube):
            sizes = [np.sort(np.linalg.norm(one.to_world[:3, :3], axis=0)) for one in (mine, twin)]
            np.testing.assert_allclose(*sizes, rtol=1e-5)
    assert difference(ours.instances, other.instances) is None and difference(ours.camera, other.camera) is None
    assert sum(isinstance(one.shape, Rectangle) for one in ours.instances) == 6
    assert ours.instances[-1].emission == (17.0, 12.0, 4.0)


@needs_data
@pytest.mark.parametrize(("to", "ending"), [("pbrt4", ".pbrt"), ("mitsuba3", ".xml")])
@pytest.mark.parametrize("name", [*REAL, *MITSUBA])
def test_real_scenes_come_back_from_the_newer_formats(name: str, to: str, ending: str, tmp_path: Path) -> None:
    report = LossReport()
    save_scene_file(real(name), tmp_path / f"first{ending}", to)
    once = load_scene_file(tmp_path / f"first{ending}", None, report)
    save_scene_file(once, tmp_path / f"second{ending}", to)
    assert difference(once, load_scene_file(tmp_path / f"second{ending}")) is None
    assert all("a mesh of" in loss.what for loss in report.losses)


@needs_data
def test_what_real_files_say() -> None:
    report = LossReport()
    scene = real("pbrt/pbrt-v3-rs/objects/instances.pbrt", report)
    assert len(scene.instances) == 11 and not report.losses
    cubes = [one for one in scene.instances if isinstance(one.shape, Cube)]
    assert len(cubes) == 10
    assert all(one.material == Matte(ConstantTexture((0.8, 0.1, 0.01))) for one in cubes)
    spheres = real("pbrt/pbrt-v3-rs/cameras/depth-of-field.pbrt").instances[:5]
    np.testing.assert_allclose([one.to_world[:3, 3] for one in spheres], [[3 - 3 * n, 3 - 3 * n, 0] for n in range(5)])
    assert len(real("pbrt/veach-bidir/scene.pbrt").instances) == 14
    real("pbrt/pbrt-v3-rs/lights/spot.pbrt", report)
    assert [str(loss) for loss in report.losses] == ["spot.pbrt:13:3: light 'spot': parameter 'conedelta': left out"]
    lights = real("luxrender/materials-showcase/scene.lxs").lights
    assert isinstance(lights[0], EnvironmentLight)
    kinds = [type(one.material) for one in real("luxrender/materials-showcase/scene.lxs").instances]
    assert {Metal, Glass, Glossy, MixMaterial, Translucent} <= set(kinds)


def test_handedness_of_look_at(tmp_path: Path) -> None:
    """PBRT's ``LookAt`` alone mirrors; with x turned before it, it is the right-handed view that LuxRender's is."""
    alone, _ = pbrt(tmp_path, "")
    turned, _ = pbrt(tmp_path, "", "Scale -1 1 1\n" + HEAD)
    (tmp_path / "a.lxs").write_text(HEAD)
    lux = load_scene_file(tmp_path / "a.lxs")
    assert np.linalg.det(alone.camera.to_world) == pytest.approx(-1.0)
    assert np.linalg.det(turned.camera.to_world) == pytest.approx(1.0)
    np.testing.assert_allclose(turned.camera.to_world, lux.camera.to_world, atol=1e-12)
    np.testing.assert_allclose(
        lux.camera.to_world, [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 5], [0, 0, 0, 1]], atol=1e-12
    )


def test_images_have_their_first_row_where_the_format_has_it(tmp_path: Path) -> None:
    from PIL import Image

    Image.fromarray(np.random.default_rng(0).integers(0, 255, (4, 4, 3), dtype=np.uint8)).save(tmp_path / "a.png")
    body = HEAD + 'Texture "t" "color" "imagemap" "string filename" "a.png" "float vscale" -2\n'
    body += 'MakeNamedMaterial "m" "string type" "matte" "texture Kd" "t"\nNamedMaterial "m" Shape "sphere"\n'
    (tmp_path / "a.pbrt").write_text(body)
    (tmp_path / "a.lxs").write_text(body)
    ours, lux = (load_scene_file(tmp_path / name).instances[0].material.reflectance for name in ("a.pbrt", "a.lxs"))
    assert isinstance(ours, ImageTexture) and (ours.uv_scale, ours.uv_offset) == ((1.0, -2.0), (0.0, 0.0))
    assert isinstance(lux, ImageTexture) and (lux.uv_scale, lux.uv_offset) == ((1.0, 2.0), (0.0, 1.0))


def test_scenes_in_one_folder_keep_their_meshes(tmp_path: Path) -> None:
    """Two formats write other meshes of the same scene under the same stem."""
    scene, _ = pbrt(tmp_path, 'Shape "sphere"\nShape "cone"\n')
    save_scene_file(scene, tmp_path / "b.xml")
    before = load_scene_file(tmp_path / "b.xml")
    save_scene_file(scene, tmp_path / "b.lxs")
    assert difference(before, load_scene_file(tmp_path / "b.xml")) is None
    assert len(list((tmp_path / "models").iterdir())) == 2  # the cone is the same file


@needs_data
@pytest.mark.parametrize(
    ("to", "ending", "count"),
    [
        ("pbrt", ".pbrt", 10),
        ("pbrt4", ".pbrt", 9),
        ("mitsuba", ".xml", 11),
        ("mitsuba3", ".xml", 10),
        ("luxrender", ".lxs", 6),
    ],
)
def test_how_many_real_scenes_keep_their_picture(to: str, ending: str, count: int, tmp_path: Path) -> None:
    kept = 0
    for name in (*REAL, *MITSUBA):
        report = LossReport()
        scene = real(name, report)
        try:
            save_scene_file(scene, tmp_path / f"a{ending}", to, report, strict=True)
            kept += 1
        except SceneError as error:
            assert "expected a conversion without losses" in str(error)
    assert (len(REAL) + len(MITSUBA), kept) == (18, count)
