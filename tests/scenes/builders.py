"""Geometry that the tests of the scenes measure with: plain versions, apart from the code they test."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from scenes.animation import pose_at
from scenes.canonical import Instance, Matrix, Mesh, PerspectiveCamera, RigidTrack, Scene
from scenes.driving.meshing import SurfaceMesh

Array = NDArray[np.float64]


def corners(shape: SurfaceMesh | Mesh) -> tuple[Array, Array, Array]:
    """The three corners ``(f, 3)`` of every triangle."""
    points = shape.vertices.astype(np.float64)[shape.faces]
    return points[:, 0], points[:, 1], points[:, 2]


def face_normals(shape: SurfaceMesh | Mesh) -> Array:
    """Normals ``(f, 3)``, as long as twice the area."""
    a, b, c = corners(shape)
    return np.cross(b - a, c - a)


def areas(shape: SurfaceMesh | Mesh) -> Array:
    return 0.5 * np.linalg.norm(face_normals(shape), axis=1)


def volume(shape: SurfaceMesh | Mesh) -> float:
    """Of a closed shape; positive where its faces look outwards."""
    a, b, c = corners(shape)
    return float(np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6.0)


def directed_edges(shape: SurfaceMesh | Mesh, weld: float = 1e-7) -> list[tuple[tuple[int, ...], tuple[int, ...]]]:
    """Edges between places, in their triangles' direction; triangles that welding flattens are left out."""
    places = np.round(shape.vertices.astype(np.float64) / weld).astype(np.int64)
    found = []
    for a, b, c in places[shape.faces].tolist():
        if a != b and b != c and c != a:
            found += [(tuple(a), tuple(b)), (tuple(b), tuple(c)), (tuple(c), tuple(a))]
    return found


def open_edges(shape: SurfaceMesh | Mesh, weld: float = 1e-7) -> set[tuple[tuple[int, ...], tuple[int, ...]]]:
    """Edges whose reverse belongs to no triangle; none in a closed shape whose faces all look the same way."""
    edges = set(directed_edges(shape, weld))
    return {(a, b) for a, b in edges if (b, a) not in edges}


def moving(scene: Scene, name: str) -> Instance:
    """The instance of a name."""
    return next(instance for instance in scene.instances if instance.name == name)


def pose(track: RigidTrack | None, time_s: float) -> Matrix:
    return np.eye(4) if track is None else pose_at(track, time_s)


def placed(matrix: Matrix, points: Array) -> Array:
    return points @ matrix[:3, :3].T + matrix[:3, 3]


def project(camera: PerspectiveCamera, time_s: float, points: Array) -> tuple[Array, Array]:
    """Where points ``(n, 3)`` lie in a square picture, ``(0, 0)`` at the top left, and how far ahead they are."""
    to_camera = np.linalg.inv(pose(camera.track, time_s) @ camera.to_world)
    local = placed(to_camera, points)
    ahead = -local[:, 2]
    scale = 0.5 / np.tan(0.5 * np.radians(camera.fov_deg))
    return np.stack([0.5 + scale * local[:, 0] / ahead, 0.5 - scale * local[:, 1] / ahead], axis=-1), ahead
