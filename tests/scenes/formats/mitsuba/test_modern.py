"""Files of Mitsuba 3, made by hand after its documentation, and the same scene as dictionaries."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from analysis.conversion.peers import rendered
from scenes.canonical import (
    Bumped,
    ConstantTexture,
    DirectionalLight,
    Glass,
    Matte,
    Metal,
    MetallicRough,
    OrthographicCamera,
    PerspectiveCamera,
    Plastic,
    Scene,
    SceneError,
    SunSky,
)
from scenes.formats.comparison import difference
from scenes.formats.conversion import load_scene_file, save_scene_file
from scenes.formats.losses import LossReport
from scenes.formats.mitsuba.dictionaries import scene_of_dictionary

HEAD = """<scene version="3.5.0">
<default name="spp" value="16"/>
<integrator type="aov"><string name="aovs" value="d:depth"/>
<integrator type="path" name="image"><integer name="max_depth" value="4"/></integrator></integrator>
<sensor type="perspective"><float name="fov" value="50"/><string name="fov_axis" value="larger"/>
<float name="principal_point_offset_x" value="0.1"/>
<transform name="to_world"><lookat origin="0, 1.5, 6" target="0, 0.5, 0" up="0, 1, 0"/></transform>
<sampler type="multijitter"><integer name="sample_count" value="$spp"/></sampler>
<film type="hdrfilm"><integer name="width" value="48"/><integer name="height" value="32"/><rfilter type="box"/></film>
</sensor>
"""
BODY = """
<bsdf type="twosided" id="floor"><bsdf type="diffuse">
<texture type="checkerboard" name="reflectance">
<rgb name="color0" value="0.7, 0.2, 0.1"/><transform name="to_uv"><scale x="4" y="3"/></transform></texture></bsdf>
</bsdf>
<bsdf type="roughconductor" id="gold"><string name="material" value="Au"/><float name="alpha" value="0.2"/>
<string name="distribution" value="ggx"/></bsdf>
<bsdf type="conductor" id="mirror"><rgb name="specular_reflectance" value="0.8, 0.9, 0.7"/></bsdf>
<bsdf type="dielectric" id="clear"><float name="int_ior" value="1.4"/><float name="ext_ior" value="1"/></bsdf>
<bsdf type="roughplastic" id="coat"><rgb name="diffuse_reflectance" value="0.1, 0.3, 0.6"/></bsdf>
<shape type="rectangle"><transform name="to_world"><scale x="4" y="4"/><rotate x="1" angle="-90"/></transform>
<ref id="floor"/></shape>
<shape type="sphere"><point name="center" x="-1.8" y="0.7" z="0"/>
<float name="radius" value="0.7"/><ref id="gold"/></shape>
<shape type="sphere"><point name="center" x="-0.6" y="0.5" z="1"/>
<float name="radius" value="0.5"/><ref id="clear"/></shape>
<shape type="merge"><shape type="cube"><transform name="to_world"><scale value="0.5"/>
<rotate y="1" angle="30"/><translate x="0.9" y="0.5" z="0"/></transform><ref id="mirror"/></shape></shape>
<shape type="disk"><transform name="to_world"><scale value="0.8"/><translate x="2.2" y="0.9" z="0"/></transform>
<ref id="coat"/></shape>
<shape type="rectangle"><transform name="to_world"><rotate x="1" angle="90"/><translate y="4"/></transform>
<emitter type="area"><rgb name="radiance" value="6, 5, 4"/></emitter></shape>
<emitter type="point"><rgb name="intensity" value="3, 4, 5"/><point name="position" x="2" y="3" z="3"/></emitter>
<emitter type="spot"><rgb name="intensity" value="30"/><float name="cutoff_angle" value="25"/>
<transform name="to_world"><lookat origin="-3, 4, 3" target="-1, 0, 0" up="0, 1, 0"/></transform></emitter>
<emitter type="directional"><vector name="direction" value="1, -1, -1"/><rgb name="irradiance" value="0.5"/></emitter>
<emitter type="constant"><rgb name="radiance" value="0.2, 0.25, 0.3"/></emitter>
"""


def read(folder: Path, text: str, name: str = "a.xml") -> tuple[Scene, list[str]]:
    (folder / name).write_text(text)
    report = LossReport()
    return load_scene_file(folder / name, None, report), [str(loss) for loss in report.losses if loss.picture]


def of(folder: Path, body: str) -> tuple[Scene, list[str]]:
    return read(folder, f'<scene version="3.0.0"><sensor type="perspective"/>{body}</scene>')


def picture(file: Path) -> np.ndarray:
    pytest.importorskip("mitsuba")
    found = rendered("mitsuba", file, file.with_suffix(".npy"), (48, 32), 128, 300.0)
    assert not isinstance(found, str), found
    return found


def test_a_file_of_mitsuba_3_is_the_picture_that_mitsuba_3_makes_of_it(tmp_path: Path) -> None:
    scene, losses = read(tmp_path, HEAD + BODY + "</scene>")
    assert losses == []
    save_scene_file(scene, tmp_path / "b.xml", "mitsuba3")
    blocks = [picture(tmp_path / f"{name}.xml").reshape(4, 8, 6, 8, 3).mean(axis=(1, 3)) for name in "ab"]
    assert np.abs(blocks[0] - blocks[1]).max() < 0.1 * blocks[0].mean()
    assert blocks[1].mean() == pytest.approx(blocks[0].mean(), rel=0.01)


def test_what_a_file_of_mitsuba_3_says(tmp_path: Path) -> None:
    scene, _ = read(tmp_path, HEAD + BODY + "</scene>")
    camera = scene.camera
    assert isinstance(camera, PerspectiveCamera) and camera.shift == (0.1, 0.0)
    assert camera.fov_deg == pytest.approx(2 * np.degrees(np.arctan(np.tan(np.radians(25)) * 2 / 3)))
    assert (scene.integrator.kind, scene.integrator.depth, scene.sampler.samples_per_pixel) == ("path", 3, 16)
    assert {type(one.material) for one in scene.instances} == {Matte, Metal, Glass, Plastic}
    mirror = scene.materials["mirror"]
    assert isinstance(mirror, Metal) and (mirror.eta, mirror.k) == ((0.0,) * 3, (1.0,) * 3)
    assert isinstance(scene.lights[2], DirectionalLight)
    save_scene_file(scene, tmp_path / "b.xml", "mitsuba3")
    again = load_scene_file(tmp_path / "b.xml")
    save_scene_file(again, tmp_path / "c.xml", "mitsuba3")
    assert difference(again, load_scene_file(tmp_path / "c.xml")) is None
    assert difference(scene.instances, again.instances) is None and difference(scene.lights, again.lights) is None


def test_versions_are_recognised(tmp_path: Path) -> None:
    place = '<shape type="sphere"><transform name="{}"><translate x="2"/></transform></shape></scene>'
    for version in ('version="2.0.0"', 'version="3.1.4"', ""):
        scene, _ = read(tmp_path, f"<scene {version}>{place.format('to_world')}")
        assert scene.instances[0].to_world[0, 3] == 2.0
    for version in ('version="0.6.0"', ""):
        scene, losses = read(tmp_path, f"<scene {version}>{place.format('toWorld')}")
        assert scene.instances[0].to_world[0, 3] == 2.0 and len(losses) == 1  # no sensor
    with pytest.raises(SceneError, match=r"expected a scene of Mitsuba 0.5, 2 or 3, got one of version '9.0'"):
        read(tmp_path, '<scene version="9.0"/>')


def test_plugins_of_mitsuba_3(tmp_path: Path) -> None:
    body = '<shape type="sphere"><bsdf type="principled"><rgb name="base_color" value="0.6, 0.4, 0.2"/>'
    body += '<float name="metallic" value="0.3"/><float name="sheen" value="0.5"/></bsdf></shape>'
    scene, losses = of(tmp_path, body)
    made = scene.instances[0].material
    assert isinstance(made, MetallicRough) and (made.metallic, made.roughness) == (0.3, 0.5)
    assert made.ior == pytest.approx(1.5) and made.base == ConstantTexture((0.6, 0.4, 0.2))
    assert len(losses) == 2 and "sheen" in losses[0]
    body = '<shape type="sphere"><bsdf type="bumpmap"><texture type="checkerboard"/><float name="scale" value="2"/>'
    scene, losses = of(tmp_path, body + '<bsdf type="diffuse"/></bsdf></shape><shape type="sdfgrid"/>')
    assert isinstance(scene.instances[0].material, Bumped) and scene.instances[0].material.scale == 2.0
    assert len(losses) == 1 and "shape 'sdfgrid'" in losses[0]
    scene, losses = of(tmp_path, '<emitter type="sunsky"><float name="sun_scale" value="0"/></emitter>')
    (sky,) = scene.lights
    assert isinstance(sky, SunSky) and sky.part == "sky" and sky.ground_albedo == 0.3
    np.testing.assert_allclose(sky.up, (0.0, 0.0, 1.0), atol=1e-12)
    camera = read(tmp_path, '<scene version="3.0.0"><sensor type="orthographic"/></scene>')[0].camera
    assert isinstance(camera, OrthographicCamera)


@pytest.mark.parametrize(
    ("size", "columns", "rows"), [((32, 16), (12.8, 25.6), (3.2, 9.6)), ((16, 32), (6.4, 12.8), (13.6, 16.8))]
)
@pytest.mark.parametrize("version", ["0.6.0", "3.0.0"])
def test_a_parallel_picture_is_two_wide(
    size: tuple[int, int], columns: tuple[float, float], rows: tuple[float, float], version: str, tmp_path: Path
) -> None:
    """Mitsuba 3.9.1 lights pixels 12 to 25 of 32, and 3 to 9 of 16, with this square; 6 to 12 and 13 to 16 upright."""
    placed, film = (
        ("to_world" if version == "3.0.0" else "toWorld"),
        "".join(
            f'<integer name="{name}" value="{count}"/>' for name, count in zip(("width", "height"), size, strict=True)
        ),
    )
    text = f'<scene version="{version}"><sensor type="orthographic"><film type="hdrfilm">{film}</film>'
    text += f'<transform name="{placed}"><lookat origin="0, 0, 5" target="0, 0, 0" up="0, 1, 0"/></transform></sensor>'
    scene, losses = read(tmp_path, text + "</scene>")
    assert losses == []
    for target in ("mitsuba", "mitsuba3", "pbrt"):
        name = f"b{'.pbrt' if target == 'pbrt' else '.xml'}"
        save_scene_file(scene, tmp_path / name, target)
        scene = load_scene_file(tmp_path / name)
        camera, aspect = scene.camera, size[0] / size[1]
        assert isinstance(camera, OrthographicCamera)
        corners = np.linalg.solve(camera.to_world, np.array([(-0.2, -0.1, 0.0, 1.0), (0.6, 0.3, 0.0, 1.0)]).T)[:2]
        spans = camera.half_width * max(aspect, 1.0), camera.half_width * max(1.0 / aspect, 1.0)
        at = [
            (np.sort(corner / span * side) + 1.0) / 2.0 * px
            for corner, span, side, px in zip(corners, spans, (1.0, -1.0), size, strict=True)
        ]
        np.testing.assert_allclose(at, (columns, rows), atol=1e-6)


@pytest.mark.parametrize(
    ("given", "wanted"),
    [
        ('<spectrum name="reflectance" value="0.25"/>', (0.25, 0.25, 0.25)),
        ('<spectrum name="reflectance" type="uniform"><float name="value" value="0.5"/></spectrum>', (0.5, 0.5, 0.5)),
        ('<texture name="reflectance" type="srgb"><rgb name="color" value="1, 0, 1"/></texture>', (1.0, 0.0, 1.0)),
    ],
)
def test_spectra_that_are_plugins(given: str, wanted: tuple[float, ...], tmp_path: Path) -> None:
    scene, losses = of(tmp_path, f'<shape type="sphere"><bsdf type="diffuse">{given}</bsdf></shape>')
    assert scene.instances[0].material == Matte(ConstantTexture(wanted)) and losses == []  # type: ignore[arg-type]


TREE = {
    "type": "scene",
    "integrator": {"type": "path", "max_depth": 4},
    "sensor": {"type": "perspective", "fov": 40.0, "film": {"type": "hdrfilm", "width": 48, "height": 32}},
    "paint": {
        "type": "twosided",
        "inner": {"type": "diffuse", "reflectance": {"type": "rgb", "value": [0.7, 0.2, 0.1]}},
    },
    "ball": {
        "type": "sphere",
        "center": [0.0, 1.0, 2.0],
        "to_world": np.diag([2.0, 2.0, 2.0, 1.0]).tolist(),
        "bsdf": {"type": "ref", "id": "paint"},
        "lamp": {"type": "area", "radiance": {"type": "spectrum", "value": [[400.0, 1.0], [700.0, 1.0]]}},
    },
    "sky": {"type": "constant", "radiance": 0.5},
}


def test_trees_of_dictionaries(tmp_path: Path) -> None:
    """The tree in Python, as JSON, and as the XML file that says the same."""
    text = """<scene version="3.0.0"><integrator type="path"><integer name="max_depth" value="4"/></integrator>
    <sensor type="perspective"><float name="fov" value="40"/><film type="hdrfilm">
    <integer name="width" value="48"/><integer name="height" value="32"/></film></sensor>
    <bsdf type="twosided" id="paint"><bsdf type="diffuse"><rgb name="reflectance" value="0.7 0.2 0.1"/></bsdf></bsdf>
    <shape type="sphere"><point name="center" x="0" y="1" z="2"/>
    <transform name="to_world"><scale value="2"/></transform>
    <ref id="paint"/><emitter type="area"><spectrum name="radiance" value="400:1, 700:1"/></emitter></shape>
    <emitter type="constant"><float name="radiance" value="0.5"/></emitter></scene>"""
    wanted, losses = read(tmp_path, text)
    scene, others = read(tmp_path, json.dumps(TREE), "a.json")
    report = LossReport()
    third = scene_of_dictionary(TREE, tmp_path, report)
    assert losses == others == [] and not report.losses
    assert difference(wanted, scene) is None and difference(wanted, third) is None


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("{", "a.json: expected JSON"),
        ("[]", "expected a dictionary of the type 'scene'"),
        ('{"type": "scene", "a": {}}', "a.json.a: expected a 'type'"),
        ('{"type": "scene", "a": {"type": "sphere", "radius": NaN}}', "a.json.a.radius: radius: expected 1 numbers"),
        ('{"type": "scene", "a": {"type": "sphere", "radius": [[1], 2]}}', "a.json.a.radius: expected a number"),
        ('{"type": "scene"' + ', "a": {"type": "mask"' * 80 + "}" * 81, "expected at most 64 levels"),
    ],
)
def test_trees_that_cannot_be_read(text: str, message: str, tmp_path: Path) -> None:
    with pytest.raises(SceneError, match=message.replace("(", r"\(")):
        read(tmp_path, text, "a.json")


def test_plugins_of_trees_that_are_not_known_are_losses(tmp_path: Path) -> None:
    tree = {**TREE, "odd": {"type": "nosuch"}}
    _, losses = read(tmp_path, json.dumps(tree), "a.json")
    assert losses == ["a.json.odd: element 'a plugin of unknown kind', which is not known: left out"]
