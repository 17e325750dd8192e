"""glTF files as scenes for conversion: what comes back, and the pictures that renderers make of it."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path

import numpy as np
import pytest

from renderer.frames import render_image
from renderer.sampling.plan import SamplePlan
from renderer.trace import Renderer
from scenes.canonical import (
    ConstantTexture,
    DirectionalLight,
    Film,
    ImageTexture,
    Instance,
    Integrator,
    Matte,
    Mesh,
    Metal,
    MetallicRough,
    MixMaterial,
    NormalMapped,
    PerspectiveCamera,
    Plastic,
    PointLight,
    Rectangle,
    Scene,
    Sphere,
)
from scenes.catalog import load_any
from scenes.formats.comparison import difference
from scenes.formats.conversion import load_scene_file, save_scene_file
from scenes.formats.geometry.meshed import as_mesh
from scenes.formats.losses import LossReport
from tests.scenes.formats.files import MITSUBA, REAL, drawn, needs_data, real
from tests.scenes.formats.gltf.files import GREY

SIDE_PX, BLOCK_PX = 32, 8


@needs_data
@pytest.mark.parametrize("name", [*REAL, *MITSUBA])
def test_real_scenes_come_back_from_gltf(name: str, tmp_path: Path) -> None:
    """The same scene after the first trip; what the first trip leaves out is named."""
    scene, lost = real(name), LossReport()
    save_scene_file(scene, tmp_path / "a.glb", None, lost)
    names = ("b.gltf", "c.glb")
    trips = [load_scene_file(tmp_path / "a.glb")]
    for file in names:
        save_scene_file(trips[-1], tmp_path / file)
        trips.append(load_scene_file(tmp_path / file))
    assert difference(trips[1], trips[2]) is None
    assert len(trips[0].instances) == len(scene.instances)
    left = [loss.what for loss in lost.losses if loss.picture]
    assert len(scene.lights) == len(trips[0].lights) or any("light all around" in what for what in left)


def scene_of(*materials: MetallicRough | Matte) -> Scene:
    """Balls on a floor, under a point light and a sun."""
    view = np.array([[1.0, 0, 0, 0], [0, 0.8, 0.6, 6], [0, -0.6, 0.8, 8], [0, 0, 0, 1]])
    floor = np.array([[4.0, 0, 0, 0], [0, 0, 4, 0], [0, -4, 0, 0], [0, 0, 0, 1]])
    parts = [Instance(Rectangle(), GREY, floor)]
    ball = as_mesh(Sphere())
    for number, material in enumerate(materials):
        place = np.eye(4)
        place[:3, 3] = (2.4 * number - 1.2 * (len(materials) - 1), 1.0, 0.0)
        parts.append(Instance(ball, material, place))
    lights = (PointLight((2.0, 5.0, 3.0), (60.0, 50.0, 40.0)), DirectionalLight((1.0, -2.0, -1.0), (1.0, 1.5, 2.0)))
    return Scene(
        PerspectiveCamera(view, 36.0), tuple(parts), lights, Film(SIDE_PX, SIDE_PX), integrator=Integrator("path", 16)
    )


def blocks(picture: np.ndarray) -> np.ndarray:
    count = SIDE_PX // BLOCK_PX
    return picture.reshape(count, BLOCK_PX, count, BLOCK_PX, 3).mean(axis=(1, 3))


@pytest.mark.parametrize("z_up", [False, True])
def test_mitsuba_and_this_renderer_draw_the_same_file_alike(z_up: bool, tmp_path: Path) -> None:
    """By way of Mitsuba 3's own format, and as a model here. Metal and matte surfaces are the same in both."""
    parts = ImageTexture(np.ones((2, 2, 3), np.float32) * (0.0, 0.7, 1.0), source="parts")
    parts = dataclasses.replace(parts, image=parts.image.astype(np.float32))
    scene = scene_of(
        MetallicRough(ConstantTexture((0.9, 0.6, 0.3)), 1.0, 1.0, parts), Matte(ConstantTexture((0.2, 0.4, 0.6)))
    )
    if z_up:
        turn = np.array([[1.0, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0], [0, 0, 0, 1]])
        scene = dataclasses.replace(
            scene,
            camera=dataclasses.replace(scene.camera, to_world=turn @ scene.camera.to_world),
            instances=tuple(dataclasses.replace(one, to_world=turn @ one.to_world) for one in scene.instances),
            lights=(
                PointLight((2.0, -3.0, 5.0), (60.0, 50.0, 40.0)),
                DirectionalLight((1.0, 1.0, -2.0), (1.0, 1.5, 2.0)),
            ),
        )
    save_scene_file(scene, tmp_path / "a.glb")
    read = dataclasses.replace(load_scene_file(tmp_path / "a.glb"), film=Film(SIDE_PX, SIDE_PX))
    theirs = drawn(read, "mitsuba", tmp_path, SIDE_PX, 512)
    direct = drawn(scene, "mitsuba", tmp_path, SIDE_PX, 512)
    ours, _ = load_any(str(tmp_path / "a.glb"), integrator="path")
    made = render_image(Renderer(ours), SamplePlan(256), SIDE_PX, SIDE_PX, 0.0, (0.0, 0.0)).numpy()
    assert theirs.mean() > 0.1
    np.testing.assert_allclose(blocks(theirs), blocks(direct), rtol=0.05, atol=0.02 * direct.mean())
    assert made.mean() == pytest.approx(theirs.mean(), rel=0.02)
    np.testing.assert_allclose(blocks(made), blocks(theirs), rtol=0.06, atol=0.05 * theirs.mean())


