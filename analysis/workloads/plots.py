"""The map of workloads as a figure; computes only positions on the paper."""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from analysis.page.figures import ADAPTIVE, FRAMED, inks


def figure(maps: pd.DataFrame) -> Figure:
    """A panel for each side, with the price of a sample on the horizontal axis and the motion between framed images on
    the vertical one. Each cell has the ink and the name of its best policy, and its error over that of framed."""
    sides = sorted(set(maps["side_px"]))
    drawn = Figure(figsize=(2.0 + 6.2 * len(sides), 4.6), layout="constrained")
    axes = drawn.subplots(1, len(sides), squeeze=False)[0]
    names = list(dict.fromkeys(maps["best"]))
    colors = inks([name for name in names if name not in ("tsar", "framed")], "tsar")
    colors |= {"tsar": ADAPTIVE, "framed": FRAMED}
    for axis, side in zip(axes, sides, strict=True):
        here: Any = maps[maps["side_px"] == side]
        prices = sorted(set(here["sample_flops"]))
        rates = sorted(set(here["image_hz"]), reverse=True)
        cells = {(line["sample_flops"], line["image_hz"]): line for line in here.to_dict("records")}
        for (column, price), (row, rate) in itertools.product(enumerate(prices), enumerate(rates)):
            line = cells.get((price, rate))
            if line is None:
                continue
            # paler cells are closer to the second policy
            share = 1.0 - min(1.0, line["ratio"] / line["second ratio"]) if np.isfinite(line["second ratio"]) else 1.0
            face = (colors[line["best"]], 0.2 + 0.6 * share)
            axis.add_patch(Rectangle((column, row), 1, 1, facecolor=face, edgecolor="white", linewidth=2))
            middle = column + 0.5, row + 0.5
            axis.text(*middle, f"{line['best']}\n{line['ratio']:.2f}", ha="center", va="center", fontsize=9)
        axis.set_xlim(0, len(prices))
        axis.set_ylim(0, len(rates))
        axis.set_xticks(np.arange(len(prices)) + 0.5, [f"{price:g}" for price in prices])
        axis.set_yticks(np.arange(len(rates)) + 0.5, [f"{rate:g}" for rate in rates])
        axis.set_xlabel("FLOPs of a sample")
        axis.set_ylabel("framed images a second (upwards: more moves between two)")
        axis.set_title(f"{side:g} px", fontsize=10)
        axis.tick_params(length=0)
        axis.spines[:].set_visible(False)
    return drawn
