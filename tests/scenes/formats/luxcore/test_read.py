"""LuxCore's own scenes, read into the canonical scene."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from scenes.canonical import (
    CheckerboardTexture,
    ConstantTexture,
    DirectionalLight,
    EnvironmentLight,
    Glass,
    Glossy,
    ImageTexture,
    Masked,
    Material,
    Matte,
    Mesh,
    Metal,
    MetallicRough,
    Mirror,
    MixMaterial,
    MixTexture,
    PointLight,
    Scene,
    SpotLight,
    SunSky,
    Translucent,
)
from scenes.formats.conversion import load_scene_file
from scenes.formats.losses import LossReport
from tests.scenes.formats.files import DATA

CAMERA = "scene.camera.lookat.orig = 1 -8 5\nscene.camera.lookat.target = 0 0 0.5\n"
SQUARE = (
    "scene.objects.o.vertices = -4 -4 0 4 -4 0 5 4 0 -4 4 0\nscene.objects.o.faces = 0 1 2 0 2 3\n"
    "scene.objects.o.material = m\n"
)
SIMPLE = DATA / "luxrender" / "luxcore-simple"


def scene_of(folder: Path, text: str, name: str = "a.scn") -> tuple[Scene, LossReport]:
    (folder / name).write_text(text)
    report = LossReport()
    return load_scene_file(folder / name, None, report), report


def material_of(folder: Path, text: str) -> tuple[Material, list[str]]:
    """The material of a square, and what it lost."""
    scene, report = scene_of(folder, f"{CAMERA}{text}\n{SQUARE}")
    return scene.instances[0].material, [loss.what for loss in report.losses]


def light_of(folder: Path, *lines: str) -> tuple[object, list[str]]:
    text = "\n".join(f"scene.lights.l.{line}" for line in lines)
    scene, report = scene_of(folder, f"{CAMERA}{text}\n")
    return scene.lights[0], [loss.what for loss in report.losses]


@pytest.mark.skipif(not SIMPLE.is_dir(), reason="the scene files are not beside this project")
def test_real_files_lose_only_what_is_luxcores_default() -> None:
    files = sorted(SIMPLE.rglob("*.cfg"))
    assert len(files) == 5
    for file in files:
        report = LossReport()
        scene = load_scene_file(file, SIMPLE, report)
        lost = [f"{loss.what}: {loss.became}" for loss in report.losses if loss.picture]
        bounces = [f"at most 4 {kind} bounces: 6, as of all kinds" for kind in ("diffuse", "glossy")]
        assert lost == ["filter 'BLACKMANHARRIS': gaussian", *bounces]
        assert len(scene.instances) >= 4 and (scene.film.width_px, scene.film.height_px) == (640, 480)


@pytest.mark.skipif(not SIMPLE.is_dir(), reason="the scene files are not beside this project")
def test_meshes_beside_a_file_are_found_without_a_root() -> None:
    report = LossReport()
    scene = load_scene_file(next(SIMPLE.rglob("simple.scn")), None, report)
    assert len(scene.instances) == 5 and not report.losses


def test_lights(tmp_path: Path) -> None:
    moved = "transformation = 1 0 0 0 0 1 0 0 0 0 1 0 10 20 30 1"
    sphere = 4.0 * math.pi
    light, lost = light_of(tmp_path, "type = point", "position = 1 2 3", "gain = 2 4 6", "color = 1 0.5 1", moved)
    assert isinstance(light, PointLight) and light.position == (11.0, 22.0, 33.0) and not lost
    assert light.intensity == pytest.approx((2.0 / sphere, 2.0 / sphere, 6.0 / sphere))
    spot = ("type = spot", "position = 1 2 3", "target = 0 0 0", "coneangle = 40", "conedeltaangle = 15")
    light, lost = light_of(tmp_path, *spot, "gain = 5 5 5")
    assert light == SpotLight((1.0, 2.0, 3.0), (0.0, 0.0, 0.0), (5.0, 5.0, 5.0), 25.0, 40.0, "secant") and not lost
    light, lost = light_of(tmp_path, "type = sharpdistant", "direction = 0 0 -2", "gain = 3 2 1")
    assert light == DirectionalLight((0.0, 0.0, -1.0), (3.0, 2.0, 1.0)) and not lost
    light, lost = light_of(tmp_path, "type = distant", "direction = 0 0 -1", "theta = 5")
    assert isinstance(light, DirectionalLight) and light.angle_deg == 10.0
    assert light.irradiance[0] == pytest.approx(math.pi * math.sin(math.radians(5.0)) ** 2)
    light, lost = light_of(tmp_path, "type = sun", "dir = 0 3 4", "turbidity = 4", "relsize = 1")
    assert isinstance(light, SunSky) and (light.part, light.turbidity) == ("sun", 4.0) and not lost
    assert light.sun_direction == pytest.approx((0.0, 0.6, 0.8))
    light, lost = light_of(tmp_path, "type = sky2", "gain = 1 2 3", "groundalbedo = 0.5 0.5 0.5")
    assert isinstance(light, SunSky) and (light.part, light.turbidity) == ("sky", 2.2)
    assert lost == ["a gain of each colour of the light 'sky2'", "light 'sky2': parameter 'groundalbedo'"]
    light, lost = light_of(tmp_path, "type = constantinfinite", "color = 1 2 3", "gain = 2 2 2")
    assert isinstance(light, EnvironmentLight) and light.image.ravel().tolist() == [2.0, 4.0, 6.0] and not lost
    Image.fromarray(np.full((4, 8, 3), 128, np.uint8)).save(tmp_path / "a.png")
    light, lost = light_of(tmp_path, "type = infinite", "file = a.png", "gamma = 1", "gain = 2 2 2")
    assert isinstance(light, EnvironmentLight) and light.image.shape == (4, 8, 3) and light.scale == 2.0 and not lost


def test_power_of_lights(tmp_path: Path) -> None:
    """Measured with LuxCore 2.10: 50 W at 17 lm/W are 1323.2 times the colour (1, 0.5, 1), and 850 times without its
    luminance."""
    point = ("type = point", "color = 1 0.5 1", "power = 50", "efficency = 17")
    for more, factor in ((), 1323.163), (("normalizebycolor = 0",), 850.0):
        light, lost = light_of(tmp_path, *point, *more)
        assert isinstance(light, PointLight) and not lost
        assert light.intensity[0] * 4.0 * math.pi == pytest.approx(factor, rel=1e-4)
    light, _ = light_of(tmp_path, "type = spot", *point[1:], "coneangle = 40", "conedeltaangle = 15")
    assert isinstance(light, SpotLight) and light.intensity[0] == pytest.approx(1285.4, rel=1e-4)


def test_materials(tmp_path: Path) -> None:
    half, white = ConstantTexture((0.5,) * 3), ConstantTexture((1.0,) * 3)
    cases: list[tuple[str, Material]] = [
        ("type = matte", Matte(ConstantTexture((0.75,) * 3))),
        ("type = matte|kd = 0.1 0.2 0.3", Matte(ConstantTexture((0.1, 0.2, 0.3)))),
        (
            'type = "roughmatte"|kd = "0.1 0.2 0.3"|sigma = 0.5',
            Matte(ConstantTexture((0.1, 0.2, 0.3)), math.degrees(0.5)),
        ),
        ("type = matte|kd = 0.5|sigma = 0.5", Matte(half)),
        ("type = mirror|kr = 0.5", Mirror(half)),
        ("type = glass|interiorior = 1.5|exteriorior = 1.25|kt = 0.5 0.5 0.5", Glass(white, half, 1.2)),
        ("type = glass|iorinside = 1.4|ioroutside = 1", Glass(white, white, 1.4)),
        ("type = glass", Glass(white, white, 1.0)),
        ("type = roughglass|interiorior = 1.4|uroughness = 0.2", Glass(white, white, 1.4, (0.2, 0.1))),
        ("type = glossy2|ks = 0.2|vroughness = 0.3", Glossy(half, ConstantTexture((0.2,) * 3), (0.1, 0.3))),
        ("type = metal2|n = 1 2 3|k = 4 5 6", Metal((1.0, 2.0, 3.0), (4.0, 5.0, 6.0), (0.1, 0.1))),
        ("type = mattetranslucent|kr = 0.5|kt = 1", Translucent(half, half)),
        ("type = matte|kd = 0.5|transparency = 0.4", Masked(Matte(half), ConstantTexture((0.4,) * 3))),
    ]
    for text, expected in cases:
        lines = "\n".join(f"scene.materials.m.{line}" for line in text.split("|"))
        found, lost = material_of(tmp_path, lines)
        assert found == expected and not lost, (text, found, lost)


def test_materials_that_become_others(tmp_path: Path) -> None:
    first = "scene.materials.a.type = mirror\nscene.materials.b.kd = 0.5\n"
    mix = "type = mix\nmaterial1 = a\nmaterial2 = b\namount = 0.25".replace("\n", "\nscene.materials.m.")
    found, lost = material_of(tmp_path, f"{first}scene.materials.m.{mix}")
    half = ConstantTexture((0.5,) * 3)
    assert found == MixMaterial(Mirror(), Matte(half), ConstantTexture((0.25,) * 3)) and not lost
    found, lost = material_of(tmp_path, f"scene.materials.m.{mix}")
    assert lost == ["material 'a', which is not defined", "material 'b', which is not defined"]
    found, lost = material_of(tmp_path, "scene.materials.m.type = archglass\nscene.materials.m.interiorior = 1.4")
    assert isinstance(found, Glass) and found.thin and found.front_only and not lost
    disney = (
        "type = disney\nbasecolor = 0.5\nmetallic = 0.2\nroughness = 0.3\nspecular = 0.5\nclearcoat = 0.4\nsheen = 1"
    )
    found, lost = material_of(tmp_path, "scene.materials.m." + disney.replace("\n", "\nscene.materials.m."))
    assert isinstance(found, MetallicRough) and (found.metallic, found.roughness, found.coat) == (0.2, 0.3, 0.4)
    assert found.ior == pytest.approx(1.5) and lost == ["material 'disney'", "sheen of the material 'disney'"]
    found, lost = material_of(tmp_path, "scene.materials.m.type = glossy2\nscene.materials.m.multibounce = 1")
    assert isinstance(found, Glossy) and lost == ["bounces between the facets of the coat (multibounce)"]
    found, lost = material_of(tmp_path, "scene.materials.m.type = velvet\nscene.materials.m.kd = 0.5")
    assert found == Matte(half) and lost == ["material 'velvet'"]


def test_textures(tmp_path: Path) -> None:
    Image.fromarray(np.full((2, 2, 3), 128, np.uint8)).save(tmp_path / "a.png")
    texts = {
        "t.type = constfloat1|t.value = 0.5": ConstantTexture((0.5,) * 3),
        "t.type = constfloat3|t.value = 0.1 0.2 0.3": ConstantTexture((0.1, 0.2, 0.3)),
        "t.type = scale|t.texture1 = 0.5|t.texture2 = 0.2 0.4 0.6": ConstantTexture((0.1, 0.2, 0.3)),
        "t.type = checkerboard2d|t.texture1 = 1|t.texture2 = 0.5|t.mapping.uvscale = 3 4": CheckerboardTexture(
            ConstantTexture((1.0,) * 3), ConstantTexture((0.5,) * 3), (3.0, 4.0)
        ),
        "a.type = constfloat1|a.value = 0.5|t.type = mix|t.texture1 = a|t.texture2 = 1|t.amount = 0.25": MixTexture(
            ConstantTexture((0.5,) * 3), ConstantTexture((1.0,) * 3), 0.25
        ),
    }
    for text, expected in texts.items():
        lines = "\n".join(f"scene.textures.{line}" for line in text.split("|"))
        found, lost = material_of(tmp_path, f"{lines}\nscene.materials.m.kd = t")
        assert found == Matte(expected) and not lost, text
    image = "t.type = imagemap|t.file = a.png|t.gamma = 1|t.gain = 0.5|t.wrap = clamp|t.filter = nearest|"
    image += "t.mapping.uvscale = 2 -3|t.mapping.uvdelta = 0.1 0.2"
    lines = "\n".join(f"scene.textures.{line}" for line in image.split("|"))
    found, lost = material_of(tmp_path, f"{lines}\nscene.materials.m.kd = t")
    assert isinstance(found, Matte) and isinstance(found.reflectance, ImageTexture) and not lost
    texture = found.reflectance
    assert (texture.wrap, texture.filter) == ("clamp", "nearest")
    assert (texture.uv_scale, texture.uv_offset) == ((2.0, 3.0), (0.1, 0.8))
    _, lost = material_of(tmp_path, f"{lines.replace('a.png', 'b.png')}\nscene.materials.m.kd = t")
    assert lost == ["the picture 'b.png', which is missing"]
    for kind in ("fbm", "unheard"):
        _, lost = material_of(tmp_path, f"scene.textures.t.type = {kind}\nscene.materials.m.kd = t")
        assert len(lost) == 1 and kind in lost[0]
    _, lost = material_of(tmp_path, "scene.textures.t.type = fresnelpreset\nscene.textures.t.name = gold\n"
                          "scene.materials.m.type = metal2\nscene.materials.m.fresnel = t")  # fmt: skip
    assert not lost


def test_textures_that_refer_to_each_other_are_not_defined(tmp_path: Path) -> None:
    text = "\n".join(f"scene.textures.{a}.type = scale\nscene.textures.{a}.texture1 = {b}" for a, b in ("ab", "ba"))
    _, lost = material_of(tmp_path, f"{text}\nscene.materials.m.kd = a")
    assert lost == ["tex1: texture 'b' of type color, which is not defined"]


def test_objects_share_shapes_and_lie_where_their_transforms_say(tmp_path: Path) -> None:
    text = (
        "scene.materials.m.emission = 1 2 1\nscene.materials.m.emission.gain = 2 1 1\n"
        "scene.materials.m.emission.theta = 90\n"
        "scene.shapes.s.type = inlinedmesh\nscene.shapes.s.vertices = 0 0 0 1 0 0 0 1 0.5\n"
        "scene.shapes.s.faces = 0 1 2\n"
        "scene.shapes.s.normals = 0 0 1 0 0 1 0 0 1\nscene.shapes.s.uvs = 0 0 1 0 0 1\n"
        "scene.shapes.s.appliedtransformation = 2 0 0 0 0 2 0 0 0 0 2 0 0 0 0 1\n"
        "scene.objects.a.shape = s\nscene.objects.a.material = m\nscene.objects.b.shape = s\n"
        "scene.objects.b.material = m\n"
        "scene.objects.b.transformation = 0 1 0 0 -1 0 0 0 0 0 1 0 5 6 7 1\nscene.objects.b.id = 3\n"
    )
    scene, report = scene_of(tmp_path, CAMERA + text)
    first, second = scene.instances
    assert isinstance(first.shape, Mesh) and first.shape is second.shape and first.shape.uvs is not None
    np.testing.assert_allclose(first.shape.vertices, [[0, 0, 0], [1, 0, 0], [0, 1, 0.5]])
    np.testing.assert_allclose(first.to_world, np.diag([2.0, 2.0, 2.0, 1.0]))
    np.testing.assert_allclose(second.to_world, [[0, -2, 0, 5], [2, 0, 0, 6], [0, 0, 2, 7], [0, 0, 0, 1]])
    assert first.emission == (2.0, 2.0, 1.0)
    assert [(loss.what, loss.picture) for loss in report.losses] == [("property 'scene.objects.b.id'", False)]


def test_power_of_lamps_is_spread_over_their_area(tmp_path: Path) -> None:
    """100 W at 17 lm/W over two square units: a radiance of 1700 / (2 π) of luminance 1."""
    lamp = "scene.materials.m.emission = 1\nscene.materials.m.emission.power = 100\n"
    lamp += "scene.materials.m.emission.efficency = 17\n"
    square = SQUARE.replace("-4 -4 0 4 -4 0 5 4 0 -4 4 0", "0 0 0 1 0 0 1 2 0 0 2 0")
    scene, _ = scene_of(tmp_path, CAMERA + lamp + square)
    assert scene.instances[0].emission == pytest.approx((1700.0 / (2.0 * math.pi),) * 3, rel=1e-4)


@pytest.mark.parametrize(
    ("more", "luxcore"), [("", (69149.0, 32152.0, 10691.0)), ("normalize = true", (0.77556, 0.36061, 0.11991))]
)
def test_lamps_that_are_black_bodies(more: str, luxcore: tuple[float, ...], tmp_path: Path) -> None:
    """The radiance of 3000 K that LuxCore 2.10 draws."""
    lamp = "scene.textures.t.type = blackbody\nscene.textures.t.temperature = 3000\nscene.materials.m.emission = t\n"
    scene, report = scene_of(tmp_path, CAMERA + lamp + (f"scene.textures.t.{more}\n" if more else "") + SQUARE)
    assert scene.instances[0].emission == pytest.approx(luxcore, rel=0.06) and not report.losses


def test_volumes(tmp_path: Path) -> None:
    text = (
        "scene.volumes.v.type = homogeneous\nscene.volumes.v.absorption = 0.1 0.2 0.3\n"
        "scene.volumes.v.scattering = 1 2 3\n"
        "scene.volumes.v.multiscattering = 1\nscene.volumes.v.ior = 1.3\nscene.volumes.w.type = clear\n"
        "scene.volumes.w.absorption = 0.5\nscene.world.volume.default = w\n"
        "scene.materials.m.type = glass\nscene.materials.m.volume.interior = v\n"
    )
    scene, report = scene_of(tmp_path, CAMERA + text + SQUARE)
    (one,) = scene.instances
    assert one.interior is not None and one.interior.absorption == (0.1, 0.2, 0.3)
    assert one.interior.scattering == (1.0, 2.0, 3.0) and not report.losses
    assert one.exterior is not None and one.exterior.absorption == (0.5,) * 3 and scene.medium == one.exterior
    assert isinstance(one.material, Glass) and one.material.ior == pytest.approx(1.3)
    _, report = scene_of(tmp_path, CAMERA + text.replace("multiscattering = 1", "multiscattering = 0") + SQUARE)
    assert [loss.what for loss in report.losses] == ["a volume that scatters light once"]
