"""Curves of USD, such as hair, as meshes: tubes, or ribbons where they have normals.

Source: OpenUSD documentation, UsdGeomBasisCurves.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from scenes.arithmetic import product
from scenes.canonical import Curves, Mesh
from scenes.formats.geometry.curves import TO_BEZIER, curve_mesh
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


def curves_of(prim: Any, code: Any, where: str, report: LossReport) -> Mesh | None:
    """Curves as a mesh; None, with a loss, where their numbers do not fit.

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
    if curves.GetPointsAttr().GetNumTimeSamples() > 1:
        report.add(where, "curves that move", "their places at the start")
    found = segments.controls(points)
    width = found.shape[1]
    given = finite(array_of(curves.GetWidthsAttr().Get(code), 1), f"{where}: widths")
    if not len(given):
        report.add(where, "curves without widths", "curves of width 1")
    widths = _of(given, str(curves.GetWidthsInterpolation()), segments, len(points)) if len(given) else None
    if widths is None:
        widths = np.ones((1, width, 1))
        if len(given):
            report.add(where, f"{len(given)} widths of curves, whose number does not fit", "widths of 1")
    normals = finite(array_of(curves.GetNormalsAttr().Get(code), 3), f"{where}: normals")
    across = _of(normals, str(curves.GetNormalsInterpolation()), segments, len(points)) if len(normals) else None
    report.hint(where, f"{len(counts):,} curves", "tubes of twelve sides" if across is None else "ribbons")
    shape = (len(found), width)
    made = Curves(
        found.reshape(-1, 3).astype(np.float32),
        np.maximum(np.broadcast_to(widths[..., 0], shape), 0.0).astype(np.float32).reshape(-1),
        np.full(len(found), width, np.int32),
        "linear" if basis == "linear" else "bezier",
        "tube" if across is None else "ribbon",
        None if across is None else np.broadcast_to(across, (*shape, 3))[:, [0, -1]].reshape(-1, 3).astype(np.float32),
    )
    return curve_mesh(made)


def _of(values: NDArray[np.float64], interpolation: str, segments: _Segments, count: int) -> NDArray[np.float64] | None:
    """Values at the control points of every segment; None if their number does not fit."""
    if interpolation == "constant" or len(values) == 1:
        return values[:1, None]
    if interpolation == "uniform" and len(values) == len(segments.counts):
        return values[segments.of][:, None]
    if interpolation == "vertex" and len(values) == count:
        return segments.controls(values)
    if interpolation in ("varying", "faceVarying") and len(values) == segments.ends.sum():
        ends, at = segments.between(values), np.linspace(0.0, 1.0, segments.matrix.shape[0])[:, None]
        return ends[:, :1] + at * (ends[:, 1:] - ends[:, :1])
    return None
