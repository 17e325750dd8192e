"""Curves of USD, such as hair: tubes, or ribbons where they have normals.

Source: OpenUSD documentation, UsdGeomBasisCurves.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from scenes.arithmetic import product
from scenes.canonical import Curves
from scenes.formats.geometry.curves import TO_BEZIER, chained
from scenes.formats.losses import LossReport
from scenes.models.usd_library import UsdGeom
from scenes.models.usd_values import array_of, finite

# control points of a cubic Bézier curve from four of another basis
_BASES = {
    "bezier": np.eye(4),
    "bspline": TO_BEZIER,
    "catmullRom": np.array([[0.0, 6.0, 0.0, 0.0], [-1.0, 6.0, 1.0, 0.0], [0.0, 1.0, 6.0, -1.0], [0.0, 0.0, 6.0, 0.0]])
    / 6.0,
    "linear": np.array([[1.0, 0.0], [0.0, 1.0]]),
}


class _Segments:
    """Segments of curves of one basis, with the places of their control points."""

    def __init__(self, counts: NDArray[np.int64], basis: str, wrap: str) -> None:
        step, width = {"linear": (1, 2), "bezier": (3, 4)}.get(basis, (1, 4))
        self.pinned = wrap == "pinned" and width == 4 and basis != "bezier"
        self.counts, self.matrix, self.whole = counts, _BASES[basis], True
        if wrap == "periodic":
            self.number = counts // step
            self.whole = bool((counts % step == 0).all())
        else:
            self.number = (counts + 2 * self.pinned - width) // step + 1
            self.whole = bool(((counts + 2 * self.pinned - width) % step == 0).all())
        self.whole &= len(counts) > 0 and bool((self.number >= 1).all())
        self.of = np.repeat(np.arange(len(counts)), np.maximum(self.number, 0))
        self.begins = np.cumsum(counts) - counts
        first = np.cumsum(self.number) - self.number
        self.index = np.arange(len(self.of)) - first[self.of]
        self.places = (step * self.index - self.pinned)[:, None] + np.arange(width)
        # values at the ends of segments; the end of a closed curve is its start
        self.closed = wrap == "periodic"
        self.ends = self.number + (0 if self.closed else 1)

    def controls(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """Control points ``(s, 4 or 2, width)`` of values at the points of all curves."""
        count, begin = self.counts[self.of][:, None], self.begins[self.of][:, None]
        if self.closed:
            return product(self.matrix, values[begin + self.places % count])
        inner = values[begin + np.clip(self.places, 0, count - 1)]
        if self.pinned:  # a point beyond an end lies as far from it as the one before
            before = 2.0 * values[begin] - values[begin + 1]
            after = 2.0 * values[begin + count - 1] - values[begin + count - 2]
            inner = np.where((self.places < 0)[..., None], before, inner)
            inner = np.where((self.places >= count)[..., None], after, inner)
        return product(self.matrix, inner)

    def between(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """Values ``(s, 2, width)`` at both ends of every segment, of values at the ends of all segments."""
        begin = (np.cumsum(self.ends) - self.ends)[self.of]
        second = (self.index + 1) % self.ends[self.of] if self.closed else self.index + 1
        return np.stack([values[begin + self.index], values[begin + second]], axis=1)


def curves_of(prim: Any, code: Any, where: str, report: LossReport) -> Curves | None:
    """The curves of a prim; None, with a loss, where their numbers do not fit.

    Those of Catmull and Rom become chains of Bézier curves, exactly, and so do B-splines that are closed or pinned, or
    whose widths are not those of their points.

    Raises:
        SceneError: numbers are not finite.
    """
    curves = UsdGeom.BasisCurves(prim)
    basis, wrap = str(curves.GetBasisAttr().Get()), str(curves.GetWrapAttr().Get())
    basis = "linear" if str(curves.GetTypeAttr().Get()) == "linear" else basis
    points = finite(array_of(curves.GetPointsAttr().Get(code), 3), f"{where}: points")
    counts = array_of(curves.GetCurveVertexCountsAttr().Get(code), 0).astype(np.int64)
    fit = basis in _BASES and bool((counts >= 2).all()) and counts.sum() == len(points)
    segments = _Segments(counts, basis, wrap) if fit else None  # as large as the counts say
    if segments is None or not segments.whole:
        report.add(where, f"curves ({basis}, {wrap}) whose numbers do not fit")
        return None
    given = finite(array_of(curves.GetWidthsAttr().Get(code), 1), f"{where}: widths")
    widths = _of(given, str(curves.GetWidthsInterpolation()), segments, len(points))
    if widths is None:
        what = f"{len(given)} widths of curves, whose number does not fit" if len(given) else "curves without widths"
        report.add(where, what, "widths of 1")
        given = np.ones((1, 1))
        widths = given[None]
    if (given < 0.0).any():
        report.add(where, "widths of curves below zero", "widths of 0")
    normals = finite(array_of(curves.GetNormalsAttr().Get(code), 3), f"{where}: normals")
    across = _of(normals, str(curves.GetNormalsInterpolation()), segments, len(points))
    if across is None and len(normals):
        report.add(where, f"{len(normals)} normals of curves, whose number does not fit", "tubes")
    even = widths.shape[:2] == (1, 1)
    if basis == "bspline" and wrap == "nonperiodic" and (even or len(given) == len(points)):
        rows = np.concatenate([points, np.broadcast_to(widths[0] if even else given, (len(points), 1))], axis=1)
        kept = "bspline"
    else:
        found = segments.controls(points)
        rows = np.concatenate([found, np.broadcast_to(widths, (*found.shape[:2], 1))], axis=2)
        rows = chained(rows, segments.index == 0, found.shape[1] - 1)
        counts = (found.shape[1] - 1) * segments.number + 1
        kept = "linear" if basis == "linear" else "bezier"
    if across is not None:
        ends = np.broadcast_to(across, (len(segments.of), across.shape[1], 3))[:, [0, -1]]
        across = chained(ends, segments.index == 0, 1).astype(np.float32)
    return Curves(
        rows[:, :3].astype(np.float32), np.maximum(rows[:, 3], 0.0).astype(np.float32), counts.astype(np.int32), kept,
        "tube" if across is None else "ribbon", across,
    )  # fmt: skip


def _of(values: NDArray[np.float64], interpolation: str, segments: _Segments, count: int) -> NDArray[np.float64] | None:
    """Values at the control points of every segment; None if their number does not fit."""
    if len(values) and (interpolation == "constant" or len(values) == 1):
        return values[:1, None]
    if interpolation == "uniform" and len(values) == len(segments.counts):
        return values[segments.of][:, None]
    if interpolation == "vertex" and len(values) == count:
        return segments.controls(values)
    if interpolation in ("varying", "faceVarying") and len(values) == segments.ends.sum():
        ends, at = segments.between(values), np.linspace(0.0, 1.0, segments.matrix.shape[0])[:, None]
        return ends[:, :1] + at * (ends[:, 1:] - ends[:, :1])
    return None
