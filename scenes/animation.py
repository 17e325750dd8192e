"""Rigid tracks from functions of time, and their evaluation on the host.

A pose function maps times ``(n,)`` in seconds to translations ``(n, 3)`` and a scipy rotation of length ``n``;
:func:`sample_track` turns it into the uniform keys of a :class:`scenes.canonical.RigidTrack`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from scenes.arithmetic import cos, rotation_about, rotation_between, sin
from scenes.canonical import Matrix, RigidTrack, SceneError

Times = NDArray[np.floating]
Pose = tuple[NDArray[np.float64], Rotation]
PoseFunction = Callable[[Times], Pose]

UP = np.array([0.0, 0.0, 1.0])

LEAD_S = 3.0
"""Motion before the first moment and after the last, seconds: warm-up, latency and filters reach there."""

_VERTICAL = 1e-9  # sine of the angle to the vertical below which the vertical does not determine the right of a picture


def continuous_quaternions(quaternions: NDArray[np.float64]) -> NDArray[np.float64]:
    """Flips signs so that neighbours have a non-negative dot product.

    Args:
        quaternions: ``(n, 4)`` unit quaternions ``(x, y, z, w)``.

    Returns:
        ``(n, 4)``, the same rotations; the first keeps its sign.
    """
    dots = (quaternions[1:] * quaternions[:-1]).sum(axis=1)
    signs = np.concatenate([[1.0], np.cumprod(np.where(dots < 0.0, -1.0, 1.0))])
    return quaternions * signs[:, None]


def sample_track(pose: PoseFunction, start_s: float, end_s: float, interval_s: float) -> RigidTrack:
    """Keys of a pose function at uniform times.

    Args:
        pose: the motion; defined on the whole interval.
        start_s: time of the first key, seconds.
        end_s: the last key lies at or after this time, seconds.
        interval_s: time between keys, seconds. A rotation must be less than half a turn per interval, and much less for
            smooth arcs.
    """
    count = int(np.ceil((end_s - start_s) / interval_s - 1e-9)) + 1
    translation, rotation = pose(start_s + interval_s * np.arange(count))
    return RigidTrack(start_s, interval_s, translation, continuous_quaternions(rotation.as_quat()))


def pose_at(track: RigidTrack, time_s: float) -> Matrix:
    """Pose of a track at one time: the plain version against which faster ones are tested.

    Args:
        track: track, whose pose is held before the first key and after the last.
        time_s: time, seconds.

    Returns:
        ``(4, 4)`` float64 rigid transform.
    """
    last = len(track.translation) - 1
    key = float(np.clip((time_s - track.start_s) / track.interval_s, 0.0, last))
    matrix = np.eye(4)
    if last == 0:
        matrix[:3, :3] = Rotation.from_quat(track.rotation[0]).as_matrix()
        matrix[:3, 3] = track.translation[0]
        return matrix
    first = min(int(key), last - 1)
    matrix[:3, :3] = rotation_between(track.rotation[first], track.rotation[first + 1], key - first).as_matrix()
    matrix[:3, 3] = track.translation[first] + (key - first) * (track.translation[first + 1] - track.translation[first])
    return matrix


def look_at(eye: NDArray[np.float64], target: NDArray[np.float64], roll_rad: float = 0.0) -> Rotation:
    """Orientation of a camera (looking along its ``-z``, ``+y`` up) at ``eye`` that sees ``target`` in the centre.

    For a camera that looks straight up or down, the right of the picture is the world's ``+x``, as for a camera
    slightly closer to ``-y``.

    Args:
        eye, target: ``(3,)`` or ``(n, 3)``, scene units.
        roll_rad: rotation about the viewing axis, radians.

    Raises:
        SceneError: both are the same point, or not finite.
    """
    back = np.asarray(eye, np.float64) - np.asarray(target, np.float64)
    length = np.linalg.norm(back, axis=-1, keepdims=True)
    if not (np.isfinite(length) & (length > 0.0)).all():
        raise SceneError(f"look_at: expected finite points that differ, got eye {eye} and target {target}")
    back = back / length
    right = np.cross(UP, back)
    size = np.linalg.norm(right, axis=-1, keepdims=True)
    right = np.where(size > _VERTICAL, right / np.maximum(size, _VERTICAL), (1.0, 0.0, 0.0))
    rotation = Rotation.from_matrix(np.stack([right, np.cross(back, right), back], axis=-1))
    return rotation * rotation_about(UP, roll_rad) if roll_rad else rotation


def camera_to_world(eye: NDArray[np.float64], target: NDArray[np.float64], roll_rad: float = 0.0) -> Matrix:
    """Camera-to-world transform ``(4, 4)`` of a fixed camera at ``eye`` that sees ``target`` in the centre."""
    matrix = np.eye(4)
    matrix[:3, :3] = look_at(eye, target, roll_rad).as_matrix()
    matrix[:3, 3] = eye
    return matrix


def attached(parent: PoseFunction, offset: NDArray[np.float64], turn: Callable[[Times], Rotation]) -> PoseFunction:
    """Motion of a part that rotates about a point fixed to a parent.

    Args:
        parent: motion of the body to which the part belongs.
        offset: ``(3,)`` position of the part's origin in the parent's frame, scene units.
        turn: orientation of the part in the parent's frame at times ``(n,)``.
    """

    def pose(time_s: Times) -> Pose:
        translation, rotation = parent(time_s)
        return translation + rotation.apply(offset), rotation * turn(time_s)

    return pose


@dataclass(frozen=True)
class Path:
    """A plane path at constant speed: straight lines joined by smooth bends.

    Attributes:
        start: ``(x, y)`` at distance zero, scene units.
        heading_rad: direction of travel there, counter-clockwise from ``+x``.
        speed: scene units per second.
        bends: ``(distance, length, turn_rad)`` of each bend: its start, its length, and the change of heading (left
            positive). Curvature rises and falls as ``sin²`` over the bend.
        advance: distance already covered at time zero.
    """

    start: tuple[float, float]
    heading_rad: float
    speed: float
    bends: tuple[tuple[float, float, float], ...] = ()
    advance: float = 0.0

    def distance(self, time_s: Times) -> Times:
        """Distance along the path at times ``(n,)``, scene units; negative before the start."""
        return self.advance + self.speed * np.asarray(time_s, np.float64)

    def heading(self, distance: Times) -> Times:
        """Heading in radians at distances ``(n,)``."""
        heading = np.full(np.shape(distance), self.heading_rad)
        for begin, length, turn in self.bends:
            part = np.clip((distance - begin) / length, 0.0, 1.0)
            heading = heading + turn * (part - sin(2.0 * np.pi * part) / (2.0 * np.pi))
        return heading

    def curvature(self, distance: Times) -> Times:
        """Change of heading per length at distances ``(n,)``, left positive."""
        curvature = np.zeros(np.shape(distance))
        for begin, length, turn in self.bends:
            part = np.clip((distance - begin) / length, 0.0, 1.0)
            curvature = curvature + turn / length * (1.0 - cos(2.0 * np.pi * part))
        return curvature

    def position(self, distance: Times, step: float = 0.02) -> NDArray[np.float64]:
        """Points ``(n, 2)`` at distances ``(n,)``; bends are integrated by the midpoint rule at ``step``."""
        distance = np.asarray(distance, np.float64)
        straight = np.array([cos(self.heading_rad), sin(self.heading_rad)])
        if not self.bends:
            return np.asarray(self.start) + distance[:, None] * straight
        low, high = min(float(distance.min()), 0.0), max(float(distance.max()), 0.0)
        knots = step * np.arange(np.floor(low / step), np.ceil(high / step) + 1)
        heading = self.heading(knots[:-1] + step / 2.0)
        moves = step * np.stack([cos(heading), sin(heading)], axis=-1)
        points = np.concatenate([[[0.0, 0.0]], np.cumsum(moves, axis=0)])
        points = points - points[int(np.argmin(np.abs(knots)))] + np.asarray(self.start)
        return np.stack([np.interp(distance, knots, points[:, axis]) for axis in (0, 1)], axis=-1)

    def pose(self, time_s: Times) -> Pose:
        """Motion of a body with ``+x`` ahead and ``+z`` up, whose origin is on the path at height zero."""
        distance = self.distance(time_s)
        points = self.position(distance)
        return np.concatenate([points, np.zeros((len(points), 1))], axis=1), rotation_about(UP, self.heading(distance))
