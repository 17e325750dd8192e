"""Normals of mesh files for Mitsuba, which computes those that are missing, and the sides of meshes, where they are.

Source: Mitsuba 0.5 source, ``TriMesh::computeNormals``; Thürmer and Wüthrich 1998, "Computing vertex normals from
polygonal facets". Checked by pictures of Mitsuba 3.9.
"""

from __future__ import annotations

import numpy as np

from scenes.arithmetic import arccos, determinant, product
from scenes.canonical import Mesh
from scenes.formats.geometry.orientation import area_normals, facing_normals, scales_evenly


def placed_key(mesh: Mesh, place: np.ndarray, faceted: bool) -> bytes:
    """What of a transform the mesh depends on that :func:`placed_normals` makes for it."""
    if mesh.normals is not None and not faceted:
        return b""
    mirrored = determinant(place) < 0.0
    even = faceted or scales_evenly(place[:3, :3])
    return bytes([mirrored]) if even else place[:3, :3].tobytes()


def placed_normals(mesh: Mesh, place: np.ndarray, faceted: bool) -> Mesh:
    """A mesh whose sides and normals are those that Mitsuba gives it after it has placed its vertices.

    Normals of the file stay with the surface. Without them, or with ``faceted``, the outside is where the placed
    triangles are counter-clockwise, so that a reflection turns the mesh inside out.

    Args:
        mesh: a mesh as its file has it.
        place: ``(4, 4)`` object to world.
        faceted: whether its faces are flat; otherwise a mesh without normals gets smooth ones.
    """
    if mesh.normals is not None and not faceted:
        return facing_normals(mesh)
    if faceted:
        faces = mesh.faces[:, ::-1].copy() if determinant(place) < 0.0 else mesh.faces
        return Mesh(mesh.vertices, faces, None, mesh.uvs, mesh.source)
    linear = place[:3, :3]
    normals = product(_smooth(product(mesh.vertices.astype(np.float64), linear.T), mesh.faces), linear)
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    normals = np.where(length > 0.0, normals / np.where(length > 0.0, length, 1.0), (0.0, 0.0, 1.0))
    return facing_normals(Mesh(mesh.vertices, mesh.faces, normals.astype(np.float32), mesh.uvs, mesh.source))


def _smooth(points: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Vectors ``(v, 3)`` along the normals at vertices: those of the faces, weighted by their angles there."""
    corners = points[faces]
    areas = area_normals(corners)
    length = np.linalg.norm(areas, axis=1, keepdims=True)
    unit = areas / np.where(length > 0.0, length, 1.0)
    ahead, behind = np.roll(corners, -1, axis=1) - corners, np.roll(corners, 1, axis=1) - corners
    sizes = np.linalg.norm(ahead, axis=2) * np.linalg.norm(behind, axis=2)
    cosines = (ahead * behind).sum(axis=2) / np.where(sizes > 0.0, sizes, 1.0)
    angles = np.where(sizes > 0.0, arccos(np.clip(cosines, -1.0, 1.0)), 0.0)
    weighted, at = (angles[..., None] * unit[:, None]).reshape(-1, 3), faces.reshape(-1)
    return np.stack([np.bincount(at, weighted[:, axis], len(points)) for axis in range(3)], axis=1)
