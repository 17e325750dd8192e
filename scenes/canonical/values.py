"""Common types of all parts of a scene: colours, transforms, rigid motion, and the error for invalid descriptions."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Rgb = tuple[float, float, float]
Matrix = NDArray[np.float64]

_SPANS_AWAY = 128.0  # distance beyond which float32 resolves less than a 60,000th of a mesh


def identity() -> Matrix:
    """The ``(4, 4)`` identity transform."""
    return np.eye(4)


class SceneError(ValueError):
    """A scene description that cannot be used; the message gives the expected value, the actual one, and the place."""


@dataclass(frozen=True, eq=False)
class RigidTrack:
    """A rigid motion sampled at uniform key times; between keys, translation is interpolated linearly and rotation
    spherically.

    Before the first and after the last key the pose is held.

    Attributes:
        start_s: time of the first key, seconds.
        interval_s: time between keys, seconds, positive.
        translation: ``(keys, 3)`` float64, scene units.
        rotation: ``(keys, 4)`` float64 unit quaternions ``(x, y, z, w)``; neighbouring keys are less than half a turn
            apart and have the same sign (non-negative dot product).
    """

    start_s: float
    interval_s: float
    translation: NDArray[np.float64]
    rotation: NDArray[np.float64]

    def __post_init__(self) -> None:
        t, q = self.translation, self.rotation
        if not self.interval_s > 0.0:
            raise SceneError(f"RigidTrack.interval_s: expected a positive time, got {self.interval_s}")
        if t.ndim != 2 or t.shape[1] != 3 or q.shape != (t.shape[0], 4) or t.shape[0] < 1:
            raise SceneError(f"RigidTrack: expected translation (k, 3), rotation (k, 4), got {t.shape} and {q.shape}")
        if not (np.isfinite(t).all() and np.isfinite(q).all()):
            raise SceneError("RigidTrack: keys hold non-finite values")
        if not np.allclose(np.linalg.norm(q, axis=1), 1.0, atol=1e-6):
            raise SceneError("RigidTrack.rotation: expected unit quaternions")
        if ((q[1:] * q[:-1]).sum(axis=1) < 0.0).any():
            raise SceneError("RigidTrack.rotation: neighbouring keys must have the same sign")


def vertices_of(points: NDArray[np.floating]) -> NDArray[np.floating]:
    """Vertices ``(v, 3)`` in float32, or in float64 if they are so far from the origin that float32 would distort their
    shape."""
    span = np.ptp(points, axis=0).max(initial=0.0)
    far = len(points) > 0 and np.abs(points).max() > _SPANS_AWAY * span
    return np.asarray(points, np.float64 if far and points.dtype.itemsize > 4 else np.float32)
