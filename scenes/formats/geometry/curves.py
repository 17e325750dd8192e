"""Bases of curves, and curves as meshes.

A uniform cubic B-spline is a chain of Bézier curves, and a Bézier curve is a B-spline of one segment, both exactly.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scenes.arithmetic import cos, product, sin
from scenes.canonical import Curves, Instance, Mesh
from scenes.formats.geometry.keeping import kept_with_shape

SIDES = 12
"""Sides of the prism that stands for a tube; its sides lie within 3.5 % of the radius."""

STRAIGHT = 0.05
"""Most distance of a chord from its curve, relative to the greatest width of the curves."""

_STEPS_MAX = 32  # chords of a segment

TRIANGLES_MOST = 1 << 22
"""Triangles of tubes that are not exceeded for the sake of :data:`STRAIGHT`."""

TO_BEZIER = np.array([[1.0, 4.0, 1.0, 0.0], [0.0, 4.0, 2.0, 0.0], [0.0, 2.0, 4.0, 0.0], [0.0, 1.0, 4.0, 1.0]]) / 6.0
"""Control points of a Bézier curve from four of a uniform cubic B-spline."""
_TO_BSPLINE = np.array([[6.0, -7.0, 2.0, 0.0], [0.0, 2.0, -1.0, 0.0], [0.0, -1.0, 2.0, 0.0], [0.0, 2.0, -7.0, 6.0]])
_RAISED = np.array([[1.0, 0.0], [2.0 / 3.0, 1.0 / 3.0], [1.0 / 3.0, 2.0 / 3.0], [0.0, 1.0]])

Segments = tuple[NDArray[np.float64], NDArray[np.int64]]
"""Control points ``(s, 4, 4)`` of cubic Bézier segments, of x, y, z and width, and the curve ``(s,)`` of each."""


def bezier_segments(curves: Curves) -> Segments:
    """The segments of curves as cubic Bézier curves."""
    controls = np.concatenate([curves.points, curves.widths[:, None]], axis=1).astype(np.float64)
    count = curves.segments
    step, width = {"linear": (1, 2), "bezier": (3, 4), "bspline": (1, 4)}[curves.basis]
    of = np.repeat(np.arange(len(count)), count)
    begins = np.concatenate([[0], np.cumsum(curves.counts)[:-1]])
    number = np.arange(len(of)) - np.repeat(np.cumsum(count) - count, count)
    found = controls[(begins[of] + step * number)[:, None] + np.arange(width)]
    matrix = {"linear": _RAISED, "bezier": np.eye(4), "bspline": TO_BEZIER}[curves.basis]
    return product(matrix, found), of


def normals_at_ends(curves: Curves) -> NDArray[np.float32] | None:
    """Normals ``(s, 2, 3)`` at both ends of all segments of ribbons."""
    if curves.normals is None:
        return None
    second = np.delete(np.arange(len(curves.normals)), np.cumsum(curves.segments + 1) - curves.segments - 1)
    return np.stack([curves.normals[second - 1], curves.normals[second]], axis=1)


def chained(parts: NDArray[Any], first: NDArray[np.bool_], new: int) -> NDArray[Any]:
    """Rows ``(n, k)`` of chains of segments ``(s, w, k)``: all of those that are the first of a chain ``(s,)``, and of
    the others the last ``new``, before which they share the end of the segment before."""
    kept = np.zeros(parts.shape[:2], bool)
    kept[:, -new:] = True
    kept[first] = True
    return parts[kept]


def as_bezier(curves: Curves) -> Curves:
    """The same curves as chains of cubic Bézier curves."""
    if curves.basis == "bezier":
        return curves
    segments, of = bezier_segments(curves)
    rows = chained(segments, np.diff(of, prepend=-1) > 0, 3)
    counts = (3 * curves.segments + 1).astype(np.int32)
    return dataclasses.replace(
        curves, points=rows[:, :3].astype(np.float32), widths=_widths(rows[:, 3]), counts=counts, basis="bezier"
    )


def as_bspline(curves: Curves) -> Curves:
    """The same curves as cubic B-splines; curves without continuous curvature become several."""
    if curves.basis == "bspline":
        return curves
    segments, of = bezier_segments(curves)
    found = product(_TO_BSPLINE, segments)
    size = np.abs(segments).max()
    joined = np.abs(found[1:, :3] - found[:-1, 1:]).max(axis=(1, 2)) <= 1e-5 * size
    first = np.concatenate([[True], ~(joined & (of[1:] == of[:-1]))])
    rows, normals = chained(found, first, 1), normals_at_ends(curves)
    return dataclasses.replace(
        curves,
        points=rows[:, :3].astype(np.float32),
        widths=_widths(rows[:, 3]),
        counts=(np.diff(np.append(np.flatnonzero(first), len(found))) + 3).astype(np.int32),
        basis="bspline",
        normals=None if normals is None else chained(normals, first, 1),
    )


def _widths(values: NDArray[np.float64]) -> NDArray[np.float32]:
    """Widths at control points; those of a taper to nothing may lie below zero."""
    return np.maximum(values, 0.0).astype(np.float32)


def joined(instances: Sequence[Instance]) -> list[Instance]:
    """Instances, of which curves that follow each other and differ in their points alone are one."""
    made: list[Instance] = []
    run: list[Instance] = []
    for one in [*instances, None]:
        if run and (one is None or _key(one) is None or _key(one) != _key(run[0])):
            made.append(dataclasses.replace(run[0], shape=_whole([part.shape for part in run])) if run[1:] else run[0])
            run = []
        if one is not None and _key(one) is not None:
            run.append(one)
        elif one is not None:
            made.append(one)
    return made


def _key(one: Instance) -> object:
    shape = one.shape
    if not isinstance(shape, Curves) or one.track is not None:
        return None
    sides = one.emission, one.emission_twosided, one.one_sided, one.interior, one.exterior
    return shape.basis, shape.kind, id(one.material), one.to_world.tobytes(), one.name, sides


def _whole(shapes: Sequence[object]) -> Curves:
    parts = [shape for shape in shapes if isinstance(shape, Curves)]
    points, widths, counts = (
        np.concatenate([getattr(part, name) for part in parts]) for name in ("points", "widths", "counts")
    )
    normals = [part.normals for part in parts if part.normals is not None]
    whole = np.concatenate(normals) if normals else None
    return dataclasses.replace(parts[0], points=points, widths=widths, counts=counts, normals=whole)


@kept_with_shape
def curve_mesh(curves: Curves) -> Mesh:
    """Curves as triangles: tubes as prisms of :data:`SIDES` sides, ribbons as strips; chords are within
    :data:`STRAIGHT` of the curves, or fewer for more than :data:`TRIANGLES_MOST`. Ribbons that face the viewer are
    tubes."""
    segments, of = bezier_segments(curves)
    second = np.abs(np.diff(segments[..., :3], 2, axis=1)).max()
    least = max(float(curves.widths.max()), 1e-12)
    # a chord is within max |B''| / 8 of the curve, and |B''| is at most 6 times the second difference
    wanted = np.ceil(np.sqrt(6.0 * second / (8.0 * STRAIGHT * least)))
    steps = int(np.clip(wanted, 1, min(_STEPS_MAX, max(1, TRIANGLES_MOST // (2 * SIDES * len(of))))))
    if curves.basis == "linear":
        steps = 1
    t = np.arange(steps + 1) / steps
    weights = np.stack([(1 - t) ** 2 * (1 - t), 3 * t * (1 - t) ** 2, 3 * t**2 * (1 - t), t**2 * t], axis=1)
    slopes = np.stack([-((1 - t) ** 2), (1 - t) * (1 - 3 * t), t * (2 - 3 * t), t**2], axis=1)
    at, along = product(weights, segments), product(slopes, segments)[..., :3]
    length = np.linalg.norm(along, axis=-1, keepdims=True)
    straight = segments[:, -1:, :3] - segments[:, :1, :3]
    along = np.where(length > 1e-9 * least, along, straight)
    along /= np.maximum(np.linalg.norm(along, axis=-1, keepdims=True), 1e-30)
    u = (np.arange(len(of)) - np.searchsorted(of, of))[:, None] + t
    u = u / curves.segments[of][:, None]
    if curves.normals is not None:
        return _strip(curves, at, along, u, t)
    return _prism(curves, at, along, u)


def _strip(curves: Curves, at, along, u, t) -> Mesh:
    """Strips across the normals of ribbons."""
    ends = normals_at_ends(curves)
    assert ends is not None
    normals = (1 - t)[:, None] * ends[:, :1] + t[:, None] * ends[:, 1:]
    side = np.cross(normals, along)
    side /= np.maximum(np.linalg.norm(side, axis=-1, keepdims=True), 1e-30)
    half = 0.5 * at[..., 3:] * side
    points = np.stack([at[..., :3] - half, at[..., :3] + half], axis=2)
    uvs = np.stack([np.stack([u, np.zeros_like(u)], axis=-1), np.stack([u, np.ones_like(u)], axis=-1)], axis=2)
    return _grid(points, uvs, None, closed=False)


def _prism(curves: Curves, at, along, u) -> Mesh:
    """Prisms about the segments, whose frames are turned as little as possible from step to step."""
    start = np.eye(3)[np.abs(along[:, 0]).argmin(axis=-1)]
    side = np.empty_like(along)
    for step in range(along.shape[1]):  # all segments at once
        start = start - (start * along[:, step]).sum(axis=-1, keepdims=True) * along[:, step]
        start /= np.maximum(np.linalg.norm(start, axis=-1, keepdims=True), 1e-30)
        side[:, step] = start
    other = np.cross(along, side)
    angle = 2.0 * np.pi * np.arange(SIDES) / SIDES
    out = cos(angle)[:, None] * side[:, :, None] + sin(angle)[:, None] * other[:, :, None]
    points = at[:, :, None, :3] + 0.5 * at[:, :, None, 3:] * out
    across = np.broadcast_to(np.arange(SIDES) / SIDES, (*u.shape, SIDES))
    uvs = np.stack([np.broadcast_to(u[..., None], across.shape), across], axis=-1)
    return _grid(points, uvs, out, closed=True)


def _grid(points, uvs, normals, closed: bool) -> Mesh:
    """A mesh of grids ``(s, steps + 1, across, ...)`` of vertices."""
    count, steps, across = points.shape[:3]
    number = np.arange(count * steps * across).reshape(count, steps, across)
    right = np.roll(number, -1, axis=2) if closed else number[:, :, 1:]
    left = number if closed else number[:, :, :-1]
    a, b, c, d = left[:, :-1], right[:, :-1], right[:, 1:], left[:, 1:]
    faces = np.stack([a, b, c, a, c, d], axis=-1).reshape(-1, 3).astype(np.int32)
    arrays = [
        None if part is None else part.reshape(-1, part.shape[-1]).astype(np.float32) for part in (points, normals, uvs)
    ]
    assert arrays[0] is not None
    return Mesh(arrays[0], faces, arrays[1], arrays[2], "curves")
