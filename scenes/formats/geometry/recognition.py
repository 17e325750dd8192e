"""Recognition of meshes that are transformed canonical shapes."""

from __future__ import annotations

import dataclasses
from weakref import WeakKeyDictionary

import numpy as np

from scenes.canonical import Cube, Disk, Material, Mesh, Rectangle, Shape, Sphere
from scenes.canonical.values import Matrix
from scenes.formats.geometry.cubes import recognised_cube
from scenes.formats.geometry.meshed import SQUARE_UV, depends_on_uv
from scenes.formats.geometry.round_shapes import recognised_disk, recognised_sphere
from scenes.formats.losses import LossReport

DISK_MIN, SPHERE_MIN = 32, 512
"""Least number of triangles of a mesh that may be a disk, or a sphere; a mesh with fewer is meant to be angular."""

_KNOWN: WeakKeyDictionary[Mesh, dict[bool, tuple[Shape, Matrix] | None]] = WeakKeyDictionary()

_CLOSE = 1e-4  # relative to a side; files print six digits


def recognised_rectangle(mesh: Mesh) -> Matrix | None:
    """The transform from the rectangle to a mesh of four corners and two triangles; None if the mesh is not a
    rectangle.

    Its texture coordinates, if any, must be those of the rectangle up to a rotation, and its normals must be equal.
    """
    if mesh.vertices.shape[0] != 4 or mesh.faces.shape[0] != 2:
        return None
    order = _quad(mesh)
    if order is None:
        return None
    corners = mesh.vertices[order].astype(np.float64)
    if mesh.uvs is not None:
        uvs = mesh.uvs[order]
        starts = [turn for turn in range(4) if np.abs(np.roll(uvs, -turn, axis=0) - SQUARE_UV).max() < _CLOSE]
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
    """The four corners, in order, of the quadrilateral that two triangles form; None if they do not form one."""
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


def recognised(mesh: Mesh) -> tuple[Shape, Matrix] | None:
    """The canonical shape that a mesh represents, and its transform; None if it is none.

    Its texture coordinates and normals, if any, must be those of the shape.
    """
    matrix = recognised_rectangle(mesh)
    if matrix is not None:
        return Rectangle(), matrix
    if len(mesh.faces) == 12:
        matrix = recognised_cube(mesh)
        return None if matrix is None else (Cube(), matrix)
    matrix = recognised_disk(mesh) if len(mesh.faces) >= DISK_MIN else None
    if matrix is not None:
        return Disk(), matrix
    matrix = recognised_sphere(mesh) if len(mesh.faces) >= SPHERE_MIN else None
    if matrix is None:
        return None
    radius = float(np.cbrt(abs(np.linalg.det(matrix[:3, :3]))))
    matrix[:3, :3] /= radius
    return Sphere(radius), matrix


def shape_of(mesh: Mesh, material: Material, where: str, report: LossReport) -> tuple[Shape, Matrix]:
    """The shape that a mesh represents, and its transform; the mesh itself if it is none. Round shapes are reported.

    Texture coordinates are compared only if the material depends on them.
    """
    textured = mesh.uvs is None or depends_on_uv(material)
    known = _KNOWN.setdefault(mesh, {})  # of a mesh that many shapes share
    if textured not in known:
        known[textured] = recognised(mesh) or (None if textured else recognised(dataclasses.replace(mesh, uvs=None)))
    found = known[textured]
    if found is None:
        return mesh, np.eye(4)
    if isinstance(found[0], Disk | Sphere):
        what = type(found[0]).__name__.lower()
        report.add(where, f"a mesh of {len(mesh.faces)} triangles that is a {what}", f"the {what}")
    return found
