"""Shared by all figures: axes, inks, dashes, labels at the ends of lines, and files.

Inks are those of Okabe and Ito (2008), which people who confuse red and green can tell apart. Each has its own dash
pattern, so that a figure in grey can be read.
"""

from __future__ import annotations

import io
import itertools
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patheffects import withStroke
from matplotlib.ticker import LogLocator
from matplotlib.transforms import Affine2D, ScaledTranslation, blended_transform_factory
from numpy.typing import ArrayLike, NDArray

from analysis.storage.files import atomic

INKS = ("#d55e00", "#0072b2", "#009e73", "#cc79a7", "#000000", "#e69f00", "#56b4e9")
"""Vermilion is the ink of the run's own policy. Yellow is left out, because it is hard to see on white."""
DASHES = ("", "7 3", "2 2", "8 3 2 3", "5 2 1 2 1 2", "12 3", "1 3")
"""Dash patterns beside the inks, in points or pixels."""
MARKERS = ("o", "s", "^", "D", "v", "P", "X")
"""Marks beside the inks, of points that no line connects."""
ADAPTIVE, FRAMED, OTHER = INKS[:3]
GRID = {"color": "0.88", "linewidth": 0.6}
"""Grid lines behind what is plotted."""
_LINE_PT = 12  # points between labels
_LABEL_GAP_PT = 8  # points from a point to its label
_LEAD_PT = 3, 14, 25  # from the axes to the begin, mark and end of the piece of a line before its label


def save(figure: Figure, path: Path, dpi: int = 130) -> None:
    """Writes a figure as PNG and as SVG of the same name, each atomically and with reproducible bytes."""
    FigureCanvasAgg(figure)
    with atomic(path) as temporary:
        figure.savefig(temporary, dpi=dpi, format="png")
    drawn = io.BytesIO()  # into a file, lines would end as the system has it
    with rc_context({"svg.hashsalt": path.stem}):
        figure.savefig(drawn, format="svg", metadata={"Date": None})
    with atomic(path.with_suffix(".svg")) as temporary:
        temporary.write_bytes(drawn.getvalue())


def styles(runs: Sequence[str], own: str) -> dict[str, int]:
    """The number of ink and dashes of each run: 0 for ``own``, and from 1 on for its rivals."""
    rivals = itertools.count(1)
    return {name: 0 if name == own else next(rivals) for name in runs}


def inks(runs: Sequence[str], own: str) -> dict[str, str]:
    """The ink of each run."""
    return {name: INKS[ink_of(style)] for name, style in styles(runs, own).items()}


def ink_of(style: int) -> int:
    """Index of the ink of a style; inks repeat from the seventh rival on, and that of style 0 does not."""
    return 1 + (style - 1) % (len(INKS) - 1) if style else 0


def dashes_of(style: int) -> str:
    """Dash pattern of a style: an ink that repeats has another pattern each time, so that 37 styles differ."""
    turns = (style - 1) // (len(INKS) - 1) if style else 0
    return DASHES[1 + (ink_of(style) - 1 + turns) % (len(DASHES) - 1)] if style else DASHES[0]


def dashed(style: int, width: float = 1.0) -> Any:
    """Dashes of a matplotlib line of the given width in points; matplotlib multiplies them by the width."""
    dashes = tuple(float(length) / width for length in dashes_of(style).split())
    return (0, dashes) if dashes else "solid"


def line_style(style: int) -> dict:
    """Ink, dashes and width of a matplotlib line."""
    width = 2.0 if style == 0 else 1.4
    ink = INKS[ink_of(style)]
    return {"color": ink, "linewidth": width, "linestyle": dashed(style, width), "zorder": 3 - 0.1 * style}


def plain_log(axis: Axis, subs: Sequence[float] = (1.0, 2.0, 5.0)) -> None:
    """Labels a logarithmic axis with plain numbers, at these multiples of the powers of ten."""
    axis.set_major_locator(LogLocator(subs=tuple(subs)))
    axis.set_major_formatter("{x:g}")
    axis.set_minor_formatter("")


