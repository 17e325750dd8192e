"""Polygons as triangles."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int
from numpy.typing import NDArray

_WORK_MOST = 1 << 32
"""Sum of the squares of the numbers of corners of the polygons that are cut: some seconds at most."""

_AT_ONCE = 1 << 21
_FLAT = 1e-9  # share of the polygon's area by which a triangle may face away from it


@dataclass(frozen=True, eq=False)
class Triangles:
    """Triangles of polygons.

    Attributes:
        corners: index of each corner among the corners of all polygons.
        polygon: index of the polygon of each triangle, ascending.
        uncovered: number of polygons that are fans though these do not cover them.
    """

    corners: Int[NDArray[np.int64], "f 3"]
    polygon: Int[NDArray[np.int64], " f"]
    uncovered: int


def triangles_of(
    points: Float[NDArray[np.float64], "points 3"],
    at: Int[NDArray[np.int64], " corners"],
    counts: Int[NDArray[np.int64], " polygons"],
    work: int = _WORK_MOST,
) -> Triangles:
    """The triangles of polygons in their order.

    Polygons are fans about their first corner where this covers them, as it does where they are convex. Others are cut
    by mapbox_earcut, which leaves out corners on a straight line.

    Args:
        points: finite points of the mesh.
        at: index of the point at each corner of all polygons, one polygon after the other.
        counts: number of corners of each polygon, at least 3.
        work: greatest sum of the squares of the numbers of corners of polygons that are cut; further ones are fans.
    """
    starts = np.cumsum(counts) - counts
    order, parts, uncovered = [np.zeros(0, np.int64)], [np.zeros((0, 3), np.int64)], 0
    for corners in np.unique(counts).tolist():
        here = np.flatnonzero(counts == corners)
        places = starts[here, None] + np.arange(corners)
        concave = _concave(points, at[places])
        chosen = concave[: work // corners**2]
        work -= len(chosen) * corners**2
        uncovered += len(concave) - len(chosen)
        cut = _cut(points[at[places[chosen]]])
        kept = [place for place, found in enumerate(cut) if len(found)]  # none of a polygon without area
        fans = np.delete(np.arange(len(here)), chosen[kept])
        middle = np.arange(1, corners - 1)
        fan = np.stack([np.zeros_like(middle), middle, middle + 1], axis=1)
        order += [np.repeat(here[fans], corners - 2), np.repeat(here[chosen], [len(found) for found in cut])]
        parts += [places[fans][:, fan].reshape(-1, 3), *(places[chosen[place]][cut[place]] for place in kept)]
    polygon = np.concatenate(order)
    sequence = np.argsort(polygon, kind="stable")
    return Triangles(np.concatenate(parts)[sequence], polygon[sequence], uncovered)


def _concave(
    points: Float[NDArray[np.float64], "points 3"], polygons: Int[NDArray[np.int64], "n corners"]
) -> Int[NDArray[np.int64], " some"]:
    """Numbers of the polygons whose fan has a triangle that faces away from the polygon."""
    corners = polygons.shape[1]
    if corners == 3:
        return np.zeros(0, np.int64)
    some = max(1, _AT_ONCE // corners)
    parts = [_leaves_its_fan(points[polygons[first : first + some]]) for first in range(0, len(polygons), some)]
    return np.flatnonzero(np.concatenate(parts))


def _fan_normals(places: Float[NDArray[np.float64], "n c 3"]) -> Float[NDArray[np.float64], "n parts 3"]:
    """Normals of the triangles of a fan, whose lengths are twice the areas."""
    x, y, z = np.moveaxis(places[:, 1:] - places[:, :1], 2, 0)
    crosses = [a[:, :-1] * b[:, 1:] - b[:, :-1] * a[:, 1:] for a, b in ((y, z), (z, x), (x, y))]
    return np.stack(crosses, axis=-1)


def _leaves_its_fan(places: Float[NDArray[np.float64], "n c 3"]) -> NDArray[np.bool_]:
    """Whether a triangle of the fan about the first corner of a polygon faces away from the polygon."""
    normals = _fan_normals(places)
    whole = normals.sum(axis=1)
    towards, away = (normals * whole[:, None]).sum(axis=2), -_FLAT * (whole * whole).sum(axis=1)
    return (towards < away[:, None]).any(axis=1)


def _cut(places: Float[NDArray[np.float64], "n c 3"]) -> list[Int[NDArray[np.int64], "parts 3"]]:
    """Triangles of polygons, in their orientation; none for those without area."""
    if not len(places):
        return []
    import mapbox_earcut  # few models have concave polygons

    normals = _fan_normals(places).sum(axis=1)
    axis = np.abs(normals).argmax(axis=1)
    # on the plane of two axes on which a polygon is largest, counter-clockwise, as the triangles are
    flat = [np.take_along_axis(places, ((axis + step) % 3)[:, None, None], axis=2) for step in (1, 2)]
    along = np.take_along_axis(normals, axis[:, None], axis=1)[..., None]
    plane = np.concatenate([np.where(along < 0.0, -flat[0], flat[0]), flat[1]], axis=2)
    plane = np.ascontiguousarray(plane - plane[:, :1])
    ends = np.array([plane.shape[1]], np.uint32)
    return [mapbox_earcut.triangulate_float64(one, ends).astype(np.int64).reshape(-1, 3) for one in plane]


def triangles_of_strips(at: NDArray, counts: Int[NDArray[np.int64], " strips"]) -> NDArray:
    """The triangles ``(f, 3)`` of strips, each of three successive corners; every second one is turned over, so that
    all have the same side. Those without area are left out.

    Args:
        at: index of the point at each corner of all strips, one after the other; a negative one begins a strip anew.
        counts: number of corners of each strip, with the negative ones.
    """
    ends = np.cumsum(counts)
    at = np.insert(at, ends[:-1], -1) if len(ends) > 1 else at
    number = np.arange(len(at))
    start = np.maximum.accumulate(np.where(at < 0, number + 1, 0))
    found = np.stack([at[:-2], at[1:-1], at[2:]], axis=1)
    odd = (number - start)[:-2] % 2 == 1
    found[odd] = found[odd][:, [1, 0, 2]]
    a, b, c = found.T
    return found[(found >= 0).all(axis=1) & (a != b) & (b != c) & (c != a)]
