"""Scenes of PBRT and LuxRender into the canonical scene and out again; files that are not to be trusted."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from scenes.canonical import (
    CheckerboardTexture,
    ConstantTexture,
    Cube,
    DirectionalLight,
    EnvironmentLight,
    Glass,
    Glossy,
    ImageTexture,
    Masked,
    Matte,
    Mesh,
    Metal,
    MixMaterial,
    PerspectiveCamera,
    Rectangle,
    Sphere,
    SpotLight,
    Translucent,
    Uber,
)
from scenes.formats.appearance.spectra import METALS, blackbody_rgb, sampled_rgb
from scenes.formats.comparison import difference
from scenes.formats.conversion import load_scene_file, save_scene_file
from scenes.formats.geometry.meshed import as_mesh
from scenes.formats.geometry.recognition import recognised_rectangle
from scenes.formats.losses import LossReport
from tests.scenes.formats.files import DELIVERED, HEAD, REAL, needs_data, pbrt, real


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


@pytest.mark.parametrize(
    ("parameters", "expected"),
    [
        ('"float fov" 35', 35.0),
        ("", 90.0),
        ('"float halffov" 20', 40.0),
        (
            '"float fov" 35 "float screenwindow" [-2 2 -2 2]',
            math.degrees(2 * math.atan(2 * math.tan(math.radians(17.5)))),
        ),
        ('"float fov" 35 "float screenwindow" [-1.7778 1.7778 -1 1]', 35.0),
    ],
)
def test_field_of_view_is_that_of_the_shorter_side(parameters: str, expected: float, tmp_path: Path) -> None:
    scene, _ = pbrt(tmp_path, "", f'Camera "perspective" {parameters}\nWorldBegin\n')
    assert isinstance(scene.camera, PerspectiveCamera) and scene.camera.fov_deg == pytest.approx(expected)


def test_transforms_and_attribute_stacks(tmp_path: Path) -> None:
    body = """
    Translate 1 0 0
    AttributeBegin
      Scale 2 2 2
      CoordinateSystem "here"
      TransformBegin
        Rotate 90 0 0 1
        Translate 1 0 0
        Shape "sphere"
      TransformEnd
      Shape "sphere" "float radius" 3
      AttributeBegin
        Identity
        CoordSysTransform "here"
        Shape "sphere"
        Material "mirror"
      AttributeEnd
      Transform [1 0 0 0  0 1 0 0  0 0 1 0  7 8 9 1]
      ConcatTransform [1 0 0 0  0 1 0 0  0 0 1 0  0 0 1 1]
      Shape "sphere"
    AttributeEnd
    Shape "sphere"
    """
    scene, losses = pbrt(tmp_path, body)
    found = [one.to_world[:3, 3].tolist() for one in scene.instances]
    np.testing.assert_allclose(found, [[1, 2, 0], [1, 0, 0], [1, 0, 0], [7, 8, 10], [1, 0, 0]], atol=1e-12)
    assert scene.instances[1].shape == Sphere(3.0) and not losses
    assert all(one.material == Matte(ConstantTexture((0.5, 0.5, 0.5))) for one in scene.instances)


def test_motion_is_kept_where_it_is_rigid(tmp_path: Path) -> None:
    body = """
    TransformTimes 0 2
    AttributeBegin
      ActiveTransform EndTime
      Translate 4 0 0
      Rotate 90 0 0 1
      ActiveTransform All
      Shape "sphere"
      ActiveTransform EndTime
      Scale 2 2 2
      ActiveTransform All
      Shape "sphere"
    AttributeEnd
    """
    scene, losses = pbrt(tmp_path, body)
    track = scene.instances[0].track
    assert track is not None and (track.start_s, track.interval_s) == (0.0, 2.0)
    np.testing.assert_allclose(track.translation, [[0, 0, 0], [4, 0, 0]], atol=1e-12)
    np.testing.assert_allclose(track.rotation[1], [0, 0, math.sqrt(0.5), math.sqrt(0.5)], atol=1e-12)
    assert scene.instances[1].track is None and ["a motion that is not rigid" in loss for loss in losses] == [True]


def test_roughness_is_remapped_where_pbrt_does(tmp_path: Path) -> None:
    """A roughness of 0.5 is an alpha of 0.8058 (the polynomial by hand); false takes it as it is."""
    body = 'Material "metal" "float roughness" 0.5 {}\nShape "sphere"\n'
    remapped, _ = pbrt(tmp_path, body.format(""))
    plain, _ = pbrt(tmp_path, body.format('"bool remaproughness" "false"'))
    x = math.log(0.5)
    alpha = 1.62142 + 0.819955 * x + 0.1734 * x**2 + 0.0171201 * x**3 + 0.000640711 * x**4
    assert remapped.instances[0].material.roughness == pytest.approx((alpha, alpha))
    assert plain.instances[0].material.roughness == (0.5, 0.5)


def test_materials_and_textures_of_pbrt(tmp_path: Path) -> None:
    body = """
    Texture "c" "spectrum" "checkerboard" "float uscale" 3 "float vscale" 2 "rgb tex1" [1 0 0] "rgb tex2" [0 0 1]
    Texture "h" "float" "constant" "float value" 0.25
    MakeNamedMaterial "a" "string type" "mirror"
    MakeNamedMaterial "b" "string type" "matte" "texture Kd" "c" "float sigma" 20
    Material "mix" "string namedmaterial1" "a" "string namedmaterial2" "b" "rgb amount" [0.2 0.2 0.2]
    Shape "sphere"
    Material "uber" "rgb Kd" [.1 .2 .3] "rgb opacity" [.5 .5 .5] "texture bumpmap" "h" "float strange" 3
    Shape "sphere" "float alpha" 0.5
    Material "hair"
    Shape "curve" "point P" [0 0 0 1 1 1 2 2 2 3 3 3]
    """
    scene, losses = pbrt(tmp_path, body)
    mixed, bumped = (one.material for one in scene.instances)
    assert isinstance(mixed, MixMaterial) and isinstance(mixed.second, type(scene.materials["a"]))
    assert mixed.first == scene.materials["b"] and mixed.amount == ConstantTexture((0.2, 0.2, 0.2))
    checks = scene.materials["b"].reflectance
    assert isinstance(checks, CheckerboardTexture) and checks.uv_scale == (3.0, 2.0)
    assert isinstance(bumped, Masked) and isinstance(bumped.base.base, Uber)
    assert [loss.split(": ", 1)[1] for loss in losses] == [
        "material 'uber': parameter 'strange': left out",
        "material 'hair': matte of its base colour",
        "hair (curve): left out",
    ]


def test_lights_of_pbrt(tmp_path: Path) -> None:
    body = """
    LightSource "distant" "point from" [0 0 9] "point to" [0 0 0] "rgb L" [1 2 3] "rgb scale" [2 2 2]
    LightSource "spot" "float coneangle" 40 "float conedeltaangle" 10 "rgb I" [1 1 1]
    LightSource "infinite" "blackbody L" [6500 2]
    MakeNamedMedium "fog" "string type" "homogeneous"
    """
    scene, losses = pbrt(tmp_path, body)
    sun, spot, sky = scene.lights
    assert sun == DirectionalLight((0.0, 0.0, -1.0), (2.0, 4.0, 6.0))
    assert isinstance(spot, SpotLight) and (spot.inner_deg, spot.outer_deg) == (30.0, 40.0)
    assert isinstance(sky, EnvironmentLight) and sky.image.shape == (1, 1, 3)
    assert len(losses) == 1 and "participating medium" in losses[0]


def test_environment_maps_keep_their_directions(tmp_path: Path) -> None:
    """A texel of PBRT's map at u, θ lies along (cos 2πu sin θ, sin 2πu sin θ, cos θ), by our axes as by its."""
    from torch import rand

    from renderer.film.files import write_exr

    write_exr(tmp_path / "sky.exr", rand(8, 16, 3))
    body = 'Rotate 30 0 1 0\nLightSource "infinite" "string mapname" "sky.exr"\n'
    scene, _ = pbrt(tmp_path, body)
    (light,) = scene.lights
    angle = math.radians(30.0)
    turn = np.array([[math.cos(angle), 0, math.sin(angle)], [0, 1, 0], [-math.sin(angle), 0, math.cos(angle)]])
    for u, theta in ((0.1, 0.3), (0.6, 2.0), (0.9, 1.2)):
        phi = 2.0 * math.pi * u
        theirs = turn @ [math.cos(phi) * math.sin(theta), math.sin(phi) * math.sin(theta), math.cos(theta)]
        canonical = [math.sin(phi) * math.sin(theta), math.cos(theta), -math.cos(phi) * math.sin(theta)]
        np.testing.assert_allclose(light.to_world[:3, :3] @ canonical, theirs, atol=1e-12)


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


