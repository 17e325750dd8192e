"""Cameras that see a model as a whole, environments with their top upwards, and cameras by two points."""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path

import numpy as np
import pytest

from scenes import catalog, viewing
from scenes.canonical import (
    ConstantTexture,
    Cube,
    DirectionalLight,
    EnvironmentLight,
    Instance,
    Mesh,
    OrthographicCamera,
    PerspectiveCamera,
    Phong,
    PointLight,
    Scene,
    SceneError,
    Sphere,
)
from scenes.catalog import Look, load_seen
from scenes.viewing import FOV_DEG, Up, camera_at, framed, up_of, with_camera, with_environment
from tests.scenes.models.files import CASES

GREY = Phong(ConstantTexture((0.5, 0.5, 0.5)))
CUBE = CASES / "cube-without-normals.gltf"


def on_film(scene: Scene, points: np.ndarray) -> np.ndarray:
    """Where points are seen, from -1 to 1 along each axis of a square picture; those behind are NaN."""
    assert isinstance(scene.camera, PerspectiveCamera)
    inside = np.linalg.inv(scene.camera.to_world) @ np.append(points, np.ones((len(points), 1)), axis=1).T
    half = math.tan(math.radians(scene.camera.fov_deg) / 2.0)
    return np.where(inside[2] < 0.0, inside[:2] / -inside[2] / half, np.nan).T


@pytest.mark.parametrize("up", ["y", "z"])
@pytest.mark.parametrize("size", [(1.0, 1.0, 1.0), (100.0, 0.1, 3.0), (1e-3, 2e-3, 5e-3)])
@pytest.mark.parametrize("place", [(0.0, 0.0, 0.0), (5e6, -3e6, 80.0)])
def test_all_of_a_thing_is_seen_and_fills_the_picture(up: Up, size: tuple, place: tuple) -> None:
    rng = np.random.default_rng(3)
    points = rng.uniform(-1.0, 1.0, (60, 3)) * size + place
    scene = framed((Instance(Mesh(points, np.arange(60, dtype=np.int32).reshape(-1, 3)), GREY),), up)
    seen = on_film(scene, points)
    assert np.abs(seen).max() < 0.97 and np.abs(seen).max() > 0.7
    assert scene.camera.to_world["xyz".index(up), 0] == pytest.approx(0.0, abs=1e-12), "upright"
    assert scene.camera.to_world["xyz".index(up), 1] > 0.8


def test_light_comes_from_the_cameras_side() -> None:
    scene = framed((Instance(Sphere(), GREY),), "z", "ball")
    back = scene.camera.to_world[:3, 2]
    lights = [light for light in scene.lights if isinstance(light, DirectionalLight)]
    assert len(lights) == 2 and all(np.dot(light.direction, back) < 0.0 for light in lights)
    assert scene.background is not None and max(scene.ambient) > 0.0 and scene.name == "ball"
    with pytest.raises(SceneError, match="expected at least one instance"):
        framed((), "z", "nothing")


@pytest.mark.parametrize("up", ["y", "z"])
def test_a_camera_by_two_points_may_look_straight_down(up: Up) -> None:
    axis = np.eye(3)["xyz".index(up)]
    for eye in (5.0 * axis, -5.0 * axis, np.array([4.0, 1.0, 2.0])):
        matrix = camera_at(eye.tolist(), (0.0, 0.0, 0.0), up)
        assert np.isfinite(matrix).all() and np.linalg.det(matrix) == pytest.approx(1.0)
        assert matrix[:3, 2] == pytest.approx(eye / np.linalg.norm(eye)) and matrix[:3, 3] == pytest.approx(eye)
    assert matrix[:3, 1] @ axis > 0.0


def test_a_camera_keeps_what_is_not_asked_for() -> None:
    scene = Scene(PerspectiveCamera(fov_deg=30.0, shutter_s=(0.0, 0.1)), ())
    seen = with_camera(scene, (1.0, 2.0, 3.0), (0.0, 0.0, 0.0), "y").camera
    assert isinstance(seen, PerspectiveCamera) and (seen.fov_deg, seen.shutter_s) == (30.0, (0.0, 0.1))
    parallel = dataclasses.replace(scene, camera=OrthographicCamera())
    assert with_camera(parallel, (1.0, 2.0, 3.0), (0.0, 0.0, 0.0), "y", 70.0).camera.fov_deg == 70.0  # type: ignore[union-attr]


