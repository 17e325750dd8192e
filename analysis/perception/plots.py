"""Figures of the thesis: share of right answers against samples per pixel (19 to 25), of which only the curves are
computed here; and rows of pictures and densities of filters (3, 6, 8, 10, 15, 17, 18)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from analysis.page.figures import FRAMED, INKS, MARKERS, ink_of, label_ends, line_style
from analysis.perception.psychometrics import TWO_ALTERNATIVES, Rule, correct_share


def psychometric_figure(
    trials: pd.DataFrame,
    column: str,
    fitted: Mapping[str, Mapping[str, Any]],
    kind: str,
    rule: Rule = TWO_ALTERNATIVES,
) -> Figure:
    """A curve for each value of a column.

    Args:
        trials: answered trials.
        column: ``scene`` or ``point_set``.
        fitted: rows of fits by value of the column; failed fits have no ``mu``.
        kind: kind of the observers, which the title of every figure states.
        rule: guess rate and threshold of the fits.
    """
    figure = Figure(figsize=(5.6, 3.9), layout="constrained")
    axis = figure.subplots()
    for style, (value, row) in enumerate(fitted.items()):
        _curve(axis, trials.loc[trials[column] == value], row, str(value), style, rule.guess)
    axis.axhline(rule.threshold, color="0.3", ls="--", lw=0.9)
    axis.axhline(rule.guess, color="0.3", ls=":", lw=0.9)
    levels = sorted(trials["samples"].unique())
    axis.set(xscale="log", xlabel="samples per pixel", ylabel="share right", ylim=(rule.guess - 0.15, 1.02))
    apart = [levels[0]]
    for level in levels[1:]:
        if level > 1.65 * apart[-1]:  # labels of nearer levels would overlap
            apart.append(level)
    axis.set_xticks(apart, [f"{int(level)}" for level in apart], minor=False)
    axis.set_xticks([], minor=True)
    axis.set_title(f"{kind} observers, N = {trials['observer'].nunique()}", fontsize=10)
    label_ends(axis)
    return figure


def _curve(axis: Axes, part: pd.DataFrame, row: Mapping[str, Any], label: str, style: int, guess: float) -> None:
    """Means over observers with their standard errors, and the fitted function."""
    ink, mark = INKS[ink_of(style)], MARKERS[style % len(MARKERS)]
    shares = part.pivot_table("correct", "observer", "samples")
    levels = np.asarray(shares.columns, np.float64)
    by_level = [column[np.isfinite(column)] for column in shares.to_numpy(np.float64).T]
    errors = [values.std(ddof=1) / np.sqrt(len(values)) if len(values) > 1 else 0.0 for values in by_level]
    means = [values.mean() for values in by_level]
    axis.errorbar(levels, means, errors, fmt=mark, ms=4, color=ink, capsize=2, label="_means")
    named = {"marker": mark, "ms": 4, "markevery": [], **line_style(style)}  # beside its label the curve has the mark
    if np.isfinite(row.get("mu", np.nan)):
        x = np.geomspace(levels[0], levels[-1], 200)
        jnd = f"{row['jnd']:.0f}" if 0.0 < row["jnd"] < np.inf else f"{row['status']} all levels"
        shares = correct_share(x, row["mu"], row["sigma"], row["lapse"], guess)
        axis.plot(x, shares, **named, label=f"{label}, JND {jnd}")
    else:
        axis.plot([], [], **named, label=f"{label}, no fit")


def sweep_figure(rows: pd.DataFrame, scenes: Sequence[str]) -> Figure:
    """Just-noticeable differences against the observer's noise."""
    figure = Figure(figsize=(5.0, 3.6), layout="constrained")
    axis = figure.subplots()
    for style, scene in enumerate(scenes):
        part = rows.loc[(rows["scene"] == scene) & (rows["status"] == "within")]
        axis.loglog(part["sigma_jod"], part["jnd"], marker="o", ms=4, label=scene, **line_style(style))
    sigmas = sorted({float(value) for value in rows["sigma_jod"]})
    axis.set_xticks(sigmas, [f"{value:g}" for value in sigmas], minor=False)
    axis.set_xticks([], minor=True)
    axis.set(xlabel="noise of a stimulus, JOD", ylabel="just noticeable, samples per pixel")
    axis.grid(True, alpha=0.3)
    label_ends(axis)
    return figure


def row_figure(pictures: Mapping[str, NDArray[np.uint8]]) -> Figure:
    """Encoded pictures side by side under their titles, a pixel of each at least as large as one of the figure."""
    figure = Figure(figsize=(2.6 * len(pictures), 2.9), layout="constrained")
    for axis, (title, picture) in zip(np.atleast_1d(figure.subplots(1, len(pictures))), pictures.items(), strict=True):
        axis.imshow(picture, interpolation="nearest")
        axis.set(xticks=(), yticks=(), title=title)
    return figure


def densities_figure(filters: Mapping[str, tuple[NDArray[np.float64], NDArray[np.float64]]]) -> Figure:
    """Densities of time filters over the time for which the shutter is open."""
    figure = Figure(figsize=(3.4 * len(filters), 2.4), layout="constrained")
    axes = figure.subplots(1, len(filters), sharey=True)
    for axis, (title, (times, density)) in zip(axes, filters.items(), strict=True):
        axis.plot(times, density, color=FRAMED)
        axis.set(title=title, xlabel="time, share of the shutter's", xlim=(0, 1), ylim=(0, 2.2))
    axes[0].set_ylabel("density")
    return figure
