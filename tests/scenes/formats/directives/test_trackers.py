"""What reports in public trackers of PBRT and LuxRender turned up: parameters, spaces, lights and meshes.

Sources: ``paramset.cpp``, ``api.cpp``, ``lights/point.cpp`` and ``shapes/triangle.cpp`` of PBRT v3; LuxCore 2.10.
"""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from scenes.canonical import ConstantTexture, Matte, Mesh, Mirror, OrthographicCamera, PerspectiveCamera, PointLight
from scenes.formats.conversion import load_scene_file, save_scene_file
from scenes.formats.losses import LossReport
from tests.scenes.formats.files import HEAD, pbrt, seen
from tests.scenes.formats.test_light import even, furnace

V4 = 'Film "rgb"\nCamera "perspective"\nWorldBegin\n'
POINT = 'Rotate 90 0 0 1\nTranslate 0 0 5\nScale 2 2 2\nLightSource "point" "{}" [ 1 0 0 ]\nShape "sphere"\n'


def _light(scene) -> PointLight:
    (found,) = scene.lights
    assert isinstance(found, PointLight)
    return found


@pytest.mark.parametrize("name", ["a.pbrt", "a.lxs"])
@pytest.mark.parametrize(
    ("given", "expected"),
    [
        ('"color Kd" [ 1 0 0 ] "color Kd" [ 0 1 0 ]', (0.0, 1.0, 0.0)),
        ('"color Kd" [ 1 0 0 ] "texture Kd" "t"', (0.0, 0.0, 1.0)),
        ('"texture Kd" "t" "color Kd" [ 1 0 0 ]', (0.0, 0.0, 1.0)),
    ],
)
def test_the_last_value_of_a_parameter_counts_and_a_texture_before_it(
    name: str, given: str, expected: tuple[float, float, float], tmp_path: Path
) -> None:
    texture = 'Texture "t" "color" "constant" "color value" [ 0 0 1 ]\n'
    scene, losses = pbrt(tmp_path, f'{texture}Material "matte" {given}\nShape "sphere"\n', name=name)
    assert scene.instances[0].material == Matte(ConstantTexture(expected)) and not losses


def test_a_parameter_of_a_directive_counts_before_that_of_an_attribute(tmp_path: Path) -> None:
    body = 'Attribute "material" "rgb reflectance" [ 1 0 0 ]\nMaterial "diffuse" "rgb reflectance" [ 0 1 0 ]\n'
    scene, _ = pbrt(tmp_path, f'{body}Shape "sphere"\n', V4)
    assert scene.instances[0].material == Matte(ConstantTexture((0.0, 1.0, 0.0)))


@pytest.mark.parametrize(
    ("name", "head", "kind", "expected"),
    [
        ("a.pbrt", HEAD, "point from", (1.0, 0.0, 5.0)),
        ("a.lxs", HEAD, "point from", (1.0, 0.0, 5.0)),
        ("a.pbrt", V4, "point3 from", (0.0, 2.0, 5.0)),
    ],
)
def test_the_place_of_a_point_light_is_turned_with_its_space_in_version_4_alone(
    name: str, head: str, kind: str, expected: tuple[float, float, float], tmp_path: Path
) -> None:
    scene, _ = pbrt(tmp_path, POINT.format(kind), head, name)
    assert _light(scene).position == pytest.approx(expected, abs=1e-9)


def test_the_place_of_a_point_light_of_luxcore_is_turned_with_its_space(tmp_path: Path) -> None:
    path = tmp_path / "a.scn"
    path.write_text(
        "scene.lights.l.type = point\nscene.lights.l.position = 1 0 0\n"
        "scene.lights.l.transformation = 0 1 0 0 -1 0 0 0 0 0 1 0 0 0 5 1\n"
    )
    assert _light(load_scene_file(path)).position == pytest.approx((0.0, 1.0, 5.0), abs=1e-9)


def test_a_world_begins_without_transform_at_all_times(tmp_path: Path) -> None:
    head = 'ActiveTransform EndTime\nTranslate 0 0 1\nCamera "perspective"\nWorldBegin\n'
    scene, losses = pbrt(tmp_path, 'Translate 3 0 0\nShape "sphere"\n', head)
    assert scene.instances[0].track is None and scene.camera.track is not None and not losses
    assert scene.instances[0].to_world[:3, 3].tolist() == [3.0, 0.0, 0.0]


def test_the_world_is_a_coordinate_system(tmp_path: Path) -> None:
    scene, losses = pbrt(tmp_path, 'Translate 3 0 0\nCoordSysTransform "world"\nShape "sphere"\n')
    assert np.array_equal(scene.instances[0].to_world, np.eye(4)) and not losses


@pytest.mark.parametrize(("head", "count"), [(HEAD, 1), (V4, 1)])
def test_lamps_inside_objects_are_named(head: str, count: int, tmp_path: Path) -> None:
    body = 'ObjectBegin "o"\nAreaLightSource "diffuse"\nShape "sphere"\nObjectEnd\n' + 'ObjectInstance "o"\n' * 2
    scene, losses = pbrt(tmp_path, body, head)
    assert len(scene.instances) == 2 and all(one.emission is not None for one in scene.instances)
    assert sum("an area light inside an object" in loss for loss in losses) == count


@pytest.mark.parametrize(("name", "lost"), [('"normal N" [ 0 0 1 ]', "N"), ('"float uv" [ 0 0 1 0 ]', "uv")])
@pytest.mark.parametrize(
    "mesh",
    ['Shape "trianglemesh" "integer indices" [ 0 1 2 ]', 'Shape "bilinearmesh" "integer indices" [ 0 1 2 2 ]'],
)
def test_values_of_another_count_than_the_points_are_left_out(mesh: str, name: str, lost: str, tmp_path: Path) -> None:
    scene, losses = pbrt(tmp_path, f'{mesh} "point P" [ 0 0 0 1 0 0 0 1 0 ] {name}\n')
    (one,) = scene.instances
    assert isinstance(one.shape, Mesh) and one.shape.normals is None and one.shape.uvs is None
    assert any(f"{lost} of a mesh" in loss for loss in losses)


