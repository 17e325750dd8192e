"""Where the origin of the kernels' space lies: single precision is fine only near it.

Kernels compute in float32, whose steps grow with the distance from the origin: of a room 1e5 of its sizes away they are
a hundredth of it. A scene that lies far away is therefore moved here, in float64, before anything is rounded.
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
"""Typical half sizes from the origin within which a scene stays where it is: half its instances are no larger."""

_EXTENTS, _SIZES = 4.0, 64.0
"""The origin moves in steps of at least so many half sizes of the whole scene, or typical ones, whichever is less."""

_TOO_FAR = 1.0e5
"""Half sizes from the origin beyond which something is drawn too coarsely: at 1e5 a step is 1/170 of it."""

_COARSE = 1.0e-3
"""Step of float32 vertices, in half sizes of their mesh, beyond which the mesh has lost its form."""

Vector = NDArray[np.float64]


def near_origin(scene: Scene) -> Scene:
    """The scene, moved so that what the camera sees at time zero lies near the origin; itself where that is so already.

    The shift is a multiple of a power of two that depends on the sizes in the scene: a scene gives the same picture
    wherever it is, to the bit where its shift is such a multiple too. Warns of what is still too far away.
    """
    with np.errstate(over="ignore", invalid="ignore"):
        bounds = [_bounds(instance) for instance in scene.instances]
        eye = product(_pose(getattr(scene.camera, "track", None)), scene.camera.to_world)
    if not bounds or not np.isfinite([*np.reshape(bounds, (-1, 3)), eye[:3, 3]]).all():
        return scene
    lower, upper = (np.array(corners) for corners in zip(*bounds, strict=True))
    half = np.max(upper - lower, axis=1) / 2.0
    shift = _shift(np.clip(eye[:3, 3], lower.min(axis=0), upper.max(axis=0)), lower, upper, half)
    for line in _too_coarse(scene, shift, half):
        warnings.warn(line, stacklevel=3)
    return _moved(scene, -shift) if shift.any() else scene


def _shift(seen: Vector, lower: Vector, upper: Vector, half: Vector) -> Vector:
    """Where the origin is to be: zero where ``seen`` is near it, or else the nearest multiple of a power of two."""
    typical = float(np.quantile(half, 0.5, method="lower"))
    if np.abs(seen).max() <= _NEAR * typical:
        return np.zeros(3)
    whole = float(np.max(upper.max(axis=0) - lower.min(axis=0))) / 2.0
    # a little more, so that a scene of just such a size has the same step wherever it is
    size = max(1.001 * min(_EXTENTS * whole, _SIZES * typical), float(np.abs(seen).max()) * 2.0**-52)
    step = math.ldexp(1.0, math.frexp(size)[1])
    return step * np.round(seen / step)


def _pose(track: RigidTrack | None) -> Matrix:
    return np.eye(4) if track is None else pose_at(track, 0.0)


def _box(instance: Instance) -> tuple[Vector, Vector]:
    """Middle and half size of an instance's box, in the space of its track."""
    shape = instance.shape
    if isinstance(shape, Mesh):
        lower, upper = (end.astype(np.float64) for end in (shape.vertices.min(axis=0), shape.vertices.max(axis=0)))
    else:
        upper = np.full(3, shape.radius if isinstance(shape, Sphere | Disk) else 1.0)
        lower = -upper
    linear, middle = instance.to_world[:3, :3], (lower + upper) / 2.0
    return product(linear, middle) + instance.to_world[:3, 3], product(np.abs(linear), (upper - lower) / 2.0)


def _bounds(instance: Instance) -> tuple[Vector, Vector]:
    """Of an instance, in the world, at time zero."""
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
        """What changes of an instance or a camera: its motion, which is the outer one, or else its place."""
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
    """A line on what single precision cannot draw well, the worst instance of each kind; empty where all is well."""
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
            lines.append(f"mesh {mesh.source!r} of size {2.0 * size:.3g} is known to {step:.2g} only, as it is stored")
            break
    return lines


def _farthest(instance: Instance, shift: Vector) -> float:
    """Greatest distance of an instance's middle from the kernels' origin, along an axis."""
    middle, _ = _box(instance)
    if instance.track is None:
        return float(np.abs(middle - shift).max())
    return float(np.abs(instance.track.translation - shift).max() + np.abs(middle).max())
