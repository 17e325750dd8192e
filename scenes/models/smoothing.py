"""Shading normals for meshes without normals."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable

import numpy as np
from jaxtyping import Float, Int
from numpy.typing import NDArray

from scenes.arithmetic import arccos, cos
from scenes.canonical import Instance, Mesh
from scenes.canonical.values import vertices_of

_PAIRS_AT_ONCE = 1 << 22


def corner_normals(
    corners: Float[NDArray[np.float64], "f 3 3"],
    smooth_deg: float = 0.0,
    groups: Int[NDArray[np.int64], " f"] | None = None,
) -> Float[NDArray[np.float32], "f 3 3"]:
    """Normals at the corners of triangles: the sum over the triangle and its neighbours at that point.

    Normals are weighted by the angle at the corner, so that the triangulation of polygons has no effect. Neighbours are
    the triangles with a corner at the same point whose normals differ by at most ``smooth_deg``, and those of the same
    group.

    Args:
        corners: points of the triangles.
        smooth_deg: greatest angle between normals, degrees, 0 to 180.
        groups: smoothing group of each triangle; 0 is none.

    Returns:
        Unit normals; ``(0, 0, 1)`` for degenerate triangles without neighbours.

    Source: Thürmer and Wüthrich 1998, "Computing vertex normals from polygonal facets".
    """
    areas = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.linalg.norm(areas, axis=1, keepdims=True)
    unit = areas / np.maximum(length, 1e-300)
    groups = np.zeros(len(corners), np.int64) if groups is None else groups
    weighted = (_angles(corners)[..., None] * unit[:, None]).reshape(-1, 3)
    _, point = np.unique(corners.reshape(-1, 3), axis=0, return_inverse=True)
    order = np.argsort(point, kind="stable")
    face = order // 3
    sizes = np.bincount(point)
    first = np.concatenate([[0], np.cumsum(sizes)])
    least = cos(np.radians(min(smooth_deg, 180.0))) - 1e-9
    found = np.empty((len(order), 3))
    low = 0
    while low < len(sizes):
        # as many points as keep the number of pairs of corners bounded
        pairs = np.cumsum(sizes[low:] ** 2)
        high = low + max(1, int(np.searchsorted(pairs, _PAIRS_AT_ONCE, side="right")))
        here = slice(first[low], first[high])
        of_point = np.repeat(np.arange(low, high), sizes[low:high])
        partners = sizes[of_point]
        one = np.repeat(np.arange(first[low], first[high]), partners)
        start = np.repeat(first[of_point], partners)
        other = start + np.arange(len(one)) - np.repeat(np.cumsum(partners) - partners, partners)
        a, b = face[one], face[other]
        together = (unit[a] * unit[b]).sum(axis=1) >= least if smooth_deg > 0.0 else np.zeros(len(a), bool)
        together |= (groups[a] == groups[b]) & (groups[a] != 0)
        together |= a == b
        for axis in range(3):
            terms = np.where(together, weighted[order[other], axis], 0.0)
            found[here, axis] = np.bincount(one - first[low], terms, first[high] - first[low])
        low = high
    normals = np.empty((3 * len(corners), 3))
    normals[order] = found
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    normals = np.where(length > 0.0, normals / np.maximum(length, 1e-300), (0.0, 0.0, 1.0))
    return normals.astype(np.float32).reshape(-1, 3, 3)


def _angles(corners: Float[NDArray[np.float64], "f 3 3"]) -> Float[NDArray[np.float64], "f 3"]:
    """Angles of triangles at their corners, radians; 0 if two corners coincide."""
    ahead, behind = np.roll(corners, -1, axis=1) - corners, np.roll(corners, 1, axis=1) - corners
    lengths = np.linalg.norm(ahead, axis=2) * np.linalg.norm(behind, axis=2)
    cosines = (ahead * behind).sum(axis=2) / np.where(lengths > 0.0, lengths, 1.0)
    return np.where(lengths > 0.0, arccos(np.clip(cosines, -1.0, 1.0)), 0.0)


def unit_normals(normals: NDArray[np.float64], corners: NDArray[np.float64]) -> NDArray[np.float32]:
    """Unit normals; face normals where the file has no usable ones."""
    length = np.linalg.norm(normals, axis=-1, keepdims=True)
    usable = np.isfinite(length) & (length > 0.0)
    if usable.all():
        return (normals / length).astype(np.float32)
    found = normals / np.where(usable, length, 1.0)
    return np.where(usable, found, corner_normals(corners)).astype(np.float32)


def with_corners(
    corners: Float[NDArray[np.floating], "f 3 3"],
    normals: Float[NDArray[np.float32], "f 3 3"] | None,
    uvs: Float[NDArray[np.float32], "f 3 2"] | None,
    source: str,
    keys: Int[NDArray[np.int64], "f 3"] | None = None,
) -> Mesh:
    """A mesh of triangles given by their corners; equal corners become one vertex.

    Args:
        corners: points.
        normals: unit normals, or None for flat faces.
        uvs: texture coordinates, or None.
        source: file name, for messages.
        keys: numbers that are equal for equal corners, if these are known.
    """
    if keys is not None:
        _, first, index = np.unique(keys.reshape(-1), return_index=True, return_inverse=True)
        return Mesh(
            vertices_of(corners.reshape(-1, 3)[first]),
            index.reshape(-1, 3).astype(np.int32),
            None if normals is None else normals.reshape(-1, 3)[first],
            None if uvs is None else uvs.reshape(-1, 2)[first],
            source,
        )
    columns = [part.reshape(-1, part.shape[-1]) for part in (corners, normals, uvs) if part is not None]
    rows = np.concatenate([column.astype(np.float64) for column in columns], axis=1)
    kept, index = np.unique(rows, axis=0, return_inverse=True)
    at = 3
    unit = kept[:, 3:6].astype(np.float32) if normals is not None else None
    at += 0 if normals is None else 3
    texture = kept[:, at : at + 2].astype(np.float32) if uvs is not None else None
    return Mesh(vertices_of(kept[:, :3]), index.reshape(-1, 3).astype(np.int32), unit, texture, source)


def smoothed(parts: Iterable[Instance], smooth_deg: float) -> tuple[Instance, ...]:
    """Instances whose meshes without normals get smooth edges between faces that differ by at most ``smooth_deg``."""
    made: dict[int, Mesh] = {}

    def mesh_of(mesh: Mesh) -> Mesh:
        if id(mesh) not in made:
            corners = mesh.vertices[mesh.faces].astype(np.float64)
            uvs = None if mesh.uvs is None else mesh.uvs[mesh.faces]
            made[id(mesh)] = with_corners(corners, corner_normals(corners, smooth_deg), uvs, mesh.source)
        return made[id(mesh)]

    return tuple(
        dataclasses.replace(part, shape=mesh_of(part.shape))
        if smooth_deg > 0.0 and isinstance(part.shape, Mesh) and part.shape.normals is None
        else part
        for part in parts
    )