def test_three_points_are_a_triangle(tmp_path: Path) -> None:
    scene, losses = pbrt(tmp_path, 'Shape "trianglemesh" "point3 P" [ 0 0 0 1 0 0 0 1 0 ]\n', V4)
    assert scene.instances[0].shape.faces.tolist() == [[0, 1, 2]] and not losses


def test_point_lights_come_back_where_they_were(tmp_path: Path) -> None:
    scene, _ = pbrt(tmp_path, POINT.format("point from"))
    for name in ("b.pbrt", "b.lxs"):
        save_scene_file(scene, tmp_path / name, report=LossReport())
        assert _light(load_scene_file(tmp_path / name)).position == pytest.approx((1.0, 0.0, 5.0))


LOOK = "LookAt 1 2 6 0 0 0 0 1 0\n"
WIDE = math.degrees(2.0 * math.atan(2.0 * math.tan(math.radians(20.0))))


@pytest.mark.parametrize(
    ("scale", "lens", "focus", "fov"),
    [
        ("2 2 2", 0.05, 0.5, 40.0),
        ("-2 2 2", 0.05, 0.5, 40.0),
        ("1 1 2", 0.1, 0.5, WIDE),
        (".5 .5 1", 0.2, 1.0, WIDE),
    ],
)
def test_a_camera_with_a_scale_is_one_without(
    scale: str, lens: float, focus: float, fov: float, tmp_path: Path
) -> None:
    camera = 'Camera "perspective" "float fov" 40 "float lensradius" .1 "float focaldistance" 1\nWorldBegin\n'
    scene, losses = pbrt(tmp_path, 'Shape "sphere"\n', f"Scale {scale}\n{LOOK}{camera}")
    assert isinstance(scene.camera, PerspectiveCamera) and not losses
    axes = scene.camera.to_world[:3, :3]
    assert np.allclose(axes.T @ axes, np.eye(3))
    found = scene.camera.lens_radius, scene.camera.focal_distance, scene.camera.fov_deg
    assert found == pytest.approx((lens, focus, fov), abs=1e-3)


def test_a_camera_that_stretches_is_named(tmp_path: Path) -> None:
    _, losses = pbrt(tmp_path, 'Shape "sphere"\n', f'Scale 2 1 1\n{LOOK}Camera "perspective"\nWorldBegin\n')
    assert any("stretches its picture" in loss for loss in losses)


@pytest.mark.parametrize("to", ["pbrt", "luxrender", "mitsuba3", "gltf", "usd"])
def test_the_scale_of_a_parallel_view_is_the_size_of_its_picture(to: str, tmp_path: Path) -> None:
    film = 'Film "image" "integer xresolution" 64 "integer yresolution" 64\n'
    head = f'Scale .25 .25 .25\n{LOOK}Camera "orthographic"\n{film}'
    scene, _ = pbrt(tmp_path, 'Shape "sphere"\n', head + "WorldBegin\n")
    ending = {"pbrt": "pbrt", "luxrender": "lxs", "mitsuba3": "xml", "gltf": "gltf", "usd": "usda"}[to]
    path = tmp_path / f"b.{ending}"
    save_scene_file(scene, path, to, LossReport())
    for camera in (scene.camera, load_scene_file(path).camera):
        assert isinstance(camera, OrthographicCamera) and camera.half_width == pytest.approx(4.0)


@pytest.mark.parametrize(("head", "name"), [(HEAD, "mapname"), (V4, "filename")])
def test_an_environment_map_has_no_size(head: str, name: str, tmp_path: Path) -> None:
    Image.fromarray(np.zeros((4, 4, 3), np.uint8)).save(tmp_path / "a.png")
    light = f'Rotate 30 0 0 1\nLightSource "infinite" "string {name}" "a.png"\n'
    found = [pbrt(tmp_path, scale + light, head)[0].lights[0].to_world for scale in ("", "Scale 5 5 5\n")]
    assert np.allclose(*found)


@pytest.mark.parametrize("to", ["pbrt4", "mitsuba", "mitsuba3", "luxrender"])
def test_reflectances_above_1_are_1_where_the_target_refuses_or_changes_them(to: str, tmp_path: Path) -> None:
    scene, _ = pbrt(tmp_path, 'Material "matte" "rgb Kd" [ 1.2 .5 .25 ]\nShape "sphere"\n')
    report, path = LossReport(), tmp_path / ("b.pbrt" if to == "pbrt4" else "b.lxs" if to == "luxrender" else "b.xml")
    save_scene_file(scene, path, to, report)
    assert load_scene_file(path).instances[0].material == Matte(ConstantTexture((1.0, 0.5, 0.25)))
    assert "a reflectance of 1.2" in [loss.what for loss in report.losses if loss.picture]


@pytest.mark.parametrize("kind, name", [(Matte, "Kd"), (Mirror, "Kr")])
def test_luxcore_takes_reflectances_above_1_for_1(kind: type, name: str, tmp_path: Path) -> None:
    file = tmp_path / "a.lxs"
    save_scene_file(furnace([kind(even(1.0))]), file, None)
    file.write_text(file.read_text().replace(f'"color {name}" [ 1 1 1 ]', f'"color {name}" [ 3 3 3 ]'))
    assert "[ 3 3 3 ]" in file.read_text()
    assert seen("luxcore", file, 16, 64)[6:10, 6:10].mean() == pytest.approx(1.0, abs=0.01)
