"""Recognition of meshes that are a transformed disk or sphere."""

from __future__ import annotations

import numpy as np

from scenes.canonical import Mesh
from scenes.canonical.values import Matrix
from scenes.formats.geometry.orientation import area_normals

_ROUND_OFF = 1e-4  # tolerance of vertices on a round shape, relative to its size
_AREA_OFF = 0.02  # tolerance of the area, which triangles reduce
_PROBE = 256  # number of vertices that suffices to reject a large mesh


def recognised_disk(mesh: Mesh) -> Matrix | None:
    """The transform from the disk to a flat mesh with its texture coordinates; None if the mesh is not a disk."""
    if mesh.uvs is None:
        return None
    turn, inward = 2.0 * np.pi * mesh.uvs[:, 0].astype(np.float64), mesh.uvs[:, 1].astype(np.float64)
    flat = np.stack([(1.0 - inward) * np.cos(turn), (1.0 - inward) * np.sin(turn), np.ones_like(turn)], axis=1)
    points = mesh.vertices.astype(np.float64)
    if len(points) > _PROBE and not _fits(flat[:: len(points) // _PROBE], points[:: len(points) // _PROBE]):
        return None
    if not _fits(flat, points):
        return None
    across, along, center = np.linalg.lstsq(flat, points, rcond=None)[0]
    normal = np.cross(across, along)
    size = float(np.linalg.norm(normal))
    if size <= 0.0:
        return None
    corners = points[mesh.faces]
    areas = 0.5 * area_normals(corners) @ (normal / size)
    if (areas < 0.0).any() or abs(areas.sum() / (np.pi * size) - 1.0) > _AREA_OFF:
        return None
    if mesh.normals is not None and (mesh.normals @ (normal / size) < 1.0 - 1e-3).any():
        return None
    matrix = np.eye(4)
    matrix[:3] = np.stack([across, along, normal / size, center], axis=1)
    return matrix


def recognised_sphere(mesh: Mesh) -> Matrix | None:
    """The transform from the unit sphere to a closed mesh with smooth normals; None if the mesh is not a sphere."""
    if mesh.normals is None:
        return None
    points = mesh.vertices.astype(np.float64)
    few = points[:: max(1, len(points) // _PROBE)]
    if _ellipsoid(few) is None:
        return None
    found = _ellipsoid(points)
    if found is None:
        return None
    root, center = found
    unit = (points - center) @ root
    if not _closed(mesh, unit):
        return None
    outward = unit @ root
    outward /= np.linalg.norm(outward, axis=1, keepdims=True)
    corners = unit[mesh.faces]
    if ((mesh.normals * outward).sum(axis=1) < 0.99).any() or (
        (area_normals(corners) * corners[:, 0]).sum(axis=1) <= 0.0
    ).any():
        return None
    turn = np.eye(3)
    if mesh.uvs is not None:
        around, height = 2.0 * np.pi * mesh.uvs[:, 0].astype(np.float64), np.pi * mesh.uvs[:, 1].astype(np.float64)
        wanted = np.stack([np.sin(height) * np.cos(around), np.sin(height) * np.sin(around), -np.cos(height)], axis=1)
        left, _, right = np.linalg.svd(unit.T @ wanted)
        turn = left @ right
        if np.abs(wanted @ turn.T - unit).max() > _ROUND_OFF:
            return None
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = np.linalg.inv(root) @ turn, center
    return matrix


def _ellipsoid(points: np.ndarray) -> tuple[np.ndarray, np.ndarray] | None:
    """A symmetric matrix and a centre that take points to the unit sphere; None if they do not lie on an ellipsoid.

    The quadric ``xᵀ A x + b·x = 1`` is fitted by least squares, about the mean of the points and scaled to their size.
    """
    middle = points.mean(axis=0)
    size = float(np.abs(points - middle).max())
    if len(points) < 16 or not size > 0.0:
        return None
    x, y, z = ((points - middle) / size).T
    terms = np.stack([x * x, y * y, z * z, 2 * x * y, 2 * x * z, 2 * y * z, x, y, z], axis=1)
    found, _, rank, _ = np.linalg.lstsq(terms, np.ones(len(points)), rcond=None)
    if rank < 9 or np.abs(terms @ found - 1.0).max() > _ROUND_OFF:
        return None
    a, b, c, d, e, f = found[:6]
    quadric = np.array([[a, d, e], [d, b, f], [e, f, c]])
    try:
        shift = -0.5 * np.linalg.solve(quadric, found[6:])
        quadric = quadric / (1.0 + shift @ quadric @ shift)
        values, axes = np.linalg.eigh(quadric)
    except np.linalg.LinAlgError:
        return None
    if not (values > 0.0).all():
        return None
    return axes @ np.diag(np.sqrt(values)) @ axes.T / size, middle + size * shift


def _closed(mesh: Mesh, unit: np.ndarray) -> bool:
    """Whether the triangles cover the unit sphere, up to the area that they cut off."""
    corners = unit[mesh.faces]
    areas = 0.5 * np.linalg.norm(area_normals(corners), axis=1)
    volume = np.einsum("fx,fx->", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])) / 6.0
    return bool(areas.sum() > (1.0 - _AREA_OFF) * 4.0 * np.pi and volume > (1.0 - _AREA_OFF) * 4.0 / 3.0 * np.pi)


def _fits(known: np.ndarray, points: np.ndarray) -> bool:
    """Whether points are a linear function of known ones."""
    found = np.linalg.lstsq(known, points, rcond=None)[0]
    size = float(np.abs(points - points.mean(axis=0)).max())
    return bool(np.abs(known @ found - points).max() < _ROUND_OFF * size)
