"""Meshes of numbers from untrusted files."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from scenes.canonical import Mesh, SceneError
from scenes.canonical.values import vertices_of


def checked_mesh(points: NDArray, faces: NDArray, normals: NDArray | None, uvs: NDArray | None, name: str) -> Mesh:
    """A mesh of numbers from a file.

    Raises:
        SceneError: a number is not finite or too great, an index is invalid, or there is no face.
    """
    check_numbers(points, faces, normals, uvs, name)
    unit = None
    if normals is not None:
        lengths = np.linalg.norm(normals, axis=1, keepdims=True)
        unit = np.where(lengths > 1e-20, normals / np.maximum(lengths, 1e-20), (0.0, 0.0, 1.0)).astype(np.float32)
    return Mesh(
        vertices_of(points),
        faces.astype(np.int32).reshape(-1, 3),
        unit,
        None if uvs is None else uvs.astype(np.float32),
        name,
    )


def check_numbers(points: NDArray, faces: NDArray, normals: NDArray | None, uvs: NDArray | None, name: str) -> None:
    """Raises SceneError if a number is not finite or too great, or an index is invalid."""
    for what, array in (("vertices", points), ("normals", normals), ("texture coordinates", uvs)):
        if array is not None and not (np.abs(array) < 1e30).all():
            raise SceneError(f"{name}: expected finite {what}")
    wrong = ~((faces >= 0) & (faces < len(points)))
    if wrong.any():
        raise SceneError(f"{name}: expected indices from 0 to {len(points) - 1}, got {faces[wrong][0]:.15g}")
