"""Polygons as triangles.

Source: G. H. Meisters, "Polygons have ears", American Mathematical Monthly 82(6), 1975.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int
from numpy.typing import NDArray

_WORK_MOST = 1 << 24
_CORNERS_MOST = 1 << 11
_AT_ONCE = 1 << 21
_FLAT = 1e-9  # sine of a turn that counts as none


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
) -> Triangles:
    """The triangles of polygons in their order, see :func:`triangulated`.

    Args:
        points: finite points of the mesh.
        at: index of the point at each corner of all polygons, one polygon after the other.
        counts: number of corners of each polygon, at least 3.
    """
    starts = np.cumsum(counts) - counts
    order, parts, uncovered, work = [], [], 0, _WORK_MOST
    for corners in np.unique(counts).tolist():
        here = np.flatnonzero(counts == corners)
        places = starts[here, None] + np.arange(corners)
        found, left, work = triangulated(points, at[places], work)
        uncovered += left
        order.append(np.repeat(here, corners - 2))
        parts.append(np.take_along_axis(places[:, None], found, axis=2).reshape(-1, 3))
    polygon = np.concatenate([*order, np.zeros(0, np.int64)])
    sequence = np.argsort(polygon, kind="stable")
    return Triangles(np.concatenate([*parts, np.zeros((0, 3), np.int64)])[sequence], polygon[sequence], uncovered)


def triangulated(
    points: Float[NDArray[np.float64], "points 3"],
    polygons: Int[NDArray[np.int64], "polygons corners"],
    work: int = _WORK_MOST,
) -> tuple[Int[NDArray[np.int64], "polygons parts 3"], int, int]:
    """The triangles of polygons, each as three of its corners, from 0, in the order of the polygon.

    Polygons are fans about their first corner where this covers them, as it does where they are convex. Others are cut
    at ears: corners whose triangle holds no other corner. One that crosses itself and has no ear loses its sharpest
    corner.

    Args:
        points: points of the mesh.
        polygons: indices of the points of each corner, at least 3 corners.
        work: comparisons that may be made; a polygon takes the square of its corners.

    Returns:
        The triangles ``(polygons, corners - 2, 3)``; the number of polygons that are fans though these do not cover
        them, since cutting them would take more than ``work``; and the work that is left.
    """
    corners = polygons.shape[1]
    at = np.arange(corners - 2)
    fan = np.stack([np.zeros_like(at), at + 1, at + 2], axis=1)
    found = np.broadcast_to(fan, (len(polygons), *fan.shape)).copy()
    if corners == 3 or not len(polygons):
        return found, 0, work
    some = max(1, _AT_ONCE // corners)
    parts = [points[polygons[first : first + some]] for first in range(0, len(polygons), some)]
    uncovered = np.flatnonzero(np.concatenate([_leaves_its_fan(part) for part in parts]))
    cut = uncovered[: work // corners**2 if corners <= _CORNERS_MOST else 0]
    some = max(1, _AT_ONCE // corners**2)
    for first in range(0, len(cut), some):
        here = cut[first : first + some]
        found[here] = _ears(_flattened(points[polygons[here]]))
    return found, len(uncovered) - len(cut), work - len(cut) * corners**2


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


def _flattened(places: Float[NDArray[np.float64], "n c 3"]) -> Float[NDArray[np.float64], "n c 2"]:
    """Corners on the plane of two axes on which the polygon is largest, counter-clockwise."""
    normals = _fan_normals(places).sum(axis=1)
    axis = np.abs(normals).argmax(axis=1)
    first, second = (np.take_along_axis(places, ((axis + step) % 3)[:, None, None], axis=2) for step in (1, 2))
    flat = np.concatenate([first, second], axis=2)
    flat = flat - flat[:, :1]
    along = np.take_along_axis(normals, axis[:, None], axis=1)
    flat[..., 0] *= np.where(along < 0.0, -1.0, 1.0)
    return flat


def _cross(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    return a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]


def _sharpness(
    flat: Float[NDArray[np.float64], "n c 2"], left: Int[NDArray[np.int64], "n m"], at: Int[NDArray[np.int64], "n k"]
) -> Float[NDArray[np.float64], "n k"]:
    """Sines of the turns at some of the corners that are left, minus 2 where they are no ears."""
    size = left.shape[1]
    before, here, after = (
        np.take_along_axis(flat, np.take_along_axis(left, (at + step) % size, axis=1)[..., None], axis=1)
        for step in (-1, 0, 1)
    )
    into, out = here - before, after - here
    sine = _cross(into, out) / np.maximum(np.linalg.norm(into, axis=2) * np.linalg.norm(out, axis=2), 1e-300)
    others = np.take_along_axis(flat, left[..., None], axis=1)[:, None]
    inside = np.ones((*at.shape, size), bool)
    for start, end in ((before, here), (here, after), (after, before)):
        # strictly: corners may touch others, as where a hole is joined to the rim
        inside &= _cross((end - start)[:, :, None], others - start[:, :, None]) > 0.0
    return np.where(inside.any(axis=2) | (sine <= _FLAT), sine - 2.0, sine)


def _ears(flat: Float[NDArray[np.float64], "n c 2"]) -> Int[NDArray[np.int64], "n parts 3"]:
    """Triangles of counter-clockwise polygons, one ear of each at a time."""
    count, corners, _ = flat.shape
    left = np.tile(np.arange(corners), (count, 1))
    sharp = _sharpness(flat, left, left)
    rows, found = np.arange(count), []
    for size in range(corners, 3, -1):
        stuck = sharp.max(axis=1) <= 0.0  # what hid an ear may be gone
        if stuck.any():
            sharp[stuck] = _sharpness(flat[stuck], left[stuck], np.tile(np.arange(size), (int(stuck.sum()), 1)))
        ear = sharp.argmax(axis=1)
        found.append(left[rows[:, None], (ear[:, None] + np.array([-1, 0, 1])) % size])
        kept = np.arange(size) != ear[:, None]
        left, sharp = left[kept].reshape(count, -1), sharp[kept].reshape(count, -1)
        beside = (ear[:, None] + np.array([-1, 0])) % (size - 1)
        sharp[rows[:, None], beside] = _sharpness(flat, left, beside)
    return np.stack([*found, left], axis=1)