def test_light_given_by_power_is_spread_over_its_area(tmp_path: Path) -> None:
    """100 W at 17 lm/W over a square of four units: radiance 1700 / (4 π) of luminance 1."""
    body = 'AreaLightSource "area" "color L" [1 1 1]\nShape "trianglemesh" "integer indices" [0 1 2 0 2 3] '
    body += '"point P" [-1 -1 0 1 -1 0 1 1 0 -1 1 0]\n'
    (tmp_path / "a.lxs").write_text(HEAD + body)
    (lamp,) = load_scene_file(tmp_path / "a.lxs").instances
    assert lamp.emission == pytest.approx((1700.0 / (4.0 * math.pi),) * 3, rel=1e-4)


# --- recognition and spectra -----------------------------------------------------------------------------------------


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=30, deadline=None)
def test_rectangles_are_recognised_under_any_transform(seed: int) -> None:
    rng = np.random.default_rng(seed)
    matrix = np.eye(4)
    matrix[:3, :2], matrix[:3, 3] = rng.normal(size=(3, 2)), rng.normal(size=3)
    normal = np.cross(matrix[:3, 0], matrix[:3, 1])
    matrix[:3, 2] = normal / np.linalg.norm(normal)
    plain = as_mesh(Rectangle())
    points = (plain.vertices @ matrix[:3, :3].T + matrix[:3, 3]).astype(np.float32)
    normals = np.tile(matrix[:3, 2], (4, 1)).astype(np.float32)
    found = recognised_rectangle(Mesh(points, plain.faces, normals, plain.uvs))
    assert found is not None
    np.testing.assert_allclose(found, matrix, atol=1e-4 * np.abs(matrix).max() + 1e-5)
    bent = points.copy()
    bent[2] += 0.1 * np.abs(points).max()
    assert recognised_rectangle(Mesh(bent, plain.faces, normals, plain.uvs)) is None
    assert recognised_rectangle(Mesh(points, plain.faces, -normals, plain.uvs)) is None


