"""Choice of the origin of the kernels' space: single precision is accurate only near it.

Kernels compute in float32, whose resolution falls with the distance from the origin: at a distance of 1e5 times the
size of a room, a step is a hundredth of the room. A distant scene is therefore translated in float64 before it is
rounded.
"""

from __future__ import annotations

import math
import warnings
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from scenes.animation import pose_at
from scenes.arithmetic import product
from scenes.canonical import Disk, Instance, Light, Matrix, Mesh, PointLight, RigidTrack, Scene, Sphere, SpotLight

_NEAR = 128.0
"""Distance from the origin, in typical half sizes, within which a scene is not moved. The typical half size is the
median over the instances."""

_EXTENTS, _SIZES = 4.0, 64.0
"""Least step of the origin, in half sizes of the whole scene and in typical ones; the lesser of both counts."""

_TOO_FAR = 1.0e5
"""Distance from the origin, in half sizes of an instance, beyond which it is rendered too coarsely: at 1e5 a step is
1/170 of it."""

_COARSE = 1.0e-3
"""Step of the vertices' precision, in half sizes of their mesh, beyond which the mesh has lost its shape."""

Vector = NDArray[np.float64]


def near_origin(scene: Scene, origin: Vector | None = None) -> Scene:
    """The scene, moved so that an origin becomes zero; the same object if it does already.

    Warns of instances that are still too far away.

    Args:
        scene: scene to move.
        origin: the new origin, scene units; by default :func:`origin_of` the scene.
    """
    origin = origin_of(scene) if origin is None else origin
    bounds = _all_bounds(scene)
    if bounds is None:
        return scene
    for line in _too_coarse(scene, origin, np.max(bounds[1] - bounds[0], axis=1) / 2.0):
        warnings.warn(line, stacklevel=3)
    return _moved(scene, -origin) if origin.any() else scene


def origin_of(scene: Scene) -> Vector:
    """An origin near the part of the scene that lies near the camera at time zero; zero if that is near it already.

    It is a multiple of a power of two that depends on the sizes in the scene. So a scene gives the same picture at any
    place, and the same bits if its displacement is such a multiple.
    """
    bounds = _all_bounds(scene)
    if bounds is None:
        return np.zeros(3)
    lower, upper = bounds
    eye = _eye(scene)
    return _shift(np.clip(eye, lower.min(axis=0), upper.max(axis=0)), lower, upper, np.max(upper - lower, axis=1) / 2.0)


def _eye(scene: Scene) -> Vector:
    with np.errstate(over="ignore", invalid="ignore"):
        return product(_pose(getattr(scene.camera, "track", None)), scene.camera.to_world)[:3, 3]


def _all_bounds(scene: Scene) -> tuple[Vector, Vector] | None:
    """Lower and upper corners of the boxes of all instances; None if there are none, or if one, or the camera, is not
    at a finite place."""
    with np.errstate(over="ignore", invalid="ignore"):
        bounds = [_bounds(instance) for instance in scene.instances]
    if not bounds or not np.isfinite([*np.reshape(bounds, (-1, 3)), _eye(scene)]).all():
        return None
    lower, upper = (np.array(corners) for corners in zip(*bounds, strict=True))
    return lower, upper


def _shift(seen: Vector, lower: Vector, upper: Vector, half: Vector) -> Vector:
    """The new origin: zero if ``seen`` is near it, otherwise the nearest multiple of a power of two."""
    typical = float(np.quantile(half, 0.5, method="lower"))
    if np.abs(seen).max() <= _NEAR * typical:
        return np.zeros(3)
    whole = float(np.max(upper.max(axis=0) - lower.min(axis=0))) / 2.0
    # slightly more, so that a scene of exactly such a size has the same step at any place
    size = max(1.001 * min(_EXTENTS * whole, _SIZES * typical), float(np.abs(seen).max()) * 2.0**-52)
    step = math.ldexp(1.0, math.frexp(size)[1])
    return step * np.round(seen / step)


