"""Transforms that blocks describe."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from scenes.arithmetic import norm, rotation_about
from scenes.canonical import Matrix, SceneError
from scenes.formats.blocks.text import Block


def transform(block: Block) -> Matrix:
    """The transform of a block: scale, then rotations about x, y and z in degrees, then location."""
    matrix = np.eye(4)
    angles = np.radians(block.get("rotation", (0.0, 0.0, 0.0)))
    x, y, z = (rotation_about(axis, angle) for axis, angle in zip(np.eye(3), angles, strict=True))
    turn = (z * y * x).as_matrix()
    matrix[:3, :3] = turn * np.broadcast_to(np.asarray(block.get("scale", 1.0), np.float64), 3)
    matrix[:3, 3] = block.get("location", (0.0, 0.0, 0.0))
    return matrix


def aimed(eye: NDArray[np.float64], target: NDArray[np.float64], up: NDArray[np.float64], block: Block) -> Rotation:
    """Orientations of a camera that looks along ``-z``, one for each row of the arguments."""
    back = eye - target
    right = np.cross(up, back)
    size = np.linalg.norm(right, axis=1, keepdims=True)
    if (size < 1e-9 * np.linalg.norm(back, axis=1, keepdims=True) * np.linalg.norm(up, axis=1, keepdims=True)).any():
        raise SceneError(f"{block.where}: camera: expected a direction of view that is not along up, nor zero")
    right, back = right / size, back / np.linalg.norm(back, axis=1, keepdims=True)
    return Rotation.from_matrix(np.stack([right, np.cross(back, right), back], axis=-1))


def facing(block: Block, place: NDArray[np.float64], target: NDArray[np.float64]) -> Matrix:
    """The transform of a rectangle whose outside faces a target."""
    aim = target - place
    if not aim.any():
        raise SceneError(f"{block.where}: light.target: expected a point other than its location, got {tuple(target)}")
    helper = np.array([0.0, 1.0, 0.0]) if abs(aim[1]) < 0.9 * norm(aim) else np.array([1.0, 0.0, 0.0])
    normal = aim / norm(aim)
    across = np.cross(helper, normal)
    across /= norm(across)
    matrix = np.eye(4)
    matrix[:3, :3] = np.stack([across, np.cross(normal, across), normal], axis=1)
    matrix[:3, 3] = place
    return matrix
