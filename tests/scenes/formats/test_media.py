"""Homogeneous media: read from every format that has them, carried between all of these, and reported elsewhere."""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path

import numpy as np
import pytest

from scenes.canonical import (
    ConstantTexture,
    Cube,
    EnvironmentLight,
    Glass,
    Instance,
    Integrator,
    Matte,
    Medium,
    Mesh,
    PerspectiveCamera,
    Rectangle,
    Scene,
    SceneError,
    Sphere,
)
from scenes.formats.appearance.media import media_of
from scenes.formats.appearance.media_presets import mitsuba_medium, pbrt_medium
from scenes.formats.appearance.mixtures import NOTHING, is_nothing
from scenes.formats.comparison import difference
from scenes.formats.conversion import load_scene_file, save_scene_file
from scenes.formats.drawable import drawable
from scenes.formats.losses import LossReport
from scenes.formats.mitsuba.dictionaries import scene_of_dictionary
from tests.scenes.formats.files import SENSOR, drawn, pbrt, seen

FOG, MILK = Medium((0.5, 0.25, 0.1)), Medium((0.1, 0.05, 0.0), (1.0, 0.5, 0.25), 0.3)
FORMATS = {"pbrt": ".pbrt", "pbrt4": ".pbrt", "mitsuba": ".xml", "mitsuba3": ".xml", "luxrender": ".lxs",
           "luxrender-parts": ".lxs"}  # fmt: skip
V3 = 'Integrator "volpath"\nMakeNamedMedium "fog" "string type" "homogeneous" {}\n'
HEAD = V3 + 'MediumInterface "" "fog"\nCamera "perspective"\nWorldBegin\n'


def xml(folder: Path, body: str, version: str = "3.0.0", integrator: str = "volpath"):
    """The scene of a Mitsuba text, and what it lost."""
    text = f'<integrator type="{integrator}"/>{SENSOR if "<sensor" not in body else ""}{body}'
    (folder / "a.xml").write_text(f'<scene version="{version}">{text}</scene>')
    report = LossReport()
    return load_scene_file(folder / "a.xml", None, report), [str(loss) for loss in report.losses if loss.picture]


def inside(scene: Scene) -> list[Medium | None]:
    return [one.interior for one in scene.instances]


def close(found: Medium | None, wanted: Medium) -> bool:
    return found is not None and difference(found, wanted) is None


# --- reading ---------------------------------------------------------------------------------------------------------


def test_media_of_pbrt(tmp_path: Path) -> None:
    body = """MakeNamedMedium "milk" "string type" "homogeneous" "string preset" "Wholemilk" "float scale" 2
      "float g" .5
    AttributeBegin
      MediumInterface "milk" "fog"
      Material "none"
      Shape "sphere"
    AttributeEnd
    MediumInterface "milk"
    Shape "sphere"
    MediumInterface "" ""
    Shape "sphere"
    Material ""
    Shape "sphere"
    """
    scene, lost = pbrt(tmp_path, body, HEAD.format('"rgb sigma_a" [ 1 2 3 ] "rgb sigma_s" [ 0 0 0 ]'))
    fog, milk = Medium((1.0, 2.0, 3.0)), Medium((0.0022, 0.0048, 0.028), (5.1, 6.42, 7.54), 0.5)
    assert scene.medium == fog and inside(scene)[2] is None and scene.instances[2].exterior is None
    assert close(scene.instances[0].interior, milk) and scene.instances[0].exterior == fog
    assert close(scene.instances[1].interior, milk) and close(scene.instances[1].exterior, milk)
    assert is_nothing(scene.instances[0].material) and len(scene.instances) == 3  # the border of nothing is left out
    assert sum("the border of a medium" in loss for loss in lost) == 1


def test_media_of_pbrt_may_be_made_after_their_names_are_given(tmp_path: Path) -> None:
    """PBRT looks them up at the shapes, and that of the camera at the end."""
    fog = 'MakeNamedMedium "fog" "string type" "homogeneous" "rgb sigma_a" [ 1 2 3 ] "rgb sigma_s" [ 0 0 0 ]\n'
    head = 'Integrator "volpath"\nMediumInterface "" "fog"\nCamera "perspective"\nWorldBegin\n'
    scene, lost = pbrt(tmp_path, f'MediumInterface "fog" ""\n{fog}Shape "sphere"\n', head)
    assert lost == ["a.pbrt:1:1: integrator 'volpath': path"]
    assert scene.medium == scene.instances[0].interior == Medium((1.0, 2.0, 3.0))