def test_metals_are_those_of_mitsuba() -> None:
    mi = pytest.importorskip("mitsuba")
    mi.set_variant("scalar_rgb")
    for name, (eta, k) in METALS.items():
        found = mi.traverse(mi.load_dict({"type": "conductor", "material": name}))
        np.testing.assert_allclose(eta, list(found["eta.value"]), atol=2e-5)
        np.testing.assert_allclose(k, list(found["k.value"]), atol=2e-5)


def test_colours_of_spectra() -> None:
    flat = np.array(sampled_rgb(np.array([400.0, 700.0]), np.array([1.0, 1.0])))
    assert flat @ [0.2126, 0.7152, 0.0722] == pytest.approx(1.0, abs=0.01)
    red, _, blue = blackbody_rgb(2000.0, 1.0)
    assert red > 5.0 * blue
    warm = np.array(blackbody_rgb(6504.0, 1.0))
    assert warm.max() / warm.min() < 1.1  # next to white D65


# --- files that are not to be trusted --------------------------------------------------------------------------------


def test_cameras_of_other_kinds(tmp_path: Path) -> None:
    for kind, ending in (("orthographic", ".pbrt"), ("environment", ".pbrt"), ("realistic", ".pbrt")):
        scene, _ = pbrt(tmp_path, "", HEAD.replace("perspective", kind))
        save_scene_file(scene, tmp_path / f"out{ending}")
        assert difference(scene, load_scene_file(tmp_path / f"out{ending}")) is None


@pytest.mark.parametrize(
    ("body", "loss"),
    [
        ('Shape "blob" "float size" 2', "shape 'blob', which is not known: left out"),
        ('Shape "curve"', "hair (curve): left out"),
        ('Material "plaster" "rgb c" [1 1 1]', "material 'plaster', which is not known: grey, matte"),
        ('LightSource "bulb" "float watts" 60', "light 'bulb', which is not known: left out"),
        ('Texture "t" "color" "cells" "float size" 2', "texture 'cells', which is not known: the constant 0.5"),
        ('AreaLightSource "glowing"', "area light 'glowing', which is not known: diffuse"),
        ('MakeNamedMedium "fog" "string type" "homogeneous"', "MakeNamedMedium 'fog' (participating medium): left out"),
        ('MediumInterface "fog" ""', "MediumInterface 'fog' (participating medium): left out"),
    ],
)
def test_what_is_not_known_is_reported_once_and_the_rest_is_read(body: str, loss: str, tmp_path: Path) -> None:
    scene, lost = pbrt(tmp_path, f'{body}\nShape "sphere"')
    assert lost == [f"a.pbrt:4:1: {loss}"] and len(scene.instances) == 1
    scene, lost = pbrt(tmp_path, "", 'Integrator "guess"\nPixelFilter "soft"\nSampler "dice"\n' + HEAD)
    assert [one.split(": ")[1] for one in lost] == [
        "integrator 'guess', which is not known", "filter 'soft', which is not known",
        "sampler 'dice', which is not known",
    ]  # fmt: skip


def test_spectra_of_lamps_are_textures_in_luxrender(tmp_path: Path) -> None:
    lamps = ('"blackbody" "float temperature" [3000]', '"equalenergy" "float energy" [0.7]')
    lines = [f'Texture "t{n}" "color" {kind}' for n, kind in enumerate(lamps)]
    lines += [f'LightSource "point" "texture L" ["t{n}"] "float power" [0]' for n in range(2)]
    (tmp_path / "a.lxs").write_text(HEAD + "\n".join(lines))
    report = LossReport()
    warm, even = load_scene_file(tmp_path / "a.lxs", None, report).lights
    assert warm.intensity[0] > 2.0 * warm.intensity[2] > 0.0 and even.intensity == (0.7, 0.7, 0.7)  # type: ignore[union-attr]
    assert not report.losses


def test_scenes_in_one_folder_keep_their_meshes(tmp_path: Path) -> None:
    """Two formats write other meshes of the same scene under the same stem."""
    scene, _ = pbrt(tmp_path, 'Shape "sphere"\nShape "cone"\n')
    save_scene_file(scene, tmp_path / "b.xml")
    before = load_scene_file(tmp_path / "b.xml")
    save_scene_file(scene, tmp_path / "b.lxs")
    assert difference(before, load_scene_file(tmp_path / "b.xml")) is None
    assert len(list((tmp_path / "models").iterdir())) == 2  # the cone is the same file
