"""Figures of a comparison; computes only positions on the paper."""

from __future__ import annotations

import textwrap
from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from analysis.metrics.arrays import Floats
from analysis.page.figures import ADAPTIVE, FRAMED, label_ends, line_style, new_figure, plain_log, styles

_TITLE_CHARACTERS = 105  # characters in a line above the figure


def error_figure(
    times_s: Floats,
    errors: Mapping[str, Floats],
    own: str,
    ratio: Floats,
    refresh_s: Sequence[float],
    title: str,
) -> Figure:
    """Errors over time above the ratio of two of them (figs 7.14 and 7.15).

    Args:
        times_s: reference times, seconds.
        errors: MSE of every run by name; the rival is the first that is not ``own``.
        own: the run whose ratio is shown.
        ratio: its error over that of the rival; infinite values are marked along the upper edge.
        refresh_s: times at which the rival's display changes.
        title: text above the figure.
    """
    rivals = [name for name in errors if name != own]
    rows = {"rows": 2, "height_ratios": (3, 2)} if rivals else {"rows": 1}
    figure, axes = new_figure(9.0, 5.6 if rivals else 3.4, sharex=True, **rows)
    upper = axes[0]
    for axis in axes:
        axis.vlines(refresh_s, 0, 1, transform=axis.get_xaxis_transform(), color="0.75", linewidth=0.7, linestyle=":")
    for name, style in styles(list(errors), own).items():
        values = errors[name]
        upper.plot(times_s, np.where(values > 0, values, np.nan), label=name, **line_style(style))
    upper.set_yscale("log")
    upper.set_ylabel("mean squared error")
    upper.set_title(textwrap.fill(title, _TITLE_CHARACTERS), fontsize=10, loc="left", parse_math=False)
    if rivals:
        _draw_ratio(axes[-1], times_s, ratio, f"{own} / {rivals[0]}")
    marked = f"   (dotted: the display of {rivals[0]} changes)" if rivals else ""
    axes[-1].set_xlabel(f"simulated time, s{marked}")
    axes[-1].set_xlim(times_s[0], times_s[-1])
    label_ends(upper)
    return figure


def _draw_ratio(axis: Axes, times_s: Floats, ratio: Floats, label: str) -> None:
    """A ratio over time; infinite values are marked along the upper edge."""
    shown = np.where(np.isfinite(ratio) & (ratio > 0), ratio, np.nan)
    axis.plot(times_s, shown, color="0.2", linewidth=1.1)
    infinite = np.isinf(ratio)
    if infinite.any():
        edge = np.full(infinite.sum(), 0.97)
        axis.plot(times_s[infinite], edge, "^", color="0.2", markersize=4, transform=axis.get_xaxis_transform())
    axis.axhline(1.0, color="0.0", linewidth=0.8)
    axis.set_yscale("log")
    _widen(axis, shown)
    axis.set_ylabel(label)


def _widen(axis, values: Floats) -> None:
    """Widens a ratio axis to at least a factor of 3 around 1."""
    finite = values[np.isfinite(values)]
    low, high = (finite.min(), finite.max()) if finite.size else (1.0, 1.0)
    axis.set_ylim(min(low * 0.8, 1 / 3), max(high * 1.25, 3.0))
    plain_log(axis.yaxis)


def stage_figure(modelled: Mapping[str, float], measured: Mapping[str, float]) -> Figure:
    """Share of a cycle of each stage, by the cost model and as measured."""
    names = list(dict.fromkeys((*modelled, *measured)))
    figure, (axis,) = new_figure(9.0, 2.8)
    place = np.arange(len(names))
    for shift, values, ink, hatch, label in (
        (-0.2, modelled, FRAMED, "//", "modelled operations"),
        (0.2, measured, ADAPTIVE, "", "measured seconds"),
    ):
        total = sum(values.values()) or 1.0
        share = [100.0 * values.get(name, 0.0) / total for name in names]
        bars = axis.bar(place + shift, share, 0.38, color=ink, hatch=hatch, edgecolor="white", linewidth=0, label=label)
        axis.bar_label(bars, fmt="%.1f", fontsize=7, padding=1)
    axis.set_xticks(place, names)
    axis.set_ylabel("share of a cycle, %")
    axis.set_ylim(0, 108)
    figure.legend(frameon=False, fontsize=8, ncols=2, loc="outside upper left")
    return figure