def label_ends(axis: Axes) -> None:
    """Writes the label of every line beside its last point, to the right of the axes, without overlap, after a piece
    of the line with its mark. The scales of the axes must be final."""
    figure = axis.get_figure(root=True)
    assert figure is not None
    known = [line for line in axis.lines if not str(line.get_label()).startswith("_")]
    axis.get_ylim()  # finds the limits, which positions below follow
    ends = []
    for line in known:
        x, y = (np.asarray(values, np.float64) for values in line.get_data())
        shown = np.isfinite(x) & np.isfinite(y)
        point = (x[shown][-1], y[shown][-1]) if shown.any() else (np.nan, np.nan)
        ends.append(line.get_transform().transform(point)[1] if shown.any() else np.nan)
    low, high = axis.transAxes.transform([(0, 0), (1, 1)])[:, 1]
    points = Affine2D().scale(1 / 72) + figure.dpi_scale_trans
    edge = ScaledTranslation(1, 0, axis.transAxes)  # type: ignore[arg-type]
    for line, y in zip(known, spread(ends, _LINE_PT * figure.dpi / 72, low, high), strict=True):
        place = axis.transAxes.inverted().transform((0, y))[1]
        axis.annotate(
            str(line.get_label()), (1.0, place), (_LEAD_PT[-1] + 4, 0), xycoords="axes fraction",
            textcoords="offset points", va="center", fontsize=8, color="0.1", annotation_clip=False,
        )  # fmt: skip
        lead = Line2D([], [])
        lead.update_from(line)
        lead.set(data=(_LEAD_PT, [place] * len(_LEAD_PT)), markevery=[1], label="_lead", clip_on=False)
        lead.set_transform(blended_transform_factory(points + edge, axis.transAxes))
        axis.add_artist(lead)


def label_points(axis: Axes, places: ArrayLike, labels: Sequence[str], size_pt: float, bold: str) -> None:
    """Writes labels to the right of points, without overlap, each with a thin line to its point. The axes and all else
    in the figure must be final.

    Args:
        axis: the axes.
        places: x and y of the points.
        labels: a label each; points that lie close in x share a column of labels.
        size_pt: font size, points.
        bold: the label that is set in bold.
    """
    figure = axis.get_figure(root=True)
    assert figure is not None
    figure.draw_without_rendering()  # finds the size of the axes
    points, pixels = np.asarray(places, np.float64), figure.dpi / 72
    at = axis.transData.transform(points)
    low, high = axis.transAxes.transform([(0, 0), (1, 1)])[:, 1]
    columns, edges = list[list[int]](), list[float]()
    for i in np.argsort(at[:, 0], kind="stable").tolist():
        joined = bool(columns) and at[i, 0] < edges[-1]
        columns = [*columns[:-1], [*columns[-1], i]] if joined else [*columns, [i]]
        width = (_LABEL_GAP_PT + 0.7 * size_pt * max(len(labels[k]) for k in columns[-1])) * pixels
        edges = [*(edges[:-1] if joined else edges), at[i, 0] + width]
    for column in columns:
        right = at[column, 0].max() + _LABEL_GAP_PT * pixels
        ys = spread(at[column, 1].tolist(), 1.25 * size_pt * pixels, low, high)
        for i, y in zip(column, ys, strict=True):
            place = axis.transAxes.inverted().transform((right, y)).tolist()
            axis.annotate(
                labels[i], points[i].tolist(), place, textcoords="axes fraction", va="center", zorder=5,
                fontsize=size_pt, fontweight="bold" if labels[i] == bold else "normal",
                arrowprops={"arrowstyle": "-", "color": "0.6", "linewidth": 0.5, "shrinkA": 0, "shrinkB": 2},
                path_effects=[withStroke(linewidth=1.5, foreground="white")],
            )  # fmt: skip


def spread(wanted: Sequence[float], apart: float, low: float, high: float) -> list[float]:
    """Positions near the wanted ones, in the same order, at least ``apart`` from each other and, if there is room, in
    [``low``, ``high``]; those of NaN come last."""
    order = sorted(range(len(wanted)), key=lambda i: (math.isnan(wanted[i]), wanted[i]))
    found, least = [0.0] * len(wanted), low
    for i in order:
        found[i] = least if math.isnan(wanted[i]) else max(wanted[i], least)
        least = found[i] + apart
    most = high
    for i in reversed(order):
        found[i] = min(found[i], most)
        most = found[i] - apart
    return [round(y, 1) for y in found]


def new_figure(width: float, height: float, rows: int = 1, **kwargs) -> tuple[Figure, NDArray]:
    """A figure of a size in inches, and its ``rows`` axes with grids, one below the other."""
    figure = Figure(figsize=(width, height), layout="constrained")
    axes = figure.subplots(rows, 1, squeeze=False, **kwargs)[:, 0]
    for axis in axes:
        axis.spines[["top", "right"]].set_visible(False)
        axis.grid(True, **GRID)
        axis.set_axisbelow(True)
    return figure, axes