def test_roughness_and_metal_of_textures_reach_every_format(tmp_path: Path) -> None:
    """Mitsuba 3 has the surface as it is; in others it is a mixture of plastic and metal with the same textures."""
    codes = np.array([[[0, 51, 255], [0, 255, 0]]], np.float32) / np.float32(255.0)
    material = MetallicRough(ConstantTexture((0.9, 0.6, 0.3)), 1.0, 1.0, ImageTexture(codes))
    save_scene_file(scene_of(material), tmp_path / "a.glb")
    read = load_scene_file(tmp_path / "a.glb")
    for name, to in (("a.pbrt", "pbrt"), ("b.pbrt", "pbrt4"), ("a.lxs", "luxrender"), ("a.xml", "mitsuba")):
        save_scene_file(read, tmp_path / name, to)
        made = load_scene_file(tmp_path / name).instances[1].material
        assert isinstance(made, MixMaterial) and isinstance(made.amount, ImageTexture)
        np.testing.assert_allclose(made.amount.image[..., 0], [[1.0, 0.0]], atol=1e-3)
        metal = made.second
        assert isinstance(metal, Metal) and isinstance(metal.alpha, ImageTexture)
        np.testing.assert_allclose(metal.alpha.image[..., 0], [[0.04, 1.0]], atol=1e-3)
    save_scene_file(read, tmp_path / "c.xml", "mitsuba3")
    (made,) = [one.material for one in load_scene_file(tmp_path / "c.xml").instances[1:]]
    assert isinstance(made, MetallicRough) and isinstance(made.parts, ImageTexture)
    np.testing.assert_allclose(made.parts.image[..., 1:], codes[..., 1:], atol=1e-3)
    save_scene_file(load_scene_file(tmp_path / "c.xml"), tmp_path / "d.glb")
    (again,) = [one.material for one in load_scene_file(tmp_path / "d.glb").instances[1:]]
    assert isinstance(again, MetallicRough) and isinstance(again.parts, ImageTexture)
    np.testing.assert_allclose(again.parts.image[..., 1:], codes[..., 1:], atol=1e-3)


def test_a_plain_model_has_a_view_and_lights_and_a_lamp_of_a_scene_is_its_light(tmp_path: Path) -> None:
    lamp = Instance(Rectangle(), GREY, emission=(3.0, 3.0, 3.0))
    save_scene_file(Scene(PerspectiveCamera(), (lamp,)), tmp_path / "a.gltf")
    seen = load_scene_file(tmp_path / "a.gltf")
    assert seen.lights == () and seen.background is None and seen.instances[0].emission == (3.0, 3.0, 3.0)
    tree = json.loads((tmp_path / "a.gltf").read_text())
    del tree["cameras"]
    tree["nodes"] = [{name: part for name, part in node.items() if name != "camera"} for node in tree["nodes"]]
    (tmp_path / "b.gltf").write_text(json.dumps(tree))
    assert len(load_scene_file(tmp_path / "b.gltf").lights) == 2


def test_a_glowing_surface_keeps_its_own_light_in_other_formats(tmp_path: Path) -> None:
    mesh = Mesh(np.eye(3, dtype=np.float32), np.array([[0, 1, 2]], np.int32))
    glow = MetallicRough(ConstantTexture((0.5, 0.5, 0.5)), 0.0, 0.5, emission=(2.0, 1.0, 0.5))
    report = LossReport()
    save_scene_file(Scene(PerspectiveCamera(), (Instance(mesh, glow),)), tmp_path / "a.glb")
    save_scene_file(load_scene_file(tmp_path / "a.glb", None, report), tmp_path / "a.pbrt", None, report)
    (part,) = load_scene_file(tmp_path / "a.pbrt").instances
    assert part.emission == (2.0, 1.0, 0.5) and isinstance(part.material, Plastic)
    assert not any("the light of" in str(loss) for loss in report.losses)


@pytest.mark.parametrize("scale", [(1.0, -1.0), (-1.0, 1.0), (-2.0, -0.5)])
def test_normals_of_a_mirrored_picture_look_the_same_way(scale: tuple[float, float], tmp_path: Path) -> None:
    """A light from above and the right, normals tilted against both axes, and a base with a picture of its own."""
    codes = np.array([[[200, 220, 215], [90, 220, 215]], [[200, 40, 215], [128, 128, 255]]], np.float32) / 255.0
    colours = np.array([[[1.0, 0, 0], [0, 1, 0]], [[0, 0, 1], [1, 1, 1]]], np.float32)
    base, normals = (ImageTexture(image, scale, (0.25, 1.0), filter="nearest") for image in (colours, codes))
    view = np.eye(4)
    view[2, 3] = 6.0
    scene = Scene(
        PerspectiveCamera(view, 20.0),
        (Instance(Rectangle(), NormalMapped(Matte(base), normals)),),
        (DirectionalLight((-0.5, -1.0, -1.0), (2.0, 2.0, 2.0)),),
        Film(SIDE_PX, SIDE_PX),
        integrator=Integrator("path", 2),
    )
    lost = LossReport()
    save_scene_file(scene, tmp_path / "a.gltf", None, lost)
    assert not [loss for loss in lost.losses if loss.picture]
    read = dataclasses.replace(load_scene_file(tmp_path / "a.gltf", None, lost), film=scene.film)
    assert not [loss for loss in lost.losses if loss.picture]
    pictures = [
        render_image(Renderer(one), SamplePlan(16), SIDE_PX, SIDE_PX, 0.0, (0.0, 0.0)).numpy() for one in (scene, read)
    ]
    assert np.ptp(pictures[0]) > 0.2
    np.testing.assert_allclose(pictures[1], pictures[0], atol=1e-3)
