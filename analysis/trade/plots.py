"""The trade as figures; computes only positions on the paper."""

from __future__ import annotations

from pathlib import Path
from textwrap import wrap
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter

from analysis.metrics.front import knee, on_front
from analysis.page.figures import ADAPTIVE, FRAMED, GRID, OTHER, label_points
from analysis.trade.knobs import KNOBS, OWN, said
from analysis.trade.runs import SEARCH
from analysis.trade.tables import Relative, lines

_LABELS_APART = 0.15
"""Least distance of points that are labelled with their setting: sum of both differences of natural logarithms."""


def _plain(axis: Axes, xlabel: str, ylabel: str) -> None:
    axis.spines[["top", "right"]].set_visible(False)
    axis.grid(True, **GRID)
    axis.set_axisbelow(True)
    axis.set_xscale("log")
    axis.set_yscale("log")
    axis.set_xlabel(xlabel)
    axis.set_ylabel(ylabel)


def _short_ticks(axis: Axes) -> None:
    for one in (axis.xaxis, axis.yaxis):
        one.set_major_formatter(FuncFormatter(lambda x, _: f"{x:g}"))
        one.set_minor_formatter(FuncFormatter(lambda x, _: f"{x:g}" if f"{x:e}"[0] in "235" else ""))
    axis.tick_params(which="minor", labelsize=8)


def front(found: Relative, points: pd.DataFrame) -> Figure:
    """Cost and error of all settings over those of the default, and the front with its band and its knee."""
    drawn = Figure(figsize=(11.0, 6.5), layout="constrained")
    axis = drawn.subplots()
    _plain(axis, "cost over that of the default (log scale)", "mean squared error over that of the default (log scale)")
    _short_ticks(axis)
    of_search = set(points["setting"][points["knob"] == SEARCH])
    of_policies = set(points["setting"][points["policy"] != OWN])
    table, bands = found.front, found.bands
    assert bands is not None
    inks = [FRAMED if name in of_policies else ADAPTIVE if name in of_search else OTHER for name in table["setting"]]
    for ink, mark, label in (
        (OTHER, "^", "a knob of tsar alone"), (ADAPTIVE, "o", "the search"), (FRAMED, "s", "another policy")
    ):  # fmt: skip
        kept = [ink == one for one in inks]
        if any(kept):
            axis.plot(
                table["cost"][kept], table["error"][kept], mark, color=ink, markersize=4.5, alpha=0.75, label=label
            )
    seen = np.isfinite(bands.high)
    axis.fill_between(bands.budgets[seen], bands.low[seen], bands.high[seen], color=ADAPTIVE, alpha=0.15, linewidth=0,
                      label="95 % of the draws", step="post")  # fmt: skip
    best = lines(table, table["on_front"]).sort_values("cost")
    axis.step(best["cost"], best["error"], color="0.15", linewidth=1.2, where="post", label="front")
    at = lines(table, table["knee"])
    axis.plot(at["cost"], at["error"], "*", color="k", markersize=15, label="knee")
    axis.plot([1.0], [1.0], "s", markerfacecolor="none", markeredgecolor="k", markersize=10, label="default")
    for number, line in enumerate(sorted(_apart(best.to_dict("records")), key=lambda line: line["cost"]), 1):
        text = "\n".join(wrap(line["setting"].removeprefix("tsar, "), 36))
        axis.plot(
            [],
            [],
            marker=f"${number}$",
            color="0.1",
            markersize=2 + 3 * len(str(number)),
            markeredgewidth=0,
            linestyle="",
            label=text,
        )
        axis.annotate(str(number), (line["cost"], line["error"]), xytext=(-7, -4), textcoords="offset points",
                      fontsize=8, ha="right", va="top", color="0.1")  # fmt: skip
    drawn.legend(frameon=False, fontsize=8, loc="outside right upper")
    return drawn


def _apart(best: list[dict[Any, Any]]) -> list[dict[Any, Any]]:
    """Points of the front that are far enough from each other to be labelled, always with the knee."""
    kept: list[dict[Any, Any]] = [line for line in best if line["knee"]]
    for line in best:
        near = (abs(np.log(line["cost"] / one["cost"])) + abs(np.log(line["error"] / one["error"])) for one in kept)
        if min(near, default=np.inf) > _LABELS_APART:
            kept.append(line)
    return kept


def knobs(table: pd.DataFrame) -> Figure:
    """A panel for each knob: cost and error of its values over those of its default, with bars for 95 % of the
    draws."""
    names = list(dict.fromkeys(table["knob"]))
    columns = min(4, len(names))
    rows = -(-len(names) // columns)
    drawn = Figure(figsize=(3.4 * columns, 2.7 * rows + 0.4), layout="constrained")
    panels = drawn.subplots(rows, columns, squeeze=False)
    for axis in panels.flat[len(names) :]:
        axis.set_visible(False)
    low, high = table[["cost_flops"]].min().item() / 1.15, table[["cost_flops"]].max().item() * 1.6  # room for labels
    for axis, name in zip(panels.flat, names, strict=False):
        _plain(axis, "cost", "error")
        _short_ticks(axis)
        axis.set_title(name, fontsize=10, loc="left")
        own = lines(table, table["knob"] == name).sort_values("cost_flops")
        x, y = own["cost_flops"].to_numpy(), own["mse"].to_numpy()
        spread = np.stack((y - own["mse_low"].to_numpy(), own["mse_high"].to_numpy() - y)).clip(min=0.0)
        axis.axhline(1.0, color="0.6", linewidth=0.8)
        axis.axvline(1.0, color="0.6", linewidth=0.8)
        joined = "-" if name != "policy" else ""
        axis.errorbar(x, y, spread, fmt=f"o{joined}", color=ADAPTIVE, markersize=4, linewidth=1.0, capsize=2)
        axis.set_xlim(low, high)
        least, most = min(0.8, own["mse_low"].min() / 1.1), max(1.25, own["mse_high"].max() * 1.15)
        axis.set_ylim(least, most)
    for axis, name in zip(panels.flat, names, strict=False):
        own = lines(table, table["knob"] == name)
        labels, default = [str(value) for value in own["value"]], said(KNOBS[name].default)
        label_points(axis, own[["cost_flops", "mse"]].to_numpy(), labels, 5.5 if len(own) > 8 else 7, default)
    return drawn


def inputs(points: pd.DataFrame) -> Figure:
    """A panel for each input: FLOPs and error of all points of all seeds, and the front and the knee of the first
    seed."""
    names = list(dict.fromkeys(points["input"]))
    columns = min(3, len(names))
    rows = -(-len(names) // columns)
    drawn = Figure(figsize=(4.4 * columns, 3.6 * rows), layout="constrained")
    panels = drawn.subplots(rows, columns, squeeze=False)
    for axis in panels.flat[len(names) :]:
        axis.set_visible(False)
    for axis, name in zip(panels.flat, names, strict=False):
        _plain(axis, "FLOPs of the run", "mean squared error")
        axis.set_title(Path(name).name, fontsize=10, loc="left")
        own = lines(points, points["input"] == name)
        axis.plot(own["cost_flops"], own["mse"], "o", color=OTHER, markersize=3, alpha=0.6)
        one = lines(own, own["seed"] == own["seed"].min())
        x, y = one["cost_flops"].to_numpy(), one["mse"].to_numpy()
        best = lines(one, on_front(x, y)).sort_values("cost_flops")
        axis.step(best["cost_flops"], best["mse"], color="0.15", linewidth=1.2, where="post")
        at = knee(x, y)
        axis.plot(x[at], y[at], "*", color="k", markersize=12)
    return drawn
