"""Meshes that are one of the canonical shapes under a transform."""

from __future__ import annotations

import dataclasses
from functools import lru_cache
from itertools import combinations, permutations, product

import numpy as np

from scenes.canonical import Cube, Disk, Material, Mesh, Rectangle, Shape, Sphere
from scenes.canonical.values import Matrix
from scenes.formats.geometry.meshed import SQUARE_UV, as_mesh, depends_on_uv
from scenes.formats.losses import LossReport

DISK_MIN, SPHERE_MIN = 32, 512
"""Triangles of a mesh that may be a disk, or a sphere; what has fewer is meant to have corners."""

_CLOSE = 1e-4  # of a side; files print six digits

_ROUND_OFF = 1e-4  # of the size: how far off a round shape vertices may be
_AREA_OFF = 0.02  # that triangles cut off
_PROBE = 256  # vertices that a large mesh is turned down by


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


def recognised(mesh: Mesh) -> tuple[Shape, Matrix] | None:
    """The canonical shape that a mesh is, and where it lies; None where it is none.

    Its texture coordinates, where it has any, must be those of the shape, and its normals too.
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
    """A mesh as what it is, and where it lies; round shapes in the place of triangles are reported.

    Its texture coordinates count only where the material depends on them.
    """
    textured = mesh.uvs is None or depends_on_uv(material)
    found = recognised(mesh) or (None if textured else recognised(dataclasses.replace(mesh, uvs=None)))
    if found is None:
        return mesh, np.eye(4)
    if isinstance(found[0], Disk | Sphere):
        what = type(found[0]).__name__.lower()
        report.add(where, f"a mesh of {len(mesh.faces)} triangles that is a {what}", f"the {what}")
    return found


# --- cubes -----------------------------------------------------------------------------------------------------------


def recognised_cube(mesh: Mesh) -> Matrix | None:
    """The transform that makes a cube of a mesh of twelve triangles, None where it is none."""
    points = mesh.vertices.astype(np.float64)
    if not 8 <= len(points) <= 36:
        return None
    box = _box(points)
    if box is None:
        return None
    local = (points - box[:3, 3]) @ np.linalg.inv(box[:3, :3]).T
    signs = np.sign(local).astype(int)
    if np.abs(local - signs).max() > _CLOSE or (signs == 0).any():
        return None
    sides = _sides(mesh, signs)
    if sides is None:
        return None
    known, best = _cube_uvs(), None
    for turn in _turns():
        turned, faced = signs @ turn, sides @ turn
        wanted = [
            known[tuple(side), tuple(turned[corner])]
            for side, face in zip(faced.tolist(), mesh.faces.tolist(), strict=True)
            for corner in face
        ]
        if mesh.uvs is None or np.abs(np.array(wanted) - mesh.uvs[mesh.faces.ravel()]).max() < _CLOSE:
            axes = box[:3, :3] @ turn
            relative = np.round(axes / np.abs(axes).max(), 4)
            # of those that look alike always the same one: the least turned
            rank = round(float(np.trace(relative)), 3), *relative.ravel()
            if best is None or rank > best[0]:
                best = rank, axes
    if best is None:
        return None
    box[:3, :3] = best[1]
    return box


def _box(points: np.ndarray) -> Matrix | None:
    """Centre and half edges of a parallelepiped's corners, right-handed; None where they make none."""
    size = float(np.abs(points - points.mean(axis=0)).max())
    corners: list[np.ndarray] = []
    for point in points:
        if all(np.abs(point - other).max() > _CLOSE * size for other in corners):
            corners.append(point)
    if len(corners) != 8:
        return None
    first, others = corners[0], np.array(corners[1:]) - corners[0]
    for chosen in combinations(range(7), 3):
        edges = others[list(chosen)]
        sums = np.array([np.array(part) @ edges for part in product((0, 1), repeat=3)])[1:]
        if all(np.abs(others - total).max(axis=1).min() < _CLOSE * size for total in sums):
            volume = float(np.linalg.det(edges))
            if abs(volume) < 1e-9 * size**3:
                return None
            if volume < 0.0:
                edges = edges[[1, 0, 2]]
            matrix = np.eye(4)
            matrix[:3, :3], matrix[:3, 3] = 0.5 * edges.T, first + 0.5 * edges.sum(axis=0)
            return matrix
    return None


