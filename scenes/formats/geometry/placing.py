"""Shared functions of the writers: shapes that are written once and placed several times, and the keys of motions."""

from __future__ import annotations

from collections import Counter

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from scenes.animation import look_at, pose_at
from scenes.arithmetic import product
from scenes.canonical import Curves, Emissive, Instance, Medium, Mesh, Scene
from scenes.canonical.values import Matrix, Rgb, RigidTrack
from scenes.formats.geometry.orientation import is_closed
from scenes.formats.geometry.transform_stack import track_times
from scenes.formats.losses import LossReport

PartKey = tuple[int, int, bool, Medium | None, Medium | None]


def part_key(instance: Instance) -> PartKey:
    """A key that is equal for instances of the same shape and material with equal sidedness and media."""
    parts = id(instance.shape), id(instance.material)
    return *parts, instance.one_sided, instance.interior, instance.exterior


def shared_parts(scene: Scene, curves: bool = True) -> frozenset[PartKey]:
    """Meshes, and curves if asked for, that several instances use and that do not emit; lamps cannot be instances of
    objects."""
    kinds = Mesh | Curves if curves else Mesh
    counts = Counter(part_key(one) for one in scene.instances if isinstance(one.shape, kinds) and not shines(one))
    return frozenset(key for key, count in counts.items() if count > 1)


def lose_back(instance: Instance, report: LossReport) -> None:
    """Reports a black back if it is visible; that of a closed shape is not."""
    if instance.one_sided and not is_closed(instance.shape):
        report.add(instance.name or "shape", "a surface with a black back", "the same on both sides")


def has_two_sides(instance: Instance) -> bool:
    """Whether the back of a shape is as its front."""
    return not instance.one_sided and (instance.emission is None or instance.emission_twosided)


def lose_undrawn_back(instance: Instance, name: str, report: LossReport) -> None:
    """For formats whose shapes have one side or two equal ones: reports a back that is not drawn."""
    if has_two_sides(instance):
        return
    if not is_closed(instance.shape):
        what = "a surface with a black back" if instance.emission is None else "the back of a lamp"
        report.add(name, what, "not drawn from behind")
    if instance.one_sided:
        lose_shine_behind(instance, report)


def shines(instance: Instance) -> bool:
    """Whether a shape is a lamp."""
    return instance.emission is not None or isinstance(instance.material, Emissive)


def shines_behind(instance: Instance) -> bool:
    """Whether the back of a shape emits light that is visible; that of a closed shape is not."""
    both = isinstance(instance.material, Emissive) or (instance.emission is not None and instance.emission_twosided)
    return both and not is_closed(instance.shape)


def lose_shine_behind(instance: Instance, report: LossReport) -> None:
    """Reports light of the back."""
    if shines_behind(instance):
        report.add(instance.name or "shape", "a surface that shines on both sides", "on its front")


def borders_media(instance: Instance) -> bool:
    """Whether a shape is the border of a medium."""
    return instance.interior is not None or instance.exterior is not None


def has_outside(instance: Instance) -> bool:
    """Whether a shape looks different if it is turned inside out: a lamp, or the border of a medium."""
    return shines(instance) or borders_media(instance)


def radiance_of(instance: Instance) -> Rgb | None:
    """Radiance of the front of a lamp, or None for other shapes."""
    return instance.material.radiance if isinstance(instance.material, Emissive) else instance.emission


def motion_keys(track: RigidTrack | None, to_world: Matrix) -> tuple[list[Matrix], list[float]]:
    """Poses at the keys of a motion and their times, seconds; one pose at time zero without motion."""
    if track is None or len(track.translation) == 1:
        return [placed(track, to_world)], [0.0]
    times_s = track_times(track)
    return [product(pose_at(track, time_s), to_world) for time_s in times_s], times_s


def keys_from_zero(track: RigidTrack, report: LossReport) -> tuple[list[float], NDArray, NDArray]:
    """Keys of a motion for formats whose times begin at zero; earlier ones are a loss.

    Returns:
        Times, seconds; translations ``(keys, 3)`` in scene units; and rotations, quaternions ``(keys, 4)`` as
        ``(x, y, z, w)``.
    """
    times_s = track_times(track)
    if times_s[0] < 0.0:
        report.add("motion", "motion before the time zero")
        times_s = [0.0, *(time_s for time_s in times_s if time_s > 0.0)]
    poses = np.stack([pose_at(track, time_s) for time_s in times_s])
    return times_s, poses[:, :3, 3], Rotation.from_matrix(poses[:, :3, :3]).as_quat()


def placed(track: RigidTrack | None, to_world: Matrix) -> Matrix:
    """The transform at the first key of a motion."""
    return to_world if track is None else product(pose_at(track, track.start_s), to_world)


def tracks_of(scene: Scene) -> list[RigidTrack]:
    """All motions of a scene, beginning with the camera's."""
    found = [getattr(scene.camera, "track", None), *(one.track for one in scene.instances)]
    return [track for track in found if track is not None and len(track.translation) > 1]


def facing(position: NDArray[np.float64], direction: NDArray[np.float64]) -> Matrix:
    """The transform that has -z in a direction."""
    place = np.eye(4)
    place[:3, :3] = look_at(np.zeros(3), direction).as_matrix()
    place[:3, 3] = position
    return place