@pytest.mark.parametrize("up", ["y", "z"])
def test_an_environment_has_its_top_upwards_and_replaces_other_far_light(up: Up) -> None:
    lamp = PointLight((0.0, 0.0, 1.0), (1.0, 1.0, 1.0))
    scene = dataclasses.replace(framed((Instance(Sphere(), GREY),), up), lights=(lamp,))
    picture = np.ones((2, 4, 3), np.float32)
    lit = with_environment(scene, picture, up)
    kept, light = lit.lights
    assert kept is lamp and isinstance(light, EnvironmentLight) and lit.background is None
    assert lit.ambient == (0.0, 0.0, 0.0)
    # the top of an untransformed map is +y
    assert light.to_world @ (0.0, 1.0, 0.0, 0.0) == pytest.approx((*np.eye(3)["xyz".index(up)], 0.0))
    assert np.linalg.det(light.to_world) == pytest.approx(1.0)


def test_a_model_is_a_scene_and_looked_at_as_asked_for() -> None:
    found, losses = catalog.load_any(CUBE)
    assert found.name == CUBE.stem and losses == () and up_of(found) == "y"
    assert isinstance(found.camera, PerspectiveCamera) and found.camera.fov_deg == FOV_DEG
    turned, _ = load_seen(str(CUBE), Look(up="z", smooth_deg=95.0, fov_deg=20.0))
    assert up_of(turned) == "z" and turned.camera.fov_deg == 20.0  # type: ignore[union-attr]
    assert turned.instances[0].shape.normals is not None and found.instances[0].shape.normals is None  # type: ignore[union-attr]
    seen, _ = load_seen(str(CUBE), Look(camera=(0.0, 0.0, 5.0, 0.0, 0.0, 0.0)))
    assert seen.camera.to_world == pytest.approx(camera_at((0.0, 0.0, 5.0), (0.0, 0.0, 0.0), "y"))


def test_what_cannot_be_looked_at_is_said(tmp_path: Path) -> None:
    with pytest.raises(SceneError, match="fov_deg: expected a perspective camera, got OrthographicCamera"):
        load_seen("parallel-projection", Look(fov_deg=20.0))
    with pytest.raises(SceneError, match="expected finite points that differ"):
        load_seen(str(CUBE), Look(camera=(1.0, 1.0, 1.0, 1.0, 1.0, 1.0)))
    with pytest.raises(SceneError, match="expected an image file, found none"):
        load_seen(str(CUBE), Look(environment=tmp_path / "gone.hdr"))


def test_a_lens_is_focused_on_the_target() -> None:
    eye = 3.0, 4.0, 0.0, 0.0, 0.0, 0.0
    camera = load_seen(str(CUBE), Look(camera=eye, lens_radius=0.25))[0].camera
    assert isinstance(camera, PerspectiveCamera) and (camera.lens_radius, camera.focal_distance) == (0.25, 5.0)
    own = load_seen(str(CUBE), Look(camera=eye, lens_radius=0.25, focal_distance=2.0))[0].camera
    assert isinstance(own, PerspectiveCamera) and own.focal_distance == 2.0
    with pytest.raises(SceneError, match="expected a perspective camera, got OrthographicCamera"):
        load_seen(Scene(OrthographicCamera(), ()), Look(lens_radius=0.1))


def test_a_camera_path_goes_round_the_target_of_the_given_camera() -> None:
    camera = load_seen(str(CUBE), Look(camera=(3.0, 4.0, 0.0, 0.0, 0.0, 0.0)), camera_path="turntable")[0].camera
    assert isinstance(camera, PerspectiveCamera) and camera.track is not None
    np.testing.assert_allclose(camera.to_world[:3, 3], (3.0, 4.0, 0.0))
    with pytest.raises(SceneError, match="expected none for a built-in scene"):
        load_seen("plain", Look(fov_deg=30.0), camera_path="turntable")


def test_a_camera_that_is_given_is_kept_and_very_many_points_are_seen_by_their_boxes(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    places = [np.diag([1.0, 2.0, 3.0, 1.0]), np.eye(4)]
    places[1][:3, 3] = (9.0, 1.0, 2.0)
    balls = tuple(Instance(Sphere(), GREY, place) for place in places)
    given = PerspectiveCamera()
    assert viewing.framed(balls, "z", camera=given).camera is given
    exact = viewing.framed(balls, "z").camera.to_world
    monkeypatch.setattr(viewing, "_POINTS_MOST", 100)
    around = viewing.framed(balls, "z").camera.to_world
    np.testing.assert_array_equal(exact[:3, :3], around[:3, :3])
    distance = np.linalg.norm(around[:3, 3] - exact[:3, 3])
    assert 0.0 < distance < 0.5 * np.linalg.norm(exact[:3, 3])
    cubes = tuple(dataclasses.replace(ball, shape=Cube()) for ball in balls)  # which are their boxes
    monkeypatch.setattr(viewing, "_POINTS_MOST", 1 << 30)
    whole = viewing.framed(cubes, "z").camera.to_world
    monkeypatch.setattr(viewing, "_POINTS_MOST", 1)
    np.testing.assert_array_equal(whole, viewing.framed(cubes, "z").camera.to_world)