def _pose(track: RigidTrack | None) -> Matrix:
    return np.eye(4) if track is None else pose_at(track, 0.0)


def _box(instance: Instance) -> tuple[Vector, Vector]:
    """Centre and half size of an instance's box, in the space of its track."""
    shape = instance.shape
    if isinstance(shape, Mesh):
        lower, upper = (end.astype(np.float64) for end in (shape.vertices.min(axis=0), shape.vertices.max(axis=0)))
    else:
        upper = np.full(3, shape.radius if isinstance(shape, Sphere | Disk) else 1.0)
        lower = -upper
    linear, middle = instance.to_world[:3, :3], (lower + upper) / 2.0
    return product(linear, middle) + instance.to_world[:3, 3], product(np.abs(linear), (upper - lower) / 2.0)


def _bounds(instance: Instance) -> tuple[Vector, Vector]:
    """Lower and upper corner of an instance's box in the world at time zero."""
    pose = _pose(instance.track)
    middle, reach = _box(instance)
    turned, place = pose[:3, :3], pose[:3, 3]
    middle, reach = product(turned, middle) + place, product(np.abs(turned), reach)
    return middle - reach, middle + reach


def _moved(scene: Scene, shift: Vector) -> Scene:
    """The scene, moved by ``shift``."""
    tracks: dict[int, RigidTrack] = {}

    def track_of(track: RigidTrack) -> RigidTrack:
        return tracks.setdefault(id(track), replace(track, translation=track.translation + shift))

    def placed(thing: object) -> dict:
        """The changed fields of an instance or a camera: its track, which is applied last, or else its placement."""
        track = getattr(thing, "track", None)
        if track is not None:
            return {"track": track_of(track)}
        matrix = np.array(thing.to_world, np.float64)  # type: ignore[attr-defined]
        matrix[:3, 3] += shift
        return {"to_world": matrix}

    def lamp(light: Light) -> Light:
        if isinstance(light, SpotLight):
            return replace(light, position=_place(light.position, shift), target=_place(light.target, shift))
        return replace(light, position=_place(light.position, shift)) if isinstance(light, PointLight) else light

    return replace(
        scene,
        camera=replace(scene.camera, **placed(scene.camera)),
        instances=tuple(replace(instance, **placed(instance)) for instance in scene.instances),
        lights=tuple(lamp(light) for light in scene.lights),
    )


def _place(position: tuple[float, float, float], shift: Vector) -> tuple[float, float, float]:
    x, y, z = (np.asarray(position, np.float64) + shift).tolist()
    return x, y, z


def _too_coarse(scene: Scene, shift: Vector, half: Vector) -> list[str]:
    """Warnings about instances that single precision cannot render well, the worst of each kind; empty if there are
    none."""
    lines = []
    distance = np.array([_farthest(instance, shift) for instance in scene.instances])
    ratio = distance / np.maximum(half, 1e-300)
    worst = int(np.argmax(ratio))
    if ratio[worst] > _TOO_FAR:
        lines.append(
            f"instance {scene.instances[worst].name!r} of size {2.0 * half[worst]:.3g} lies {distance[worst]:.3g} from "
            f"what the camera sees at first: its edges are exact to {distance[worst] * 2.0**-24:.2g} only"
        )
    for mesh in {id(i.shape): i.shape for i in scene.instances if isinstance(i.shape, Mesh)}.values():
        size = float(np.ptp(mesh.vertices, axis=0).max()) / 2.0
        step = float(np.abs(mesh.vertices).max()) * float(np.finfo(mesh.vertices.dtype).eps) / 2.0
        if step > _COARSE * size:
            lines.append(f"mesh {mesh.source!r} of size {2.0 * size:.3g} is stored with a precision of only {step:.2g}")
            break
    return lines


def _farthest(instance: Instance, shift: Vector) -> float:
    """Greatest distance of an instance's centre from the kernels' origin along an axis."""
    middle, _ = _box(instance)
    if instance.track is None:
        return float(np.abs(middle - shift).max())
    return float(np.abs(instance.track.translation - shift).max() + np.abs(middle).max())
