"""Cameras and lights of USD files as the format defines them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from scenes.animation import pose_at
from scenes.canonical import (
    DirectionalLight,
    Disk,
    EnvironmentLight,
    OrthographicCamera,
    PerspectiveCamera,
    PointLight,
    Rectangle,
    SceneError,
    Sphere,
    SpotLight,
)
from scenes.catalog import Look, load_seen
from scenes.formats.losses import LossReport
from scenes.models import read_whole
from tests.scenes.models.usd import mesh, written
from tests.scenes.test_radiance import wide_exr


def test_cameras(tmp_path: Path) -> None:
    body = (
        mesh()
        + """def Camera "wide" {
        float horizontalAperture = 36
        float verticalAperture = 24
        float focalLength = 50
        float fStop = 2
        float focusDistance = 7
        double3 xformOp:translate.timeSamples = { 0: (0, 0, 9), 24: (0, 0, 5) }
        uniform token[] xformOpOrder = ["xformOp:translate"]
    }
    def Camera "flat" {
        token projection = "orthographic"
        float horizontalAperture = 20
        float verticalAperture = 40
    }
    """
    )
    path = written(tmp_path, body, end=24)
    scene, losses = load_seen(str(path), Look())
    camera = scene.camera
    assert isinstance(camera, PerspectiveCamera) and not losses
    assert camera.fov_deg == pytest.approx(np.degrees(2 * np.arctan(12 / 50)))
    assert camera.lens_radius == pytest.approx(1.25) and camera.focal_distance == 7.0
    assert camera.track is not None and pose_at(camera.track, 1.0)[2, 3] == pytest.approx(-4.0)
    assert (scene.film.width_px, scene.film.height_px) == (768, 512)
    other = load_seen(str(path), Look(camera="flat"))[0]
    assert isinstance(other.camera, OrthographicCamera) and other.camera.half_width == pytest.approx(1.0)
    assert (other.film.width_px, other.film.height_px) == (512, 1024)
    with pytest.raises(SceneError, match=r"one of the cameras of .*in.usda \(wide, flat\), got 'no'"):
        load_seen(str(path), Look(camera="no"))


def test_lights(tmp_path: Path) -> None:
    body = (
        mesh()
        + """def DistantLight "sun" { float inputs:intensity = 100
        float inputs:angle = 2
        color3f inputs:color = (1, 0.5, 0)
        float xformOp:rotateX = -90
        uniform token[] xformOpOrder = ["xformOp:rotateX"] }
    def SphereLight "bulb" { float inputs:intensity = 3
        float inputs:radius = 0.5
        float inputs:exposure = 1 }
    def SphereLight "point" { bool treatAsPoint = 1
        float inputs:intensity = 8
        float inputs:radius = 0.5 }
    def RectLight "panel" { float inputs:width = 4
        float inputs:height = 2
        bool inputs:normalize = 1
        float inputs:intensity = 16 }
    def DiskLight "disk" { float inputs:radius = 2 }
    def SphereLight "lamp" { float inputs:shaping:cone:angle = 30
        float inputs:shaping:cone:softness = 0.5
        float inputs:radius = 1 }
    def DomeLight "sky" { color3f inputs:color = (0.2, 0.3, 0.4) }
    def CylinderLight "tube" { }
    """
    )
    report = LossReport()
    model = read_whole(written(tmp_path, body), report)
    sun, point, lamp, sky = model.lights
    assert isinstance(sun, DirectionalLight) and sun.direction == pytest.approx((0, -1, 0), abs=1e-6)
    assert sun.irradiance == pytest.approx(100 * np.pi * np.sin(np.radians(1.0)) ** 2 * np.array([1, 0.5, 0]))
    assert sun.angle_deg == pytest.approx(2.0)
    assert isinstance(point, PointLight) and point.intensity == pytest.approx(3 * (8 * np.pi * 0.25,))
    assert isinstance(lamp, SpotLight) and (lamp.inner_deg, lamp.outer_deg) == pytest.approx((15.0, 30.0))
    assert lamp.intensity == pytest.approx(3 * (np.pi,)) and lamp.target == pytest.approx((0, 0, -1))
    assert isinstance(sky, EnvironmentLight) and sky.image[0, 0] == pytest.approx((0.2, 0.3, 0.4))
    lamps = {part.name: part for part in model.parts if part.emission is not None}
    assert isinstance(lamps["in/bulb"].shape, Sphere) and lamps["in/bulb"].emission == pytest.approx((6, 6, 6))
    panel = lamps["in/panel"]
    assert isinstance(panel.shape, Rectangle) and panel.emission == pytest.approx((2, 2, 2))
    assert panel.to_world[:3, 2] == pytest.approx((0, 0, -1)), "it shines along -z"
    assert isinstance(lamps["in/disk"].shape, Disk) and lamps["in/disk"].emission == pytest.approx((1, 1, 1))
    assert "tube: a light of kind CylinderLight" in report.text()
    scene, _ = load_seen(str(tmp_path / "in.usda"), Look(integrator="path"))
    assert scene.lights == model.lights or len(scene.lights) == 4
    assert scene.background is None and scene.ambient == (0.0, 0.0, 0.0), "no lights beside those of the file"


@pytest.mark.parametrize(("up", "pole"), [("Y", (0, 1, 0)), ("Z", (0, 0, 1))])
def test_the_pole_of_a_dome(up: str, pole: tuple[int, ...], tmp_path: Path) -> None:
    """DomeLight has its pole along y; DomeLight_1 along the upward axis."""
    body = mesh() + 'def DomeLight "a" { }\ndef DomeLight_1 "b" { }\n'
    first, second = read_whole(written(tmp_path, body, up=up)).lights
    assert first.to_world[:3, 1] == pytest.approx((0, 1, 0)) and second.to_world[:3, 1] == pytest.approx(pole)


@pytest.mark.parametrize(("space", "expected"), [("", [0.0, 1.1329, 0.0]), ('(colorSpace = "raw")', [0.0, 1.0, 0.0])])
def test_an_environment_with_other_primaries_becomes_rec_709(space: str, expected: list, tmp_path: Path) -> None:
    file = wide_exr(tmp_path)
    dome = f'def DomeLight "d" {{ float inputs:intensity = 1\nasset inputs:texture:file = @{file.name}@ {space} }}\n'
    (light,) = read_whole(written(tmp_path, mesh() + dome)).lights
    assert isinstance(light, EnvironmentLight) and light.image[0, 0] == pytest.approx(expected, abs=1e-4)


@pytest.mark.parametrize(("cone", "changes"), [("", None), ("90", False), ("120", True), ("180", None)])
def test_a_wide_cone_of_a_lamp_is_said(cone: str, changes: bool | None, tmp_path: Path) -> None:
    shaped = f"float inputs:shaping:cone:angle = {cone}" if cone else ""
    report = LossReport()
    lamp = f'def SphereLight "l" {{ bool treatAsPoint = 1\n{shaped} }}'
    whole = read_whole(written(tmp_path, mesh() + lamp), report)
    assert isinstance(whole.lights[0], PointLight)
    assert [loss.picture for loss in report.losses if "a cone" in loss.what] == ([] if changes is None else [changes])