@pytest.mark.parametrize("kind", ["homogeneous", "homogenous"])
def test_volumes_of_luxrender(kind: str, tmp_path: Path) -> None:
    (tmp_path / "a.lxs").write_text(f"""
    MakeNamedVolume "fog" "{kind}" "color sigma_a" [ 1 2 3 ] "color sigma_s" [ .1 .2 .3 ] "color g" [ 0 0 0 ]
    Texture "w" "fresnel" "cauchy" "float index" [ 1.33 ]
    Texture "depth" "color" "colordepth" "float depth" [ 2 ] "color Kt" [ .5 .25 1 ]
    MakeNamedVolume "water" "clear" "texture absorption" [ "depth" ] "texture fresnel" [ "w" ]
    VolumeIntegrator "multi"
    Exterior "fog"
    Camera "perspective"
    WorldBegin
    MakeNamedMaterial "g" "string type" "glass2"
    NamedMaterial "g"
    AttributeBegin
      Interior "water"
      Exterior ""
      Shape "sphere"
    AttributeEnd
    Shape "sphere"
    """)
    report = LossReport()
    scene = load_scene_file(tmp_path / "a.lxs", None, report)
    assert not report.losses and scene.medium == Medium((1.0, 2.0, 3.0), (0.1, 0.2, 0.3))
    water, plain = scene.instances
    assert close(water.interior, Medium((0.5 * math.log(2.0), math.log(2.0), 0.0)))
    assert water.exterior == scene.medium  # behind it, LuxCore goes on with the medium around
    assert isinstance(water.material, Glass) and water.material.ior == pytest.approx(1.33)
    assert plain.interior is None and plain.exterior is None  # no border: the fog goes on
    (tmp_path / "a.lxs").write_text((tmp_path / "a.lxs").read_text().replace('"multi"', '"single"'))
    load_scene_file(tmp_path / "a.lxs", None, report)
    assert ["'single'" in loss.what for loss in report.losses] == [True]


def test_media_of_mitsuba_3(tmp_path: Path) -> None:
    medium = """<medium type="homogeneous" id="m"><rgb name="sigma_t" value="0.5 0.25 1"/>
    <float name="scale" value="4"/>
    <volume name="albedo" type="constvolume"><rgb name="value" value="0.5 0 1"/></volume>
    <phase type="hg"><float name="g" value="0.3"/></phase></medium>"""
    sensor = '<sensor type="perspective"><float name="fov" value="40"/><ref name="medium" id="m"/></sensor>'
    body = '<shape type="sphere"><bsdf type="null"/><ref name="interior" id="m"/></shape>'
    body += '<shape type="cube"><medium name="exterior" type="homogeneous"/></shape>'
    scene, lost = xml(tmp_path, medium + sensor + body)
    wanted = Medium((1.0, 1.0, 0.0), (1.0, 0.0, 4.0), 0.3)
    assert not lost and scene.medium == wanted and inside(scene) == [wanted, None]
    assert scene.instances[1].exterior == Medium((0.25,) * 3, (0.75,) * 3)
    assert isinstance(scene.instances[1].material, Matte)  # Mitsuba 3 draws it grey, 0.5 not at all
    part = {"type": "sphere", "bsdf": {"type": "null"}, "interior": {"type": "homogeneous", "albedo": 0.5}}
    part["interior"]["sigma_t"] = {"type": "rgb", "value": [1.0, 2.0, 3.0]}  # type: ignore[index]
    part["interior"]["phase"] = {"type": "hg", "g": 0.2}  # type: ignore[index]
    tree = {"type": "scene", "i": {"type": "volpath"}, "s": {"type": "perspective"}, "ball": part}
    found = scene_of_dictionary(tree, tmp_path, LossReport())
    assert close(found.instances[0].interior, Medium((0.5, 1.0, 1.5), (0.5, 1.0, 1.5), 0.2))


