"""Inline meshes that are one of the canonical shapes under a transform, and those shapes as meshes."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from scenes.canonical import Cube, Disk, Mesh, Rectangle, Shape, Sphere
from scenes.formats.revolution import partial_sphere, ring
from scenes.values import Matrix

_CLOSE = 1e-4  # of a side; files print six digits

_SQUARE = np.array([[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [1.0, 1.0, 0.0], [-1.0, 1.0, 0.0]])
_SQUARE_UV = 0.5 * _SQUARE[:, :2] + 0.5


def recognised_rectangle(mesh: Mesh) -> Matrix | None:
    """The transform that makes a rectangle of a mesh of four corners and two triangles, None where it is none.

    Its texture coordinates, where it has any, must be those of the rectangle in some turn, and its normals even.
    """
    if mesh.vertices.shape[0] != 4 or mesh.faces.shape[0] != 2:
        return None
    order = _quad(mesh)
    if order is None:
        return None
    corners = mesh.vertices[order].astype(np.float64)
    if mesh.uvs is not None:
        uvs = mesh.uvs[order]
        starts = [turn for turn in range(4) if np.abs(np.roll(uvs, -turn, axis=0) - _SQUARE_UV).max() < _CLOSE]
        if not starts:
            return None
        corners = np.roll(corners, -starts[0], axis=0)
    right, up = 0.5 * (corners[1] - corners[0]), 0.5 * (corners[3] - corners[0])
    center = corners.mean(axis=0)
    side = float(max(np.linalg.norm(right), np.linalg.norm(up)))
    if np.linalg.norm(corners[2] - (center + right + up)) > _CLOSE * side:
        return None
    normal = np.cross(right, up)
    if np.linalg.norm(normal) < 1e-12 * max(side, 1e-30) ** 2:
        return None
    normal /= np.linalg.norm(normal)
    if mesh.normals is not None and (mesh.normals @ normal < 1.0 - 1e-3).any():
        return None
    matrix = np.eye(4)
    matrix[:3] = np.stack([right, up, normal, center], axis=1)
    return matrix


def _quad(mesh: Mesh) -> np.ndarray | None:
    """The four corners in order round the quadrilateral that two triangles make, None where they make none."""
    first, second = (list(face) for face in mesh.faces.tolist())
    shared = [corner for corner in first if corner in second]
    if len(shared) != 2 or len(set(first) | set(second)) != 4:
        return None
    alone = next(corner for corner in first if corner not in shared)
    other = next(corner for corner in second if corner not in shared)
    at = first.index(alone)
    before, after = first[(at + 2) % 3], first[(at + 1) % 3]
    turned = second.index(other)
    if [second[(turned + 1) % 3], second[(turned + 2) % 3]] != [before, after]:
        return None  # the triangles face opposite ways
    return np.array([alone, after, other, before])


def as_mesh(shape: Shape) -> Mesh:
    """A shape as triangles: exact for rectangle and cube, fine for sphere and disk."""
    return shape if isinstance(shape, Mesh) else _meshed(shape)


@lru_cache(maxsize=256)
def _meshed(shape: Rectangle | Cube | Disk | Sphere) -> Mesh:
    """Once for all shapes of a size, so that it is written once."""
    if isinstance(shape, Rectangle):
        faces = np.array([[0, 1, 2], [0, 2, 3]], np.int32)
        normals = np.tile(np.array([0.0, 0.0, 1.0], np.float32), (4, 1))
        return Mesh(_SQUARE.astype(np.float32), faces, normals, _SQUARE_UV.astype(np.float32), "rectangle")
    if isinstance(shape, Cube):
        return _cube()
    if isinstance(shape, Disk):
        return ring(shape.radius, 0.0, 0.0)
    assert isinstance(shape, Sphere)
    return partial_sphere(shape.radius, -shape.radius, shape.radius)


def _cube() -> Mesh:
    vertices: list[np.ndarray] = []
    normals: list[np.ndarray] = []
    uvs: list[np.ndarray] = []
    faces: list[list[int]] = []
    for axis in range(3):
        for sign in (-1.0, 1.0):
            normal = sign * np.eye(3)[axis]
            right = np.eye(3)[(axis + 1) % 3]
            up = np.cross(normal, right)
            start = len(vertices)
            for x, y in _SQUARE[:, :2].tolist():
                vertices.append(normal + x * right + y * up)
                normals.append(normal)
            uvs.extend(_SQUARE_UV)
            faces += [[start, start + 1, start + 2], [start, start + 2, start + 3]]
    arrays = (np.array(part, np.float32) for part in (vertices, normals, uvs))
    points, across, texture = arrays
    return Mesh(points, np.array(faces, np.int32), across, texture, "cube")
