"""The transforms of PBRT and LuxRender files: matrices, named coordinate systems, and the keys of a motion."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from scenes.animation import continuous_quaternions, pose_at
from scenes.arithmetic import determinant, inverse, norm, product, products, rotation_about, rotation_between
from scenes.canonical.values import Matrix, RigidTrack
from scenes.formats.losses import LossReport

KEYS_MAX = 1024
"""Maximum number of keys of a motion."""

_RIGID = 1e-4


def translation(x: float, y: float, z: float) -> Matrix:
    """A translation."""
    matrix = np.eye(4)
    matrix[:3, 3] = x, y, z
    return matrix


def scaling(x: float, y: float, z: float) -> Matrix:
    """A scaling along the axes."""
    return np.diag([x, y, z, 1.0])


def rotation(angle_deg: float, x: float, y: float, z: float) -> Matrix:
    """A rotation about an axis, counter-clockwise seen from its tip; the identity for a zero axis."""
    return _rotation(angle_deg, x, y, z).copy()


@lru_cache(maxsize=4096)
def _rotation(angle_deg: float, x: float, y: float, z: float) -> Matrix:
    axis = np.array([x, y, z])
    length = norm(axis)
    matrix = np.eye(4)
    if length > 0.0:
        matrix[:3, :3] = rotation_about(axis / length, np.radians(angle_deg)).as_matrix()
    return matrix


def invertible(matrix: Matrix) -> bool:
    """Whether a transform is finite and invertible."""
    size = max(map(abs, matrix[:3, :3].ravel().tolist()))
    finite = all(map(math.isfinite, matrix.ravel().tolist()))
    return finite and abs(determinant(matrix)) > 1e-30 * size * size * size > 0.0


def looking(
    eye: NDArray[np.float64], target: NDArray[np.float64], up: NDArray[np.float64], left_handed: bool
) -> Matrix | None:
    """The camera-to-world transform of a camera that looks along +z with y up; None if the upward direction is parallel
    to the line of sight.

    Its x axis points to the right in a left-handed world (PBRT; in Mitsuba's terms, to the left in a right-handed one),
    or to the right in a right-handed world (LuxRender).
    """
    forward = target - eye
    side = np.cross(up, forward) if left_handed else np.cross(forward, up)
    if min(norm(forward), norm(side)) < 1e-12:
        return None
    forward, side = forward / norm(forward), side / norm(side)
    above = np.cross(forward, side) if left_handed else np.cross(side, forward)
    matrix = np.eye(4)
    matrix[:3] = np.stack([side, above, forward, eye], axis=1)
    return matrix


def rigid_motion(keys: Sequence[Matrix], times_s: Sequence[float]) -> RigidTrack | None:
    """The track that, applied outside the first key, passes through all keys; None if the motion is not rigid.

    Keys at non-uniform times are resampled at uniform ones, with the least interval between keys, at most ``KEYS_MAX``.
    """
    gaps = np.diff(times_s)
    if not (gaps > 0.0).all():
        return None
    moved = product(np.stack(keys), inverse(keys[0]))
    turns = moved[:, :3, :3]
    if (
        np.abs(product(turns, turns.transpose(0, 2, 1)) - np.eye(3)).max() > _RIGID
        or (np.linalg.det(turns) < 0.0).any()
    ):
        return None
    shifts, quaternions = moved[:, :3, 3], Rotation.from_matrix(turns).as_quat()
    interval = float(gaps.mean())
    if np.abs(gaps - interval).max() > 1e-6 * interval:
        count = min(int(np.ceil((times_s[-1] - times_s[0]) / gaps.min())) + 1, KEYS_MAX)
        at = np.linspace(times_s[0], times_s[-1], count)
        shifts = np.stack([np.interp(at, times_s, shifts[:, axis]) for axis in range(3)], axis=1)
        first = np.clip(np.searchsorted(times_s, at, "right") - 1, 0, len(times_s) - 2)
        share = (at - np.asarray(times_s)[first]) / gaps[first]
        quaternions = rotation_between(quaternions[first], quaternions[first + 1], share).as_quat()
        interval = float(at[1] - at[0])
    if quaternions[0, 3] < 0.0:
        quaternions = -quaternions
    return RigidTrack(float(times_s[0]), interval, shifts, continuous_quaternions(quaternions))


def _same(keys: Sequence[Matrix]) -> bool:
    return all(key is keys[0] or np.array_equal(keys[0], key) for key in keys[1:])


def motion(keys: Sequence[Matrix], times_s: Sequence[float], where: str, report: LossReport) -> RigidTrack | None:
    """The motion through keys, applied outside the first of them, or None without motion; a motion that is not rigid is
    reported and becomes None."""
    if _same(keys):
        return None
    track = rigid_motion(keys, times_s)
    if track is None:
        report.add(where, "a motion that is not rigid", "its place at the start")
    return track


def track_times(track: RigidTrack) -> list[float]:
    """Times of a track's keys, seconds."""
    return [track.start_s + track.interval_s * key for key in range(len(track.translation))]


def moved_by(matrix: Matrix, track: RigidTrack) -> RigidTrack | None:
    """A motion within a space placed by ``matrix``, as seen from outside; None if it is not rigid there."""
    times_s = track_times(track)
    return rigid_motion([products(matrix, pose_at(track, time_s), inverse(matrix)) for time_s in times_s], times_s)


class TransformStack:
    """The current transform at the keys of a motion, the saved transforms, and the named transforms.

    Matrices are replaced and never changed in place. Keys without motion share one, so that it is computed once.

    Attributes:
        current: one matrix per key.
        active: keys to which transforms apply.
        times_s: times of the keys, seconds.
        named: coordinate systems by name.
    """

    def __init__(self) -> None:
        self.current: list[Matrix] = [np.eye(4)] * 2
        self.active: tuple[bool, ...] = (True, True)
        self.times_s: tuple[float, ...] = (0.0, 1.0)
        self.named: dict[str, list[Matrix]] = {}
        self._saved: list[tuple[list[Matrix], tuple[bool, ...], tuple[float, ...]]] = []

    def push(self) -> None:
        """Saves the state."""
        self._saved.append((self.current, self.active, self.times_s))

    def pop(self) -> bool:
        """Restores the state that was saved last; False if none is saved."""
        if not self._saved:
            return False
        self.current, self.active, self.times_s = self._saved.pop()
        return True

    def replace(self, matrix: Matrix) -> None:
        """Sets the transform, at the active keys."""
        self.current = [matrix if on else old for on, old in zip(self.active, self.current, strict=True)]

    def begin_world(self) -> None:
        """Sets the identity at all keys, which is the space ``world``, and makes all keys active."""
        self.active = (True,) * len(self.current)
        self.replace(np.eye(4))
        self.named["world"] = list(self.current)

    def apply(self, matrix: Matrix) -> None:
        """Applies a transform inside the current one, at the active keys."""
        made = {id(old): product(old, matrix) for old in {id(old): old for old in self.current}.values()}
        self.current = [made[id(old)] if on else old for on, old in zip(self.active, self.current, strict=True)]

    def take(self, name: str) -> None:
        """Sets the transform at all keys to a named one; one with a different count of keys is replaced by its first
        key."""
        found = self.named[name]
        same = len(found) == len(self.current)
        self.current = list(found) if same else [found[0]] * len(self.current)

    def retime(self, times_s: Sequence[float]) -> None:
        """Sets new key times, all with the transform of the first key."""
        self.current = [self.current[0]] * len(times_s)
        self.active, self.times_s = (True,) * len(times_s), tuple(times_s)

    @property
    def moves(self) -> bool:
        """Whether the keys differ."""
        return not _same(self.current)