@pytest.mark.parametrize(
    ("inner", "wanted"),
    [
        ('<rgb name="sigmaA" value="1 2 3"/><rgb name="sigmaS" value="4"/>', Medium((1.0, 2.0, 3.0), (4.0,) * 3)),
        ('<rgb name="sigmaT" value="2"/><rgb name="albedo" value="0.25"/>', Medium((1.5,) * 3, (0.5,) * 3)),
        ('<string name="material" value="Marble"/><float name="scale" value="0.1"/><phase type="hg"/>',
         Medium((0.021, 0.041, 0.071), (21.9, 26.2, 30.0), 0.8)),
    ],
)  # fmt: skip
def test_media_of_mitsuba_0_5(inner: str, wanted: Medium, tmp_path: Path) -> None:
    body = f'<shape type="sphere"><medium type="homogeneous" name="interior">{inner}</medium></shape>'
    scene, lost = xml(tmp_path, body, "0.5.0")
    assert not lost and close(scene.instances[0].interior, wanted) and is_nothing(scene.instances[0].material)


def test_both_tables_have_the_same_media() -> None:
    """PBRT has the reduced coefficients of scattering, Mitsuba those of scattering and the mean cosine."""
    for name in ("Apple", "Wholemilk", "Regular Milk", "Shampoo", "Espresso"):
        first, second = pbrt_medium(name), mitsuba_medium(name)
        assert first is not None and second is not None
        np.testing.assert_allclose(100.0 * np.array(first.absorption), second.absorption, rtol=0.01)
        reduced = np.array(second.scattering) * (1.0 - second.g)
        np.testing.assert_allclose(100.0 * np.array(first.scattering), reduced, rtol=0.35)
    assert pbrt_medium("wholemilk") is None and mitsuba_medium("WholeMilk") is not None


def test_media_that_the_integrator_does_not_draw_are_left_out(tmp_path: Path) -> None:
    """The picture of such a file has none; the borders are not seen."""
    body = 'MediumInterface "fog" ""\nMaterial ""\nShape "sphere"\nMaterial "matte"\nShape "disk"\n'
    scene, lost = pbrt(tmp_path, body, HEAD.replace("volpath", "path").format(""))
    assert media_of(scene) == [] and len(scene.instances) == 1
    assert any("media, which the integrator 'path' does not draw" in loss for loss in lost)
    body = '<shape type="sphere"><bsdf type="null"/><medium name="interior" type="homogeneous"/></shape>'
    scene, lost = xml(tmp_path, body, integrator="path")
    assert not scene.instances and not lost


LOST = [
    ('MakeNamedMedium "m" "string type" "heterogeneous"', "the medium 'm' of the type 'heterogeneous'"),
    ('MediumInterface "none" ""', "the medium 'none', which is not defined: vacuum"),
    ('MakeNamedMedium "m" "string type" "homogeneous" "string preset" "Tea"', "the medium 'Tea', which is not known"),
]


@pytest.mark.parametrize(("body", "loss"), LOST)
def test_other_media_are_losses(body: str, loss: str, tmp_path: Path) -> None:
    _, lost = pbrt(tmp_path, f'{body}\nShape "sphere"\n')
    assert len(lost) == 1 and loss in lost[0]


@pytest.mark.parametrize("version", ["0.5.0", "3.0.0"])
def test_media_of_mitsuba_that_are_missing_are_losses(version: str, tmp_path: Path) -> None:
    sensor = '<sensor type="perspective"><float name="fov" value="40"/><ref name="medium" id="m"/></sensor>'
    scene, lost = xml(tmp_path, f'{sensor}<shape type="sphere"><ref name="interior" id="m"/></shape>', version)
    assert [one.partition(": ")[2] for one in lost] == ["'m', which no earlier element has as its name: vacuum"] * 2
    assert media_of(scene) == [] and len(scene.instances) == (version == "3.0.0")


@pytest.mark.parametrize("inner", ['"rgb sigma_a" [ -1 0 0 ]', '"float g" 1', '"float scale" 1e30 "rgb sigma_a" 1e30'])
def test_impossible_media_are_one_line(inner: str, tmp_path: Path) -> None:
    with pytest.raises(SceneError, match=r"a.pbrt:2:1: .*expected"):
        pbrt(tmp_path, "", V3.format(inner))


# --- all pairs -------------------------------------------------------------------------------------------------------


def _at(x: float, *scale: float) -> np.ndarray:
    place = np.diag([*(scale or (1.0, 1.0, 1.0)), 1.0])
    place[0, 3] = x
    return place