def _sides(mesh: Mesh, signs: np.ndarray) -> np.ndarray | None:
    """The side that each of twelve triangles lies on, outward; None where they do not cover a cube's six."""
    corners = signs[mesh.faces]
    even = (corners == corners[:, :1]).all(axis=1)
    if (even.sum(axis=1) != 1).any():
        return None
    sides = np.where(even, corners[:, 0], 0)
    outward = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    if ((outward * sides).sum(axis=1) <= 0).any():
        return None
    # what two triangles of a side lack are opposite corners: a triangle's sum is its middle corner and the side twice
    middles = corners.sum(axis=1) - 2 * sides
    for side in np.concatenate([np.eye(3, dtype=int), -np.eye(3, dtype=int)]):
        on = middles[(sides == side).all(axis=1)]
        if len(on) != 2 or not np.array_equal(on[0] - side, side - on[1]):
            return None
    if mesh.normals is not None:
        world = mesh.vertices[mesh.faces].astype(np.float64)
        across = np.cross(world[:, 1] - world[:, 0], world[:, 2] - world[:, 0])
        across /= np.linalg.norm(across, axis=1, keepdims=True)
        if (np.einsum("fcx,fx->fc", mesh.normals[mesh.faces], across) < 1.0 - 1e-3).any():
            return None
    return sides


@lru_cache(maxsize=1)
def _cube_uvs() -> dict[tuple[tuple[int, ...], tuple[int, ...]], tuple[float, ...]]:
    """Texture coordinates of the cube by side and corner."""
    mesh = as_mesh(Cube())
    assert mesh.uvs is not None and mesh.normals is not None
    sides, corners = (part.round().astype(int).tolist() for part in (mesh.normals, mesh.vertices))
    rows = zip(sides, corners, mesh.uvs.tolist(), strict=True)
    return {(tuple(side), tuple(corner)): tuple(uv) for side, corner, uv in rows}


@lru_cache(maxsize=1)
def _turns() -> list[np.ndarray]:
    """The 24 rotations of a cube."""
    made = [np.eye(3, dtype=int)[list(order)] * np.array(sign) for order in permutations(range(3))
            for sign in product((1, -1), repeat=3)]  # fmt: skip
    return [turn for turn in made if round(float(np.linalg.det(turn))) == 1]


# --- disks and spheres -----------------------------------------------------------------------------------------------


def recognised_disk(mesh: Mesh) -> Matrix | None:
    """The transform that makes a disk of a flat mesh with its texture coordinates, None where it is none."""
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
    areas = 0.5 * np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]) @ (normal / size)
    if (areas < 0.0).any() or abs(areas.sum() / (np.pi * size) - 1.0) > _AREA_OFF:
        return None
    if mesh.normals is not None and (mesh.normals @ (normal / size) < 1.0 - 1e-3).any():
        return None
    matrix = np.eye(4)
    matrix[:3] = np.stack([across, along, normal / size, center], axis=1)
    return matrix


def recognised_sphere(mesh: Mesh) -> Matrix | None:
    """The transform that makes a unit sphere of a closed mesh with smooth normals, None where it is none."""
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
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    if ((mesh.normals * outward).sum(axis=1) < 0.99).any() or ((across * corners[:, 0]).sum(axis=1) <= 0.0).any():
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
    """A symmetric matrix and a centre that take points to the unit sphere; None where they do not lie on an ellipsoid.

    The quadric through them by least squares: ``xᵀ A x + b·x = 1``, about their mean and scaled to their size.
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
    """Whether the triangles cover the unit sphere, but for what they cut off."""
    corners = unit[mesh.faces]
    areas = 0.5 * np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    volume = np.einsum("fx,fx->", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])) / 6.0
    return bool(areas.sum() > (1.0 - _AREA_OFF) * 4.0 * np.pi and volume > (1.0 - _AREA_OFF) * 4.0 / 3.0 * np.pi)


def _fits(known: np.ndarray, points: np.ndarray) -> bool:
    """Whether points are a linear function of known ones."""
    found = np.linalg.lstsq(known, points, rcond=None)[0]
    size = float(np.abs(points - points.mean(axis=0)).max())
    return bool(np.abs(known @ found - points).max() < _ROUND_OFF * size)
