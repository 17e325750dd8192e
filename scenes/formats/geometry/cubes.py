"""Recognition of meshes that are a transformed cube."""

from __future__ import annotations

from functools import lru_cache
from itertools import combinations, permutations, product

import numpy as np

from scenes.canonical import Cube, Mesh
from scenes.canonical.values import Matrix
from scenes.formats.geometry.meshed import as_mesh
from scenes.formats.geometry.orientation import area_normals

_CLOSE = 1e-4  # relative to a side; files print six digits


def recognised_cube(mesh: Mesh) -> Matrix | None:
    """The transform from the cube to a mesh of twelve triangles; None if the mesh is not a cube."""
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
            # among equivalent transforms always the same one: that of least rotation
            rank = round(float(np.trace(relative)), 3), *relative.ravel()
            if best is None or rank > best[0]:
                best = rank, axes
    if best is None:
        return None
    box[:3, :3] = best[1]
    return box


def _box(points: np.ndarray) -> Matrix | None:
    """Centre and right-handed half edges of a parallelepiped with these corners; None if they do not form one."""
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
    """The outward side on which each of twelve triangles lies; None if they do not cover the six sides of a cube."""
    corners = signs[mesh.faces]
    even = (corners == corners[:, :1]).all(axis=1)
    if (even.sum(axis=1) != 1).any():
        return None
    sides = np.where(even, corners[:, 0], 0)
    outward = area_normals(corners)
    if ((outward * sides).sum(axis=1) <= 0).any():
        return None
    # the missing corners of a side's two triangles are opposite: a triangle's sum is its middle corner and twice the
    # side
    middles = corners.sum(axis=1) - 2 * sides
    for side in np.concatenate([np.eye(3, dtype=int), -np.eye(3, dtype=int)]):
        on = middles[(sides == side).all(axis=1)]
        if len(on) != 2 or not np.array_equal(on[0] - side, side - on[1]):
            return None
    if mesh.normals is not None:
        world = mesh.vertices[mesh.faces].astype(np.float64)
        normals = area_normals(world)
        normals /= np.linalg.norm(normals, axis=1, keepdims=True)
        if (np.einsum("fcx,fx->fc", mesh.normals[mesh.faces], normals) < 1.0 - 1e-3).any():
            return None
    return sides


@lru_cache(maxsize=1)
def _cube_uvs() -> dict[tuple[tuple[int, ...], tuple[int, ...]], tuple[float, ...]]:
    """Texture coordinates of the cube, by side and corner."""
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