@pytest.fixture(scope="module")
def scene() -> Scene:
    """Shapes with media on their sides; the meshes differ by their media alone."""
    corners = np.array([[-1, -1, -1], [1, -1, -1], [0, 1, -1], [0, 0, 1]], np.float32)
    mesh = Mesh(corners, np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]], np.int32))
    shapes = (
        Instance(Cube(), NOTHING, _at(-4.0), interior=FOG),
        Instance(Sphere(), Glass(), _at(-2.0), interior=MILK, exterior=FOG),
        *(Instance(mesh, NOTHING, _at(x), interior=medium) for x, medium in ((0.0, FOG), (2.0, MILK), (4.0, FOG))),
        Instance(Rectangle(), Matte(ConstantTexture((0.5, 0.5, 0.5))), _at(6.0)),
    )
    lights = (EnvironmentLight(np.ones((1, 1, 3), np.float32)),)
    return Scene(PerspectiveCamera(_at(0.0), 60.0), shapes, lights, integrator=Integrator("path", 8))


@pytest.mark.parametrize("around", [None, FOG])
@pytest.mark.parametrize("source", FORMATS)
def test_media_are_carried_between_all_formats(
    source: str, around: Medium | None, scene: Scene, tmp_path: Path
) -> None:
    scene = dataclasses.replace(scene, medium=around)
    wanted = [(one.interior, one.exterior) for one in scene.instances]
    for target in ("", *FORMATS):
        found, report = scene, LossReport()
        for number, name in enumerate([source, *([target] if target else [])]):
            file = tmp_path / f"{source}-{target}-{number}{FORMATS[name]}"
            save_scene_file(found, file, name, report)
            found = load_scene_file(file, None, report)
        assert difference(found.medium, around) is None
        assert difference(tuple(wanted), tuple((one.interior, one.exterior) for one in found.instances)) is None
        assert [is_nothing(one.material) for one in found.instances] == [True, False, True, True, True, False]
        lost = [loss for loss in report.losses if loss.picture and "sphere" not in loss.what]
        known = ("Schlick", "vacuum behind") if around else ("Schlick",)  # in LuxCore there is none within fog
        assert all(any(word in f"{loss}" for word in known) for loss in lost)
        assert bool(lost) == ("luxrender" in f"{source} {target}")


@pytest.mark.parametrize("name", ["a.usda", ""])
def test_formats_without_media_say_so(name: str, scene: Scene, tmp_path: Path) -> None:
    report, scene = LossReport(), dataclasses.replace(scene, medium=FOG)
    if name.endswith("usda"):
        pytest.importorskip("pxr")
    if name:
        save_scene_file(scene, tmp_path / name, None, report)
        found = load_scene_file(tmp_path / name)
    else:
        found = drawable(scene, report)
    assert media_of(found) == [] and len(found.instances) == 2  # borders that are not seen are left out
    lost = [loss.what for loss in report.losses if loss.picture]
    assert "a medium around the camera (absorbing)" in lost and "a medium inside a surface (scattering)" in lost


# --- pictures --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", ["sphere", "cube", "rectangle"])
def test_media_of_mirrored_shapes_are_on_the_side_where_mitsuba_has_them(kind: str, tmp_path: Path) -> None:
    """Mitsuba 3 turns mirrored spheres and meshes inside out, so that the light from the sky ends in the medium."""
    body = f"""<sensor type="perspective"><transform name="to_world"><lookat origin="0,0,5" target="0,0,0" up="0,1,0"/>
    </transform><film type="hdrfilm"><integer name="width" value="8"/><integer name="height" value="8"/></film></sensor>
    <emitter type="constant"/><shape type="{kind}"><bsdf type="null"/><medium type="homogeneous" name="interior">
    <float name="sigma_t" value="0.5"/><float name="albedo" value="0"/></medium><transform name="to_world">
    <scale z="-1"/></transform></shape>"""
    scene, lost = xml(tmp_path, body)
    picture = seen("mitsuba", tmp_path / "a.xml", 8, 64)[3:5, 3:5].mean()
    for program in (
        ("mitsuba", "luxcore") if kind != "rectangle" else ("mitsuba",)
    ):  # LuxCore's sky is not infinitely far
        found = drawn(scene, program, tmp_path / program, 8, 64)[3:5, 3:5].mean()
        assert not lost and abs(found - picture) < 0.03, (program, found, picture)
