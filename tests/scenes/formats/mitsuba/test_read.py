"""Mitsuba scenes into the canonical scene and out again; hostile XML."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from scenes.canonical import (
    CheckerboardTexture,
    ConstantTexture,
    Cube,
    DirectionalLight,
    EnvironmentLight,
    Glass,
    ImageTexture,
    Masked,
    Matte,
    Metal,
    MixMaterial,
    PerspectiveCamera,
    Phong,
    Plastic,
    Sphere,
    SpotLight,
    SunSky,
)
from scenes.formats.comparison import difference
from scenes.formats.conversion import load_scene_file, save_scene_file
from scenes.formats.geometry.meshed import as_mesh
from scenes.formats.losses import LossReport
from tests.scenes.formats.files import DATA, MITSUBA, REAL, SENSOR, mitsuba, needs_data


@needs_data
@pytest.mark.parametrize("ending", [".pbrt", ".lxs", ".xml"])
@pytest.mark.parametrize("name", MITSUBA)
def test_real_scenes_come_back_the_same_after_the_first_trip(name: str, ending: str, tmp_path: Path) -> None:
    scene = load_scene_file(DATA / name)
    save_scene_file(scene, tmp_path / f"first{ending}")
    once = load_scene_file(tmp_path / f"first{ending}")
    save_scene_file(once, tmp_path / f"second{ending}")
    assert difference(once, load_scene_file(tmp_path / f"second{ending}")) is None
    assert len(once.instances) == len(scene.instances) and len(once.lights) == len(scene.lights)
    if ending == ".xml":
        assert difference(scene, once) is None


@needs_data
@pytest.mark.parametrize("name", REAL)
def test_scenes_of_other_formats_come_back_from_mitsuba(name: str, tmp_path: Path) -> None:
    scene = load_scene_file(DATA / name, DATA / name.split("/")[0])
    save_scene_file(scene, tmp_path / "first.xml")
    once = load_scene_file(tmp_path / "first.xml")
    save_scene_file(once, tmp_path / "second.xml")
    assert difference(once, load_scene_file(tmp_path / "second.xml")) is None
    assert difference(once.camera, scene.camera) is None


@needs_data
@pytest.mark.parametrize("name", ["cornell-box", "veach-mis", "veach-bidir"])
def test_the_same_scene_in_two_formats_has_the_same_camera(name: str) -> None:
    """35 degrees across in Mitsuba's veach-mis are 20.114 along the shorter side in PBRT's."""
    ours, other = load_scene_file(DATA / f"mitsuba/{name}/scene.xml"), load_scene_file(DATA / f"pbrt/{name}/scene.pbrt")
    assert difference(ours.camera, other.camera, 1e-4) is None
    assert len(ours.instances) == len(other.instances)
    assert ours.integrator.depth == other.integrator.depth - 1  # the author wrote equal numbers


@needs_data
def test_every_shape_and_light_of_the_feature_scene() -> None:
    report = LossReport()
    scene = load_scene_file(DATA / "mitsuba/features-0.5/scene.xml", None, report)
    kinds = [type(one.shape).__name__ for one in scene.instances]
    # one cube and the disk have textures, which lie on meshes as they do on those of Mitsuba; the third is a cylinder
    assert kinds.count("Sphere") == 3 and kinds.count("Cube") == 2 and kinds.count("Rectangle") == 3
    assert kinds.count("Disk") == 0 and kinds.count("Mesh") == 3
    assert [type(one) for one in scene.lights] == [SpotLight, EnvironmentLight]
    assert isinstance(scene.camera, PerspectiveCamera) and scene.camera.lens_radius == 0.02
    assert scene.camera.fov_deg == pytest.approx(math.degrees(2 * math.atan(math.tan(math.radians(20)) * 270 / 480)))
    paint, gold, glass, checks, pane = (scene.instances[n].material for n in (1, 2, 3, 4, 7))
    assert isinstance(paint, Plastic) and paint.roughness == 0.1
    assert isinstance(gold, Metal) and gold.roughness == (0.05, 0.3) and gold.eta[2] == pytest.approx(1.442, abs=1e-3)
    assert isinstance(glass, Glass) and glass.ior == pytest.approx(1.5 / 1.000277)
    assert isinstance(checks, Matte) and isinstance(checks.reflectance, CheckerboardTexture)
    assert isinstance(pane, Glass) and pane.thin and pane.ior == pytest.approx(1.5046 / 1.00028)
    assert isinstance(scene.instances[6].material, Masked)
    assert scene.film.width_px == 480 and scene.sampler.samples_per_pixel == 64
    assert [loss.what for loss in report.losses] == [
        "path: property 'rrDepth'",
        "sampler 'ldsampler'",
        "banner of the film",
        "nearClip of the sensor",
        "farClip of the sensor",
        "shape 'cylinder'",
        "a textured disk",
    ]


def test_transforms_are_chains_and_look_at_is_right_handed(tmp_path: Path) -> None:
    look = '<transform name="toWorld"><lookAt origin="0, 0, 5" target="0, 0, 0" up="0, 1, 0"/></transform>'
    shape = '<shape type="cube"><transform name="toWorld"><scale x="2"/><rotate z="1" angle="90"/><translate x="1"/>'
    scene, _ = mitsuba(tmp_path, f"{shape}</transform></shape>", SENSOR.replace("</sensor>", f"{look}</sensor>"))
    expected = np.eye(4)
    expected[2, 3] = 5.0
    np.testing.assert_allclose(scene.camera.to_world, expected, atol=1e-12)
    (cube,) = scene.instances
    assert isinstance(cube.shape, Cube)
    np.testing.assert_allclose(cube.to_world, [[0, -1, 0, 1], [2, 0, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]], atol=1e-12)


@pytest.mark.parametrize(
    ("axis", "expected"),
    [("x", 20.1143), ("y", 35.0), ("smaller", 35.0), ("larger", 20.1143), ("diagonal", 17.5760)],
)
def test_field_of_view_by_axis(axis: str, expected: float, tmp_path: Path) -> None:
    """2 atan(tan(17.5°) 720 / d) for the side, or diagonal, d."""
    film = '<film type="hdrfilm"><integer name="width" value="1280"/><integer name="height" value="720"/></film>'
    fov = f'<float name="fov" value="35"/><string name="fovAxis" value="{axis}"/>'
    sensor = f'<sensor type="perspective">{fov}{film}</sensor>'
    camera = mitsuba(tmp_path, "", sensor)[0].camera
    assert isinstance(camera, PerspectiveCamera) and camera.fov_deg == pytest.approx(expected, abs=2e-3)


def test_parameters_names_and_includes(tmp_path: Path) -> None:
    (tmp_path / "part.xml").write_text('<scene version="0.5.0"><bsdf type="diffuse" id="m"/></scene>')
    body = """
    <default name="r" value="2.5"/>
    <include filename="part.xml"/>
    <alias id="m" as="n"/>
    <shape type="sphere"><float name="radius" value="$r"/><ref id="n"/></shape>
    """
    scene, losses = mitsuba(tmp_path, body)
    assert scene.instances[0].shape == Sphere(2.5) and not losses
    assert scene.instances[0].material is scene.materials["m"]


def test_materials(tmp_path: Path) -> None:
    body = """
    <bsdf type="phong" id="p"><float name="exponent" value="50"/><rgb name="specularReflectance" value="0.3"/></bsdf>
    <bsdf type="blendbsdf" id="b"><float name="weight" value="0.25"/><ref id="p"/><bsdf type="diffuse"/></bsdf>
    <bsdf type="mixturebsdf" id="x"><string name="weights" value="0.5, 0.3, 0.2"/>
      <bsdf type="diffuse"/><bsdf type="plastic"/>
      <bsdf type="conductor"><string name="material" value="none"/></bsdf></bsdf>
    <bsdf type="coating" id="c"><bsdf type="diffuse"/></bsdf>
    <bsdf type="roughconductor" id="g"><string name="material" value="Unobtainium"/></bsdf>
    """
    scene, losses = mitsuba(tmp_path, body)
    found = scene.materials
    assert found["p"] == Phong(ConstantTexture((0.5, 0.5, 0.5)), (0.3, 0.3, 0.3), 50.0)
    assert isinstance(found["b"], MixMaterial) and found["b"].first is found["p"]
    assert isinstance(found["x"], MixMaterial) and found["x"].amount == ConstantTexture((0.2, 0.2, 0.2))
    assert found["x"].first.amount.value[0] == pytest.approx(0.3 / 0.8)
    assert found["x"].second.eta == (0.0, 0.0, 0.0)
    assert [loss.split(": ", 1)[1] for loss in losses] == [
        "coating over a material: the material alone",
        "the metal 'Unobtainium', which is not known: copper",
    ]


def test_lights(tmp_path: Path) -> None:
    body = """
    <emitter type="directional"><vector name="direction" x="0" y="-2" z="0"/>
      <spectrum name="irradiance" value="3"/></emitter>
    <emitter type="spot"><transform name="toWorld"><lookat origin="0, 5, 0" target="0, 0, 0"/></transform></emitter>
    <emitter type="sunsky"><vector name="sunDirection" x="0" y="1" z="1"/><float name="turbidity" value="4"/></emitter>
    <emitter type="constant"><srgb name="radiance" value="#808080"/></emitter>
    <medium type="heterogeneous" id="fog"/>
    """
    scene, losses = mitsuba(tmp_path, body)
    sun, spot, sky, even = scene.lights
    assert sun == DirectionalLight((0.0, -1.0, 0.0), (3.0, 3.0, 3.0))
    assert isinstance(spot, SpotLight) and (spot.inner_deg, spot.outer_deg) == (15.0, 20.0)
    np.testing.assert_allclose(np.subtract(spot.target, spot.position), [0, -1, 0], atol=1e-12)
    assert isinstance(sky, SunSky) and sky.turbidity == 4.0
    assert isinstance(even, EnvironmentLight) and even.image[0, 0, 0] == pytest.approx(0.21586, abs=1e-4)
    assert len(losses) == 1 and "participating medium" in losses[0]


def test_images_have_their_first_row_at_the_top_of_v(tmp_path: Path) -> None:
    from PIL import Image

    Image.fromarray(np.zeros((4, 4, 3), np.uint8)).save(tmp_path / "a.png")
    body = """<bsdf type="diffuse" id="m"><texture type="bitmap" name="reflectance">
    <string name="filename" value="a.png"/><float name="vscale" value="3"/></texture></bsdf>"""
    texture = mitsuba(tmp_path, body)[0].materials["m"].reflectance
    assert isinstance(texture, ImageTexture) and (texture.uv_scale, texture.uv_offset) == ((1.0, -3.0), (0.0, 1.0))


@needs_data
def test_mitsuba_renders_what_is_written_for_it_as_the_source_was_meant(tmp_path: Path) -> None:
    """The Cornell box of three formats, path-traced: the mean of the converged reference, within noise."""
    mi = pytest.importorskip("mitsuba")
    mi.set_variant("scalar_rgb")
    for name in (
        "mitsuba/cornell-box/scene.xml",
        "pbrt/cornell-box/scene.pbrt",
        "luxrender/cornell-box/cornell-box.lxs",
    ):
        save_scene_file(load_scene_file(DATA / name), tmp_path / "out.xml", "mitsuba3")
        scene = mi.load_file(str(tmp_path / "out.xml"))
        parameters = mi.traverse(scene)
        (size,) = (key for key in parameters.keys() if key.endswith("film.size"))
        parameters[size] = [32, 32]
        parameters.update()
        mean = np.array(mi.render(scene, spp=64))[..., :3].mean(axis=(0, 1))
        np.testing.assert_allclose(mean, [0.1963, 0.1276, 0.0360], rtol=0.05)


SQUARES = """mtllib none.mtl
v 0 0 0
v 1 0 0
v 1 1 0
v 0 1 0
f 1 2 3
usemtl glass of a window
f 1 3 4
f 1 2 3 4
usemtl wood
f 4 3 2
usemtl glass of a window
f 4 2 1
"""


def _surface(name: str, value: float) -> str:
    return f'<bsdf type="diffuse" name="{name}"><rgb name="reflectance" value="{value} 0 0"/></bsdf>'


@pytest.mark.parametrize(
    ("inside", "wanted", "lost"),
    [
        (_surface("wood", 0.1) + _surface("glass of a window", 0.2), {0.1: 1, 0.2: 4, 0.5: 1}, "library of a mesh"),
        (_surface("", 0.3) + _surface("wood", 0.1), {0.1: 1, 0.3: 5}, None),
        (_surface("wood", 0.1) + _surface("", 0.3), {0.3: 6}, None),
        (_surface("wood", 0.1) + _surface("stone", 0.2), {0.1: 1, 0.5: 5}, "library of a mesh"),
        (_surface("stone", 0.2), {0.2: 6}, None),
        ("", {0.5: 6}, "library of a mesh"),
    ],
)
def test_faces_of_an_obj_file_have_the_materials_of_their_names(
    inside: str, wanted: dict[float, int], lost: str | None, tmp_path: Path
) -> None:
    (tmp_path / "m.obj").write_text(SQUARES)
    shape = f'<shape type="obj"><string name="filename" value="m.obj"/>{inside}</shape>'
    scene, losses = mitsuba(tmp_path, shape)
    found = {}
    for one in scene.instances:
        assert isinstance(one.material, Matte)
        found[one.material.reflectance.value[0]] = len(as_mesh(one.shape).faces)  # type: ignore[union-attr]
    assert found == wanted
    assert [lost in line for line in losses if "no face uses" not in line] == [True] if lost else losses == []
    save_scene_file(scene, tmp_path / "b.xml", "mitsuba")
    assert len(load_scene_file(tmp_path / "b.xml").instances) == len(wanted)
