"""View and lighting of a scene if its file does not define them, or the user changes them."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from scenes.animation import look_at
from scenes.arithmetic import norm, product, tan
from scenes.canonical import (
    Camera,
    DirectionalLight,
    EnvironmentLight,
    Instance,
    Matrix,
    PerspectiveCamera,
    Scene,
    SceneError,
    Shape,
    SunSky,
)
from scenes.formats.geometry.meshed import as_mesh
from scenes.pictures import Pixels

Up = Literal["y", "z"]

FOV_DEG = 40.0
"""Field of view of a camera that is placed here, degrees."""

_FROM = (0.5, -1.0, 0.45)
"""Direction from the target to the camera, with z upwards: in front, to the right and above."""

_MARGIN = 1.08
_POINTS_MOST = 20_000_000  # of which the world's places are made, 24 bytes each
_KEY, _FILL, _AMBIENT, _BACKGROUND = 2.2, 0.6, 0.18, 0.75


def turned_up(up: Up) -> Matrix:
    """The transform ``(4, 4)`` from a world with z upwards to one with ``up`` upwards; +y, the depth, becomes -z if y
    is upwards."""
    matrix = np.eye(4)
    if up == "y":
        matrix[:3, :3] = [[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]]
    return matrix


def camera_at(eye: Sequence[float], target: Sequence[float], up: Up) -> Matrix:
    """Camera-to-world transform ``(4, 4)`` of an upright camera with a target in the centre.

    Raises:
        SceneError: both are the same point, or not finite.
    """
    turn = turned_up(up)
    eye_in, target_in = (product(turn[:3, :3].T, np.asarray(point, np.float64)) for point in (eye, target))
    matrix = np.eye(4)
    matrix[:3, :3] = product(turn[:3, :3], look_at(eye_in, target_in).as_matrix())
    matrix[:3, 3] = eye
    return matrix


def up_of(scene: Scene) -> Up:
    """The upward axis of a scene, y or z: the one nearer to the upward direction of its camera."""
    above = np.abs(scene.camera.to_world[:3, 1])
    return "y" if above[1] > above[2] else "z"


def with_camera(
    scene: Scene, eye: Sequence[float], target: Sequence[float], up: Up, fov_deg: float | None = None
) -> Scene:
    """The scene with a static camera that has a target in the centre.

    Args:
        scene: scene, whose shutter is kept, and whose field of view is kept unless it is given.
        eye, target: points in the world.
        up: upward axis of the world.
        fov_deg: full angle of the shorter image axis.
    """
    before = scene.camera if isinstance(scene.camera, PerspectiveCamera) else PerspectiveCamera(fov_deg=FOV_DEG)
    camera = PerspectiveCamera(
        camera_at(eye, target, up), before.fov_deg if fov_deg is None else fov_deg, shutter_s=before.shutter_s
    )
    return dataclasses.replace(scene, camera=camera)


def with_lens(
    scene: Scene, lens_radius: float | None, focal_distance: float | None, camera: Sequence[float] | None = None
) -> Scene:
    """The scene seen through a thin lens.

    Args:
        scene: scene with a perspective camera.
        lens_radius: radius of the aperture, scene units; None for the camera's.
        focal_distance: distance to the plane in focus, scene units; None for that of the target of ``camera``, or for
            the camera's own.
        camera: eye and target, six numbers.

    Raises:
        SceneError: the camera is not a perspective one, or a value is out of range.
    """
    before = scene.camera
    if not isinstance(before, PerspectiveCamera):
        raise SceneError(f"lens_radius: expected a perspective camera, got {type(before).__name__}")
    if focal_distance is None:
        focal_distance = before.focal_distance
        if camera is not None:
            focal_distance = float(norm(np.asarray(camera[3:], np.float64) - np.asarray(camera[:3], np.float64)))
    radius = before.lens_radius if lens_radius is None else lens_radius
    lens = dataclasses.replace(before, lens_radius=radius, focal_distance=focal_distance)
    return dataclasses.replace(scene, camera=lens)


def with_environment(scene: Scene, picture: Pixels, up: Up, source: str = "") -> Scene:
    """The scene lit by an environment map whose top is upwards.

    The map replaces the lights at infinity: environment maps, sky, directional lights, the ambient light and the
    background. Lamps are kept.
    """
    turn = product(turned_up(up), turned_up("y").T)
    light = EnvironmentLight(picture, turn, source=source)
    far = EnvironmentLight | SunSky | DirectionalLight
    kept = tuple(one for one in scene.lights if not isinstance(one, far))
    return dataclasses.replace(scene, lights=(*kept, light), background=None, ambient=(0.0, 0.0, 0.0))


def framed(instances: tuple[Instance, ...], up: Up, name: str = "", camera: Camera | None = None) -> Scene:
    """A scene of instances with lights, and with a camera that shows all of them unless one is given.

    The camera stands in front, to the right and above. A key light comes from its upper left, a weaker one from its
    right, and ambient light fills the shadows; the background is a uniform grey that lights nothing.

    Raises:
        SceneError: there are no instances.
    """
    if not instances:
        raise SceneError(f"{name or 'scene'}: expected at least one instance, got none")
    turn = turned_up(up)[:3, :3]
    back = product(turn, np.array(_FROM) / norm(np.array(_FROM)))
    axes = camera_at(back, (0.0, 0.0, 0.0), up)[:3, :3]
    lights = tuple(
        DirectionalLight(_direction(-product(axes, np.array(towards))), (strength, strength, strength))
        for towards, strength in (((-0.5, 0.8, 0.7), _KEY), ((0.8, 0.1, 0.6), _FILL))
    )
    background = EnvironmentLight(np.full((1, 1, 3), _BACKGROUND, np.float32))
    camera = PerspectiveCamera(_place_before(instances, axes), FOV_DEG) if camera is None else camera
    return Scene(camera, instances, lights, ambient=(_AMBIENT, _AMBIENT, _AMBIENT), name=name, background=background)


def _direction(vector: NDArray[np.float64]) -> tuple[float, float, float]:
    x, y, z = (float(part) for part in vector)
    return x, y, z


def _place_before(instances: tuple[Instance, ...], axes: NDArray[np.float64]) -> Matrix:
    """The transform of a camera with these axes that shows all instances; of very many points, their boxes."""
    shapes = {id(one.shape): one.shape for one in instances}
    used = {key: _vertices(shape) for key, shape in shapes.items()}
    if sum(len(used[id(one.shape)]) for one in instances) > _POINTS_MOST:
        used = {key: _corners(points) for key, points in used.items()}
    seen = np.concatenate([
        product(product(used[id(one.shape)], one.to_world[:3, :3].T) + one.to_world[:3, 3], axes) for one in instances
    ])  # fmt: skip
    middle = 0.5 * (seen.min(axis=0) + seen.max(axis=0))
    half = _MARGIN * np.abs(seen - middle)[:, :2].max(axis=1)
    away = float((half / tan(math.radians(FOV_DEG) / 2.0) + seen[:, 2] - middle[2]).max()) or 1.0
    matrix = np.eye(4)
    matrix[:3, :3] = axes
    matrix[:3, 3] = product(axes, middle + np.array([0.0, 0.0, away]))
    return matrix


def _vertices(shape: Shape) -> NDArray[np.float64]:
    mesh = as_mesh(shape)
    return mesh.vertices[np.unique(mesh.faces)].astype(np.float64)


def _corners(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """The corners ``(8, 3)`` of the box around points."""
    ends = np.stack([points.min(axis=0), points.max(axis=0)])
    return ends[np.indices((2, 2, 2)).reshape(3, 8).T, np.arange(3)]
