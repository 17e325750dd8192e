"""Camera motion for static scenes: around the point looked at, or towards it."""

from __future__ import annotations

import dataclasses
from typing import Literal

import numpy as np

from scenes.animation import continuous_quaternions
from scenes.arithmetic import cos, norm, product, rotation_about
from scenes.canonical import Mesh, PerspectiveCamera, Scene, SceneError
from scenes.canonical.values import RigidTrack
from scenes.formats.geometry.meshed import as_mesh

CameraPath = Literal["turntable", "fly-through"]
TURN_S = 8.0
"""Duration of a full turn, seconds."""

FLIGHT_S, FLIGHT_SHARE = 4.0, 0.5
"""Duration of the flight, seconds, and its length as a share of the distance to the point looked at."""

_KEYS = 65


def on_a_path(scene: Scene, path: CameraPath) -> Scene:
    """The scene with its camera in motion.

    ``turntable`` rotates about the vertical through the point looked at, once in :data:`TURN_S`; the vertical is the
    world axis nearest to the camera's up axis. ``fly-through`` moves straight ahead and back.

    Raises:
        SceneError: the camera already moves, or is not a perspective camera.
    """
    camera = scene.camera
    if not isinstance(camera, PerspectiveCamera):
        raise SceneError(f"camera_path: expected a perspective camera, got {type(camera).__name__}")
    if camera.track is not None:
        raise SceneError("camera_path: expected a scene with a static camera, this one moves")
    eye = camera.to_world[:3, 3]
    forward = -camera.to_world[:3, 2] / norm(camera.to_world[:3, 2])
    way = looked_at_distance(scene, eye, forward)
    if path == "turntable":
        up = camera.to_world[:3, 1]
        axis = np.zeros(3)
        axis[int(np.abs(up).argmax())] = np.sign(up[int(np.abs(up).argmax())])
        center = eye + way * forward
        turns = rotation_about(axis, np.linspace(0.0, 2.0 * np.pi, _KEYS))
        rotation = continuous_quaternions(turns.as_quat())
        translation = center - turns.apply(center)
        track = RigidTrack(0.0, TURN_S / (_KEYS - 1), translation, rotation)
        return dataclasses.replace(scene, camera=dataclasses.replace(camera, track=track), duration_s=TURN_S)
    there = 0.5 - 0.5 * cos(np.linspace(0.0, 2.0 * np.pi, _KEYS))
    translation = FLIGHT_SHARE * way * there[:, None] * forward
    still = np.tile([0.0, 0.0, 0.0, 1.0], (_KEYS, 1))
    track = RigidTrack(0.0, FLIGHT_S / (_KEYS - 1), translation, still)
    return dataclasses.replace(scene, camera=dataclasses.replace(camera, track=track), duration_s=FLIGHT_S)


def looked_at_distance(scene: Scene, eye: np.ndarray, forward: np.ndarray) -> float:
    """Median distance, along the line of sight, of the centres of the shapes in front of the camera."""
    middles = []
    for instance in scene.instances:
        shape = instance.shape
        points = shape.vertices if isinstance(shape, Mesh) else as_mesh(shape).vertices
        center = 0.5 * (points.min(axis=0) + points.max(axis=0)).astype(np.float64)
        middles.append(product(instance.to_world, np.append(center, 1.0))[:3])
    ahead = np.array([product(middle - eye, forward) for middle in middles])
    ahead = ahead[ahead > 0.0]
    return float(np.median(ahead)) if len(ahead) else 1.0
