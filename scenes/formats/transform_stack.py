"""The transforms of PBRT and LuxRender files: matrices, named coordinate systems, and the two ends of a motion."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from scenes.values import Matrix, RigidTrack

_RIGID = 1e-4


def inverse(matrix: Matrix) -> Matrix:
    """The transform back."""
    return np.asarray(np.linalg.inv(matrix), np.float64)


def translation(x: float, y: float, z: float) -> Matrix:
    """A shift."""
    matrix = np.eye(4)
    matrix[:3, 3] = x, y, z
    return matrix


def scaling(x: float, y: float, z: float) -> Matrix:
    """A change of size along the axes."""
    return np.diag([x, y, z, 1.0])


def rotation(angle_deg: float, x: float, y: float, z: float) -> Matrix:
    """A turn about an axis, counter-clockwise seen from its tip; identity for an axis of no length."""
    axis = np.array([x, y, z])
    length = np.linalg.norm(axis)
    matrix = np.eye(4)
    if length > 0.0:
        matrix[:3, :3] = Rotation.from_rotvec(np.radians(angle_deg) * axis / length).as_matrix()
    return matrix


def look_at(
    eye: NDArray[np.float64], target: NDArray[np.float64], up: NDArray[np.float64], left_handed: bool
) -> Matrix | None:
    """World to camera, which looks along +z with y up; x is to the right of the picture in PBRT's left-handed sense, or
    of a right-handed world (LuxRender). None where the three points are on one line.
    """
    forward = target - eye
    right = np.cross(up, forward) if left_handed else np.cross(forward, up)
    if min(np.linalg.norm(forward), np.linalg.norm(right)) < 1e-12:
        return None
    forward, right = forward / np.linalg.norm(forward), right / np.linalg.norm(right)
    above = np.cross(forward, right) if left_handed else np.cross(right, forward)
    matrix = np.eye(4)
    matrix[:3] = np.stack([right, above, forward, eye], axis=1)
    return inverse(matrix)


def rigid_motion(start: Matrix, end: Matrix, times_s: tuple[float, float]) -> RigidTrack | None:
    """The track that, applied outside ``start``, leads to ``end``; None where it is not a rigid motion."""
    moved = end @ np.linalg.inv(start)
    turn = moved[:3, :3]
    if np.abs(turn @ turn.T - np.eye(3)).max() > _RIGID or np.linalg.det(turn) < 0.0 or not times_s[1] > times_s[0]:
        return None
    quaternion = Rotation.from_matrix(turn).as_quat()
    if quaternion[3] < 0.0:
        quaternion = -quaternion
    rotations = np.stack([[0.0, 0.0, 0.0, 1.0], quaternion])
    return RigidTrack(times_s[0], times_s[1] - times_s[0], np.stack([np.zeros(3), moved[:3, 3]]), rotations)


class TransformStack:
    """The current transform at both ends of a motion, those saved, and those with names."""

    def __init__(self) -> None:
        self.current = [np.eye(4), np.eye(4)]
        self.active = (True, True)
        self.named: dict[str, list[Matrix]] = {}
        self._saved: list[tuple[list[Matrix], tuple[bool, bool]]] = []

    def push(self) -> None:
        """Saves the state."""
        self._saved.append(([matrix.copy() for matrix in self.current], self.active))

    def pop(self) -> bool:
        """Restores it; False where none is saved."""
        if not self._saved:
            return False
        self.current, self.active = self._saved.pop()
        return True

    def replace(self, matrix: Matrix) -> None:
        """Sets the transform, at the active ends."""
        self.current = [matrix.copy() if on else old for on, old in zip(self.active, self.current, strict=True)]

    def apply(self, matrix: Matrix) -> None:
        """Applies a transform inside the current one, at the active ends."""
        self.current = [old @ matrix if on else old for on, old in zip(self.active, self.current, strict=True)]

    @property
    def moves(self) -> bool:
        """Whether the two ends differ."""
        return not np.array_equal(self.current[0], self.current[1])
