"""The study of parts as a figure; computes only positions on the paper."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter

from analysis.ablation.parts import WHOLE
from analysis.ablation.tables import ALL, by_input, where
from analysis.metrics.budget import SHARES
from analysis.page.figures import ADAPTIVE, FRAMED, GRID, INKS, MARKERS, OTHER

_SHARE_INKS = dict(zip(SHARES, ("0.42", FRAMED, ADAPTIVE, INKS[5], OTHER), strict=True))
_HATCHES = dict(zip(SHARES, ("", "//", "", "..", "xx"), strict=True))


def figure(parts: pd.DataFrame, budget: pd.DataFrame, floor: pd.DataFrame, row: int) -> Figure:
    """Left: the error with each part changed over that of the whole policy, one dot per input. Right: the terms of the
    error of the whole policy, stacked, and the floor."""
    changes = {label: values for label, values in by_input(parts, "change", row).items() if label != WHOLE}
    height = 1.6 + 0.32 * max(len(changes), 6)
    drawn = Figure(figsize=(12.5, height), layout="constrained")
    left, right = drawn.subplots(1, 2, width_ratios=(1.25, 1.0))
    _changes(left, changes)
    _stacks(right, where(budget, "row", row), where(floor, "row", row))
    return drawn


def _plain(axis: Axes, names: Sequence[str]) -> None:
    axis.spines[["top", "right"]].set_visible(False)
    axis.grid(True, axis="x", **GRID)
    axis.set_axisbelow(True)
    axis.set_yticks(range(len(names)), names)
    axis.set_ylim(len(names) - 0.5, -0.5)


def _changes(axis: Axes, changes: dict[str, dict[str, float]]) -> None:
    _plain(axis, list(changes))
    inputs = list(dict.fromkeys(name for values in changes.values() for name in values if name != ALL))
    axis.axvline(1.0, color="0.2", linewidth=1.0)
    for number, name in enumerate(inputs):
        at = [(values[name], place) for place, values in enumerate(changes.values()) if name in values]
        axis.plot(*zip(*at, strict=True), MARKERS[number % len(MARKERS)], color=INKS[1 + number % 6], markersize=5,
                  alpha=0.85, label=name)  # fmt: skip
    at = [(values[ALL], place) for place, values in enumerate(changes.values())]
    if at:
        axis.plot(*zip(*at, strict=True), "|", color="0.1", markersize=14, markeredgewidth=2, label="geometric mean")
    axis.set_xscale("log")
    axis.xaxis.set_major_formatter(FuncFormatter(lambda x, _: f"{x:g}"))
    axis.xaxis.set_minor_formatter(FuncFormatter(lambda x, _: f"{x:g}" if f"{x:e}"[0] in "235" else ""))
    axis.tick_params(axis="x", which="minor", labelsize=8)
    axis.set_xlabel("mean error over that of the whole policy")
    axis.legend(frameon=False, fontsize=8, ncols=3, loc="lower left", bbox_to_anchor=(-0.05, 1.0))


def _stacks(axis: Axes, budget: pd.DataFrame, floor: pd.DataFrame) -> None:
    names = [str(name) for name in budget["input"]] if len(budget) else []
    _plain(axis, names)
    above, below = np.zeros(len(names)), np.zeros(len(names))
    for share in SHARES if names else ():
        values = budget[share].to_numpy()
        start = np.where(values >= 0.0, above, below)  # shares below 0 lie to the left of it
        axis.barh(range(len(names)), values, left=start, height=0.6, color=_SHARE_INKS[share], hatch=_HATCHES[share],
                  edgecolor="w", label=share)  # fmt: skip
        above, below = above + np.maximum(values, 0.0), below + np.minimum(values, 0.0)
    if names:
        values = floor["floor"].to_numpy()
        for place, value in enumerate(values):
            axis.plot([value, value], [place - 0.42, place + 0.42], color="k", linewidth=2.0)
        axis.plot([], [], color="k", linewidth=2.0, label="floor: a perfect picture of the same latency")
        axis.legend(frameon=False, fontsize=8, ncols=3, loc="lower right", bbox_to_anchor=(1.02, 1.0))
    axis.axvline(0.0, color="0.2", linewidth=0.8)
    axis.set_xlabel("share of the error of tsar, over that of framed")
