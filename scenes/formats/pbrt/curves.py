"""Curves of PBRT v3 and v4.

Source: PBRT v3 file format, shape ``curve``; ``CreateCurveShape`` of its source.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator

import numpy as np

from scenes.canonical import Curves, SceneError
from scenes.formats.directives.syntax import Parameters
from scenes.formats.geometry.curves import as_bezier, bezier_segments, normals_at_ends
from scenes.formats.losses import LossReport
from scenes.formats.text.numbers import listed, number

_KINDS = ("flat", "cylinder", "ribbon")
_SPLIT = "splitdepth"
_ALIKE = 1e-4  # difference of widths that is none, relative to the greatest


def read_curve(parameters: Parameters, report: LossReport) -> Curves:
    """One curve, whose width runs evenly from its start to its end.

    Raises:
        SceneError: it has no such points, or an unknown kind, basis or degree.
    """
    where = str(parameters.place)
    kind, basis = parameters.text("type", "flat"), parameters.text("basis", "bezier")
    degree = parameters.whole("degree", 3, 2, 3)
    if kind not in _KINDS or basis not in ("bezier", "bspline"):
        raise SceneError(
            f"{where}: curve: expected flat, cylinder or ribbon, bezier or bspline, got {kind!r}, {basis!r}"
        )
    if _SPLIT in parameters:
        parameters.asked.add(_SPLIT)
        report.hint(where, f"{_SPLIT} of a curve", "the renderer's own")
    points = parameters.numbers("P")
    count = 0 if points is None or len(points) % 3 else len(points) // 3
    if points is None or count <= degree or (basis == "bezier" and (count - 1) % degree):
        raise SceneError(f"{where}: curve: expected points P for whole segments of degree {degree}")
    width = parameters.number("width", 1.0)
    ends = parameters.number("width0", width), parameters.number("width1", width)
    if min(ends) < 0.0:
        raise SceneError(f"{where}: curve: expected widths of at least 0, got {min(ends):g}")
    rows = points.reshape(-1, 3)
    segments = (count - 1) // degree if basis == "bezier" else count - degree
    if degree == 2:
        rows, basis = _raised(rows, segments, basis), "bezier"
    if basis == "bspline" and min(ends) < max(ends) / (
        segments + 1
    ):  # of which a width at its control points is below 0
        made = Curves(rows.astype(np.float32), np.zeros(count, np.float32), np.array([count], np.int32))
        rows, basis = as_bezier(made).points.astype(np.float64), "bezier"
    at = np.arange(len(rows)) / 3.0 if basis == "bezier" else np.arange(len(rows)) - 1.0
    widths = ends[0] + (ends[1] - ends[0]) * at / segments
    return Curves(
        rows.astype(np.float32),
        np.maximum(widths, 0.0).astype(np.float32),
        np.array([len(rows)], np.int32),
        basis,  # type: ignore[arg-type]
        kind,  # type: ignore[arg-type]
        _normals(parameters, kind, segments, report),
    )


def _raised(rows: np.ndarray, segments: int, basis: str) -> np.ndarray:
    """Points of quadratic curves as those of cubic Bézier curves."""
    if basis == "bspline":
        middle = 0.5 * (rows[:-1] + rows[1:])
        parts = np.stack([middle[:-1], rows[1:-1], middle[1:]], axis=1)
    else:
        parts = rows[2 * np.arange(segments)[:, None] + np.arange(3)]
    inner = (parts[:, :2] * [[[1.0], [2.0]]] + parts[:, 1:] * [[[2.0], [1.0]]]) / 3.0
    return np.concatenate([np.concatenate([parts[:, :1], inner], axis=1).reshape(-1, 3), parts[-1, 2:]])


def _normals(parameters: Parameters, kind: str, segments: int, report: LossReport) -> np.ndarray | None:
    found = parameters.numbers("N")
    if kind != "ribbon":
        if found is not None:
            report.hint(str(parameters.place), "normals of a curve that is no ribbon")
        return None
    if found is None or len(found) != 3 * (segments + 1):
        raise SceneError(f"{parameters.place}: curve: expected {segments + 1} normals N of a ribbon")
    return found.reshape(-1, 3).astype(np.float32)


def curve_lines(curves: Curves, report: LossReport, where: str) -> Iterator[str]:
    """A directive for each curve. Curves whose width does not run evenly are cut into their segments."""
    if curves.kind == "tube":
        report.add(where, "curves that are tubes", "ribbons that face the viewer, shaded as tubes")
        curves = dataclasses.replace(curves, kind="cylinder")
    if curves.basis == "linear" or not _even(curves):
        curves = as_bezier(curves)
        if not _even(curves):
            curves = _cut(curves)
        if not _even(curves):
            report.add(where, "widths that do not run evenly", "evenly from end to end of each segment")
    begins = np.concatenate([[0], np.cumsum(curves.counts)])
    first = np.concatenate([[0], np.cumsum(curves.segments + 1)])
    for index, ends in enumerate(_ends(curves)):
        rows = slice(begins[index], begins[index + 1])
        basis = ' "string basis" [ "bspline" ]' if curves.basis == "bspline" else ""
        line = f'Shape "curve" "string type" [ "{curves.kind}" ]{basis} "point P" {listed(curves.points[rows].ravel())}'
        line += f' "float width0" [ {number(ends[0])} ] "float width1" [ {number(ends[1])} ]'
        if curves.normals is not None:
            line += f' "normal N" {listed(curves.normals[first[index] : first[index + 1]].ravel())}'
        yield line


def _ends(curves: Curves) -> np.ndarray:
    """Widths at the start and end of each curve, ``(c, 2)``."""
    bezier = as_bezier(curves)
    last = np.cumsum(bezier.counts) - 1
    return np.stack([bezier.widths[last - bezier.counts + 1], bezier.widths[last]], axis=1).astype(np.float64)


def _even(curves: Curves) -> bool:
    """Whether the width of each curve runs evenly from its start to its end."""
    bezier, ends = as_bezier(curves), _ends(curves)
    of = np.repeat(np.arange(len(bezier.counts)), bezier.counts)
    at = np.arange(len(of)) - np.repeat(np.cumsum(bezier.counts) - bezier.counts, bezier.counts)
    share = at / (bezier.counts[of] - 1)
    wanted = ends[of, 0] * (1.0 - share) + ends[of, 1] * share
    return bool((np.abs(bezier.widths - wanted) <= _ALIKE * max(float(bezier.widths.max()), 1e-30)).all())


def _cut(curves: Curves) -> Curves:
    """Each segment of chains of Bézier curves as a curve of its own."""
    segments, _ = bezier_segments(curves)
    rows, normals = segments.reshape(-1, 4).astype(np.float32), normals_at_ends(curves)
    normals = None if normals is None else normals.reshape(-1, 3)
    counts = np.full(len(segments), 4, np.int32)
    return dataclasses.replace(curves, points=rows[:, :3], widths=rows[:, 3], counts=counts, normals=normals)
