"""The canonical shapes as meshes."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from scenes.canonical import Cube, Disk, Mesh, Rectangle, Shape, Sphere
from scenes.formats.revolution import partial_sphere, ring

SQUARE = np.array([[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [1.0, 1.0, 0.0], [-1.0, 1.0, 0.0]])
SQUARE_UV = 0.5 * SQUARE[:, :2] + 0.5


def as_mesh(shape: Shape) -> Mesh:
    """A shape as triangles: exact for rectangle and cube, fine for sphere and disk."""
    return shape if isinstance(shape, Mesh) else _meshed(shape)


@lru_cache(maxsize=256)
def _meshed(shape: Rectangle | Cube | Disk | Sphere) -> Mesh:
    """Once for all shapes of a size, so that it is written once."""
    if isinstance(shape, Rectangle):
        faces = np.array([[0, 1, 2], [0, 2, 3]], np.int32)
        normals = np.tile(np.array([0.0, 0.0, 1.0], np.float32), (4, 1))
        return Mesh(SQUARE.astype(np.float32), faces, normals, SQUARE_UV.astype(np.float32), "rectangle")
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
            for x, y in SQUARE[:, :2].tolist():
                vertices.append(normal + x * right + y * up)
                normals.append(normal)
            uvs.extend(SQUARE_UV)
            faces += [[start, start + 1, start + 2], [start, start + 2, start + 3]]
    arrays = (np.array(part, np.float32) for part in (vertices, normals, uvs))
    points, across, texture = arrays
    return Mesh(points, np.array(faces, np.int32), across, texture, "cube")
