"""Subdivision surfaces: Catmull and Clark's over polygons, and Loop's over triangles, as finer polygons.

Edges and corners may be sharp for some levels (DeRose, Kass and Truong 1998, "Subdivision surfaces in character
animation", sec. 3). Every step is a sparse matrix from the points of one level to those of the next, so that values at
vertices are refined as points are.

Sources: Catmull and Clark 1978, "Recursively generated B-spline surfaces on arbitrary topological meshes"; Loop 1987,
"Smooth subdivision surfaces based on triangles"; OpenSubdiv documentation, "Subdivision surfaces", for boundaries.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from scenes.arithmetic import cos, weighted
from scenes.canonical import Mesh
from scenes.canonical.values import vertices_of
from scenes.formats.geometry.orientation import area_normals

LEVELS = 3
"""Levels to which a surface is refined."""
POLYGONS_MOST = 1 << 20
"""Greatest number of polygons of a refined surface; a larger cage gets fewer levels."""
PAIRS_MOST = 1 << 22
"""Greatest number of pairs of corners of a polygon of more than 16, and of polygons at a point of more than 16, times
four for each level after the first. Each point near these depends on all of their points: a cage with more pairs gets
fewer levels."""
SHARP_ALWAYS = 10.0
"""Sharpness that never ends, as in OpenSubdiv."""

Scheme = Literal["catmullClark", "loop"]
Ints = NDArray[np.int64]
Sparse = Any
"""A sparse array of scipy in rows, whose types say less than they could."""


@dataclass(frozen=True, eq=False)
class Cage:
    """Polygons of at least three corners, and how sharp their edges and corners are.

    Attributes:
        point_count: number of points.
        counts: number of corners of each polygon ``(f,)``.
        indices: index of the point at each corner ``(c,)``.
        edges: ends of sharp edges ``(k, 2)``.
        edge_sharpness: their sharpness ``(k,)``; from :data:`SHARP_ALWAYS` on it never ends.
        corner_sharpness: sharpness of every point ``(point_count,)``.
    """

    point_count: int
    counts: Ints
    indices: Ints
    edges: Ints
    edge_sharpness: NDArray[np.float64]
    corner_sharpness: NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Refined:
    """A refined cage, and the matrices that refine values.

    Attributes:
        cage: the polygons: quads, or triangles of Loop's scheme.
        polygon: index of the polygon of the first cage in which each lies.
        smooth: from points of the first cage to those of this one.
        linear: the same for values that are interpolated linearly.
        corners: from corners of the first cage to those of this one, linearly within each polygon.
    """

    cage: Cage
    polygon: Ints
    smooth: Sparse
    linear: Sparse
    corners: Sparse

    def of(self, interpolation: str) -> Sparse | None:
        """The matrix for values of an interpolation of USD; None for those of whole polygons."""
        return {"vertex": self.smooth, "varying": self.linear, "faceVarying": self.corners}.get(interpolation)


def levels_of(cage: Cage, scheme: Scheme) -> int:
    """Number of levels to which a cage is refined."""
    first = len(cage.indices) if scheme == "catmullClark" else 4 * len(cage.counts)
    sizes = np.concatenate([cage.counts, np.bincount(cage.indices)])
    share = max(first / POLYGONS_MOST, int((sizes[sizes > 16] ** 2).sum()) / PAIRS_MOST)
    return next((level for level in range(LEVELS, 0, -1) if share * 4 ** (level - 1) <= 1.0), 0)


def refined(cage: Cage, scheme: Scheme, levels: int, sharp_corners: bool = True) -> Refined:
    """The surface of a cage after some steps.

    Args:
        cage: polygons; triangles for Loop's scheme.
        scheme: rule of subdivision.
        levels: number of steps, at most that of :func:`levels_of`.
        sharp_corners: whether points of a single polygon stay where they are, as the ends of edges of a boundary do.
    """
    if sharp_corners:
        alone = np.bincount(cage.indices, minlength=cage.point_count) == 1
        cage = replace(cage, corner_sharpness=np.where(alone, np.inf, cage.corner_sharpness))
    points, corners = (_whole(count) for count in (cage.point_count, len(cage.indices)))
    found = Refined(cage, np.arange(len(cage.counts)), points, points, corners)
    for _ in range(levels):
        found = _step(found, scheme)
    return found


def loop_surface(mesh: Mesh, levels: int) -> tuple[Mesh, int]:
    """Triangles of Loop's scheme with smooth normals, in place of a mesh, and the number of steps: at most ``levels``
    and :func:`levels_of`. Texture coordinates are interpolated linearly."""
    count, faces = len(mesh.vertices), mesh.faces.astype(np.int64)
    cage = Cage(count, np.full(len(faces), 3), faces.ravel(), np.zeros((0, 2), np.int64), np.zeros(0), np.zeros(count))
    levels = min(levels, levels_of(cage, "loop"))
    found = refined(cage, "loop", levels, sharp_corners=False)
    points, faces = weighted(found.smooth, mesh.vertices.astype(np.float64)), found.cage.indices.reshape(-1, 3)
    around = _matrix(1.0, faces.ravel(), np.repeat(np.arange(len(faces)), 3), (len(points), len(faces)))
    normals = weighted(around, area_normals(points[faces]))
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-300)
    uvs = None if mesh.uvs is None else weighted(found.linear, mesh.uvs.astype(np.float64)).astype(np.float32)
    return Mesh(vertices_of(points), faces.astype(np.int32), normals.astype(np.float32), uvs, mesh.source), levels


def _step(found: Refined, scheme: Scheme) -> Refined:
    cage, smoothly = found.cage, scheme == "catmullClark"
    count, corner = cage.point_count, np.arange(len(cage.indices))
    face = np.repeat(np.arange(len(cage.counts)), cage.counts)
    first = (np.cumsum(cage.counts) - cage.counts)[face]
    after = np.where(corner + 1 < first + cage.counts[face], corner + 1, first)
    before = np.empty_like(corner)
    before[after] = corner
    ends = np.sort(np.stack([cage.indices, cage.indices[after]]), axis=0)
    keys, edge = np.unique(ends[0] * count + ends[1], return_inverse=True)
    ends = np.stack(np.divmod(keys, count))
    edge_count, uses = len(keys), np.bincount(edge, minlength=len(keys))
    sharp = np.where(uses == 2, _sharpness(cage, keys), np.inf)

    face_mean = _matrix(1.0 / cage.counts[face], face, cage.indices, (len(cage.counts), count))
    middle = 0.5 * _matrix(1.0, np.tile(np.arange(edge_count), 2), ends.ravel(), (edge_count, count))
    to_faces = _matrix(1.0 / uses[edge], edge, face, (edge_count, len(cage.counts)))
    if smoothly:
        between = 0.5 * (middle + weighted(to_faces, face_mean))
    else:
        across = _matrix(1.0 / uses[edge], edge, cage.indices[before], (edge_count, count))
        between = 0.75 * middle + 0.25 * across
    edges = _blended(between, middle, np.clip(sharp, 0.0, 1.0))
    points = _points(cage, ends, sharp, face_mean, face, smoothly)

    quarter = _matrix(1.0, corner, corner, (len(corner),) * 2)
    ahead, behind = (0.5 * (quarter + _matrix(1.0, corner, other, quarter.shape)) for other in (after, before))
    on_edge, on_last = count + edge, count + edge[before]
    if smoothly:
        centre = _matrix(1.0 / cage.counts[face], face, corner, (len(cage.counts), len(corner)))[face]
        indices = np.stack([cage.indices, on_edge, count + edge_count + face, on_last], axis=1)
        of_corners, polygon = [quarter, ahead, centre, behind], found.polygon[face]
        smooth, linear = [points, edges, face_mean], [_whole(count), middle, face_mean]
    else:
        # a triangle at each corner, and one between; the latter has the middles of the three sides in their order
        indices = np.concatenate([np.stack([cage.indices, on_edge, on_last], axis=1), on_edge.reshape(-1, 3)])
        of_corners, polygon = [quarter, ahead, behind], np.concatenate([found.polygon[face], found.polygon])
        smooth, linear = [points, edges], [_whole(count), middle]
    order = np.arange(len(of_corners) * len(corner)).reshape(len(of_corners), -1).T.ravel()
    rows = _stacked(of_corners)[order]
    if not smoothly:
        rows = _stacked([rows, ahead])
    of_points, of_linear = _stacked(smooth), _stacked(linear)
    made, left = of_points.shape[0], sharp - 1.0
    kept = (left > 0.0) & (uses == 2)
    halves = np.stack([ends[:, kept], np.broadcast_to(count + np.flatnonzero(kept), (2, kept.sum()))], axis=-1)
    corner_sharpness = np.zeros(made)
    corner_sharpness[:count] = np.maximum(cage.corner_sharpness - 1.0, 0.0)
    finer = Cage(
        made, np.full(len(indices), indices.shape[1]), indices.ravel(), halves.reshape(-1, 2),
        np.tile(left[kept], 2), corner_sharpness,
    )  # fmt: skip
    return Refined(
        finer, polygon, weighted(of_points, found.smooth).tocsr(), weighted(of_linear, found.linear).tocsr(),
        weighted(rows, found.corners).tocsr(),
    )  # fmt: skip


def _points(
    cage: Cage, ends: Ints, sharp: NDArray[np.float64], face_mean: Sparse, face: Ints, smoothly: bool
) -> Sparse:
    """The matrix from the points of a cage to their places at the next level."""
    count = cage.point_count
    shape, whole = (count, count), _whole(count)
    both = np.concatenate([ends, ends[::-1]], axis=1)
    valence = np.maximum(np.bincount(both[0], minlength=count), 1).astype(np.float64)
    neighbours = _matrix(1.0, both[0], both[1], shape)
    if smoothly:
        corners = np.maximum(np.bincount(cage.indices, minlength=count), 1)
        faces = _matrix(1.0 / corners[cage.indices], cage.indices, face, (count, face_mean.shape[0]))
        around = weighted(faces, face_mean)
        inner = _scaled(1.0 - 2.0 / valence, whole) + _scaled(1.0 / valence**2, neighbours)
        inner = inner + _scaled(1.0 / valence, around)
    else:
        beta = (0.625 - (0.375 + 0.25 * cos(2.0 * np.pi / valence)) ** 2) / valence
        inner = _scaled(1.0 - valence * beta, whole) + _scaled(beta, neighbours)
    hard = np.tile(sharp, 2) > 0.0
    number = np.bincount(both[0], hard, minlength=count)
    total = np.bincount(both[0][hard], np.minimum(np.tile(sharp, 2)[hard], 2.0), minlength=count)
    along = 0.75 * whole + 0.125 * _matrix(1.0, both[0][hard], both[1][hard], shape)
    share = np.clip(np.divide(total, number, out=np.zeros(count), where=number > 1), 0.0, 1.0)
    used = np.bincount(cage.indices, minlength=count) > 0
    found = _blended(inner, along, np.where(number == 2, share, 0.0))
    still = np.maximum(np.where(number > 2, share, 0.0), np.clip(cage.corner_sharpness, 0.0, 1.0))
    return _blended(found, whole, np.where(used, still, 1.0))


def _sharpness(cage: Cage, keys: Ints) -> NDArray[np.float64]:
    """Sharpness of edges by the keys of their ends; 0 for those that the cage does not name."""
    given = np.sort(cage.edges, axis=1)
    own, first = np.unique(given[:, 0] * cage.point_count + given[:, 1], return_index=True)
    at = np.minimum(np.searchsorted(own, keys), max(len(own) - 1, 0))
    sharpness = np.where(cage.edge_sharpness >= SHARP_ALWAYS, np.inf, cage.edge_sharpness)
    return np.where(own[at] == keys, sharpness[first][at], 0.0) if len(own) else np.zeros(len(keys))


def _blended(soft: Sparse, hard: Sparse, share: NDArray[np.float64]) -> Sparse:
    return (_scaled(1.0 - share, soft) + _scaled(share, hard)).tocsr()


def selection(kept: Ints, count: int) -> Sparse:
    """The matrix that selects rows of ``count``, by their indices."""
    return _matrix(1.0, np.arange(len(kept)), kept, (len(kept), count))


def _whole(count: int) -> Sparse:
    return sparse.eye_array(count, format="csr")


def _stacked(parts: list[Sparse]) -> Sparse:
    return sparse.vstack(parts, format="csr")


def _scaled(values: NDArray[np.float64], matrix: Sparse) -> Sparse:
    """Rows of a matrix times values."""
    return weighted(sparse.diags_array(values), matrix)


def _matrix(values: NDArray[np.float64] | float, rows: Ints, columns: Ints, shape: tuple[int, ...]) -> Sparse:
    return sparse.csr_array((np.broadcast_to(np.asarray(values, np.float64), rows.shape), (rows, columns)), shape=shape)
