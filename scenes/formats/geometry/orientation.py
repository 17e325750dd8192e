"""The orientation of meshes: which side is outside."""

from __future__ import annotations

import numpy as np

from scenes.arithmetic import determinant, product
from scenes.canonical import Cube, Mesh, Shape, Sphere
from scenes.formats.geometry.keeping import kept_with_shape

FLIPPED = np.diag([1.0, 1.0, -1.0, 1.0])
"""Reflection in z, which leaves a sphere unchanged and reverses its texture coordinate ``v``."""


def area_normals(corners: np.ndarray) -> np.ndarray:
    """Vectors ``(n, 3)`` along the outward normals of triangles ``(n, 3, 3)``, of twice their areas in length."""
    return np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])


@kept_with_shape
def turned(mesh: Mesh) -> Mesh:
    """The mesh with its inside out; the same one for a mesh that many shapes share."""
    normals = None if mesh.normals is None else -mesh.normals
    return Mesh(mesh.vertices, mesh.faces[:, ::-1].copy(), normals, mesh.uvs, mesh.source)


@kept_with_shape
def is_closed(shape: Shape) -> bool:
    """Whether a shape is closed, so that the backs of its faces are not visible from outside."""
    if not isinstance(shape, Mesh):
        return isinstance(shape, Sphere | Cube)
    points, corner = np.unique(shape.vertices, axis=0, return_inverse=True)
    faces = corner.reshape(-1)[shape.faces].astype(np.int64)
    edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    there, back = (np.sort(edges[:, step] * len(points) + edges[:, 1 - step]) for step in (0, 1))
    corners = points[faces].astype(np.float64)
    volume = (corners[:, 0] * np.cross(corners[:, 1], corners[:, 2])).sum()
    return bool(volume > 0.0) and np.array_equal(there, back)


def facing_normals(mesh: Mesh) -> Mesh:
    """The mesh with every face counter-clockwise as seen from the side of its normals."""
    if mesh.normals is None:
        return mesh
    corners = mesh.vertices[mesh.faces].astype(np.float64)
    wrong = (area_normals(corners) * mesh.normals[mesh.faces].sum(axis=1)).sum(axis=1) < 0.0
    if not wrong.any():
        return mesh
    faces = np.where(wrong[:, None], mesh.faces[:, [0, 2, 1]], mesh.faces).astype(np.int32)
    return Mesh(mesh.vertices, faces, mesh.normals, mesh.uvs, mesh.source)


def scales_evenly(axes: np.ndarray) -> bool:
    """Whether a matrix ``(3, 3)`` is a rotation or reflection with one scale, within 1e-4 of its square."""
    x, y, z = axes.T.tolist()
    squares, mixed = [_dot(x, x), _dot(y, y), _dot(z, z)], [_dot(x, y), _dot(y, z), _dot(z, x)]
    total = sum(squares)
    return all(abs(square - total / 3.0) <= 1e-4 * total for square in squares) and all(
        abs(part) <= 1e-4 * total for part in mixed
    )


def _dot(a: list[float], b: list[float]) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def upright(mesh: Mesh, matrix: np.ndarray) -> tuple[Mesh, np.ndarray]:
    """A mesh and its transform; if the transform is a reflection, the mesh is reflected instead."""
    return (mesh, matrix) if determinant(matrix) > 0.0 else (_reflected(mesh), product(matrix, FLIPPED))


@kept_with_shape
def _reflected(mesh: Mesh) -> Mesh:
    away = np.array([1.0, 1.0, -1.0], np.float32)
    normals = None if mesh.normals is None else mesh.normals * away
    return Mesh(mesh.vertices * away, mesh.faces[:, ::-1].copy(), normals, mesh.uvs, mesh.source)
