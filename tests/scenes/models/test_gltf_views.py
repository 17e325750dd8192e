"""Cameras, lights and skins of glTF files."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from renderer import render
from scenes.animation import pose_at
from scenes.canonical import DirectionalLight, OrthographicCamera, PerspectiveCamera, PointLight, SceneError, SpotLight
from scenes.catalog import Look, load_seen
from scenes.formats.losses import LossReport
from scenes.models import read_model, read_whole
from tests.scenes.models.files import QUAD, Gltf
from tests.scripts.commands import call_script, one_line

SEEN = {"type": "perspective", "perspective": {"yfov": 0.8, "aspectRatio": 2.0}}
TALL = {"type": "perspective", "perspective": {"yfov": 0.8, "aspectRatio": 0.5}, "name": "tall"}
FLAT = {"type": "orthographic", "orthographic": {"xmag": 3.0, "ymag": 2.0}}


def with_cameras(folder: Path) -> Gltf:
    """A turned and scaled carrier moves one camera; the others stand at the origin."""
    file = Gltf(folder)
    file.json["cameras"] = [SEEN, TALL, FLAT]
    file.json["nodes"] += [
        {"children": [2], "scale": [2, 2, 2], "rotation": [0, math.sin(math.pi / 4), 0, math.cos(math.pi / 4)]},
        {"camera": 0, "translation": [0, 0, 3], "name": "first"},
        {"camera": 1},
        {"camera": 2, "name": "flat"},
    ]
    file.json["scenes"][0]["nodes"] = [0, 1, 3, 4]
    times = file.accessor(np.array([0, 1], np.float32))
    moves = file.accessor(np.array([[0, 0, 0], [0, 0, 5]], np.float32))
    file.json["animations"] = [
        {"samplers": [{"input": times, "output": moves}],
         "channels": [{"sampler": 0, "target": {"node": 1, "path": "translation"}}]}
    ]  # fmt: skip
    return file


def test_the_first_camera_is_used_and_others_by_name(tmp_path: Path) -> None:
    path = str(with_cameras(tmp_path).written())
    scene, losses = load_seen(path, Look())
    camera = scene.camera
    assert isinstance(camera, PerspectiveCamera) and not losses
    assert camera.fov_deg == pytest.approx(math.degrees(0.8))
    np.testing.assert_allclose(camera.to_world[:3, :3], [[0, 0, 1], [0, 1, 0], [-1, 0, 0]], atol=1e-6)
    assert camera.track is not None
    for time_s, place in ((0.0, (6, 0, 0)), (1.0, (6, 0, 5))):
        np.testing.assert_allclose((pose_at(camera.track, time_s) @ camera.to_world)[:3, 3], place, atol=1e-6)
    assert (scene.film.width_px, scene.film.height_px) == (1024, 512)
    tall = load_seen(path, Look(camera="tall"))[0].camera
    assert isinstance(tall, PerspectiveCamera)
    assert tall.fov_deg == pytest.approx(math.degrees(2 * math.atan(0.5 * math.tan(0.4))))
    flat = load_seen(path, Look(camera="flat"))[0].camera
    assert isinstance(flat, OrthographicCamera) and flat.half_width == 2.0
    again = load_seen(path, Look(camera=(0, 0, 9, 0, 0, 0)))[0]
    assert again.camera.to_world[2, 3] == 9.0, "six numbers are a camera of their own"


def test_a_camera_without_an_aspect_says_so(tmp_path: Path) -> None:
    """By the specification its aspect is that of the picture, and its field of view along the height."""
    file = with_cameras(tmp_path)
    file.json["cameras"][0] = {"type": "perspective", "perspective": {"yfov": 0.8}}
    scene, losses = load_seen(str(file.written()), Look())
    assert scene.film.width_px == scene.film.height_px
    (loss,) = losses
    assert "cameras[0].perspective: no aspectRatio" in loss


def test_a_named_camera_by_the_command(tmp_path: Path, monkeypatch, capsys) -> None:
    path, out = with_cameras(tmp_path).written(), tmp_path / "out"
    arguments = (str(path), "--size", "16x8", "--out", str(out), "--camera")
    assert call_script("render.py", monkeypatch, *arguments, "flat") == 0, capsys.readouterr().err
    capsys.readouterr()
    assert call_script("render.py", monkeypatch, *arguments, "none-such") == 2
    error = capsys.readouterr().err
    assert one_line(error) and "(first, tall, flat), got 'none-such'" in error
    assert call_script("render.py", monkeypatch, "glass", "--camera", "a", "--out", str(out)) == 2
    assert one_line(capsys.readouterr().err)
    assert call_script("render.py", monkeypatch, str(path), "--out", str(out), "--camera", "1", "2", "3") == 2


def with_light(folder: Path, **light: Any) -> Gltf:
    file = Gltf(folder)
    file.json["extensionsRequired"] = file.json["extensionsUsed"] = ["KHR_lights_punctual"]
    file.json["extensions"] = {"KHR_lights_punctual": {"lights": [light]}}
    file.json["nodes"].append({"translation": [0, 0, 2], "extensions": {"KHR_lights_punctual": {"light": 0}}})
    file.json["scenes"][0]["nodes"].append(1)
    return file


def test_lights(tmp_path: Path) -> None:
    def light(**given: Any) -> Any:
        report = LossReport()
        (found,) = read_whole(with_light(tmp_path, **given).written(), report).lights
        assert not report.losses
        return found

    point = light(type="point", color=[1, 0.5, 0.25], intensity=8)
    assert point == PointLight((0, 0, 2), (8, 4, 2))
    sun = light(type="directional", intensity=3)
    assert isinstance(sun, DirectionalLight) and sun.direction == (0, 0, -1) and sun.irradiance == (3, 3, 3)
    spot = light(type="spot", spot={"innerConeAngle": 0.1, "outerConeAngle": 0.4})
    assert isinstance(spot, SpotLight) and spot.target == pytest.approx((0, 0, 1)) and spot.intensity == (1, 1, 1)
    assert (spot.inner_deg, spot.outer_deg) == pytest.approx((math.degrees(0.1), math.degrees(0.4)))
    report = LossReport()
    read_whole(with_light(tmp_path, type="point", range=4).written(), report)
    read_whole(with_light(tmp_path, type="area").written(), report)
    assert "the range of a light" in report.text() and "a light of type area" in report.text()


def test_a_spot_with_equal_cones_is_sharp(tmp_path: Path) -> None:
    report = LossReport()
    file = with_light(tmp_path, type="spot", spot={"innerConeAngle": 0.4, "outerConeAngle": 0.4})
    (spot,) = read_whole(file.written(), report).lights
    assert isinstance(spot, SpotLight) and 0.0 < spot.outer_deg - spot.inner_deg < 1e-3
    assert spot.outer_deg == pytest.approx(math.degrees(0.4))
    assert "a spot whose inner cone is as wide as its outer cone" in report.text()
    file = with_light(tmp_path, type="spot", spot={"innerConeAngle": -0.1, "outerConeAngle": 0.4})
    with pytest.raises(SceneError, match=r"lights\[0\].spot: expected cone angles"):
        read_whole(file.written())


def test_a_point_light_lights_as_it_says(tmp_path: Path) -> None:
    """Below a light of I candela at distance d, a white diffuse surface has the radiance I / (π d²)."""
    file = with_light(tmp_path, type="point", intensity=5)
    file.material(pbrMetallicRoughness={"metallicFactor": 0.0, "baseColorFactor": [1, 1, 1, 1]},
                  extensions={"KHR_materials_ior": {"ior": 1.0}})  # fmt: skip
    look = Look(camera=(0, 0, 3, 0, 0, 0), fov_deg=1.0, integrator="path", bounces=0)
    found = render(file.written(), size=(16, 16), samples_per_pixel=16, look=look)
    assert found.mean() == pytest.approx(5 / (math.pi * 4.0), rel=0.01)


def with_skin(folder: Path, **changes: Any) -> Gltf:
    """A quad whose right half hangs on a second joint; its node has a transform that must not count."""
    file = Gltf(folder)
    file.attribute("NORMAL", np.tile(np.array([0, 0, 1], np.float32), (4, 1)))
    file.attribute("JOINTS_0", np.array([[0, 1, 0, 0], [1, 0, 0, 0], [1, 0, 0, 0], [0, 1, 0, 0]], np.uint8))
    file.attribute("WEIGHTS_0", np.array([[1, 1, 0, 0], [2, 0, 0, 0], [1, 0, 0, 0], [1, 0, 0, 0]], np.float32))
    rest = np.tile(np.eye(4, dtype=np.float32), (2, 1, 1))
    rest[1, 3, 0] = -1.0  # columns: the second joint rests at x = 1
    file.json["skins"] = [{"joints": [1, 2], "inverseBindMatrices": file.accessor(rest)}]
    turn = [0.0, -math.sin(math.pi / 4), 0.0, math.cos(math.pi / 4)]
    file.json["nodes"] = [
        {"mesh": 0, "skin": 0, "translation": [99, 99, 99]},
        {"children": [2]},
        {"translation": [1, 0, 0], "rotation": turn},
    ]
    file.json["scenes"][0]["nodes"] = [0, 1]
    file.json["skins"][0] |= changes
    return file


def test_a_skin_bends_its_mesh(tmp_path: Path) -> None:
    """The second joint turns by -90 degrees about y through (1, 0, 0): its points stay, their normals turn."""
    report = LossReport()
    (part,) = read_model(with_skin(tmp_path).written(), report)
    assert not report.losses and (part.to_world == np.eye(4)).all()
    order = [int(np.abs(part.shape.vertices - point).sum(axis=1).argmin()) for point in np.array(QUAD)[1:]]
    np.testing.assert_allclose(part.shape.vertices[order], np.array(QUAD)[1:], atol=1e-6)
    np.testing.assert_allclose(part.shape.normals[order], [[-1, 0, 0], [-1, 0, 0], [0, 0, 1]], atol=1e-6)
    # half of (-1, -1, 0), and half of that point turned about the joint: (1, -1, -2)
    first = next(row for row in range(4) if row not in order)
    np.testing.assert_allclose(part.shape.vertices[first], (0.0, -1.0, -1.0), atol=1e-6)


def test_skins_that_cannot_be(tmp_path: Path) -> None:
    for changes, said in (
        ({"joints": [1, 7]}, r"skins\[0\].joints\[1\]: expected an index of nodes below 3, got 7"),
        ({"joints": [1]}, "expected 1 matrices"),
        ({"joints": [1], "inverseBindMatrices": with_skin(tmp_path).json["skins"][0]["joints"][0]}, "expected MAT4"),
    ):
        with pytest.raises(SceneError, match=said):
            read_model(with_skin(tmp_path, **changes).written())
    file = with_skin(tmp_path)
    file.json["scenes"][0]["nodes"] = [0]
    with pytest.raises(SceneError, match=r"skins\[0\].joints: expected nodes of the scene, got node 1 outside of it"):
        read_model(file.written())
    file = with_skin(tmp_path)
    file.attribute("JOINTS_0", np.full((4, 4), 9, np.uint8))
    with pytest.raises(
        SceneError, match=r"primitives\[0\].attributes.JOINTS_0: expected indices of joints below 2, got 9"
    ):
        read_model(file.written())
    file.attribute("WEIGHTS_0", np.zeros((4, 4), np.float32))
    file.attribute("JOINTS_0", np.zeros((4, 4), np.uint8))
    with pytest.raises(SceneError, match="a joint with a weight for each vertex"):
        read_model(file.written())


@pytest.mark.parametrize(
    "cameras", [[{"type": "perspective"}], [{"type": "orthographic", "orthographic": {"xmag": 0}}], []]
)
def test_cameras_that_cannot_be(cameras: list, tmp_path: Path) -> None:
    file = Gltf(tmp_path)
    file.json |= {"cameras": cameras}
    file.json["nodes"][0]["camera"] = 0
    with pytest.raises(SceneError, match="expected"):
        read_whole(file.written())
