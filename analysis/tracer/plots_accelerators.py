"""Figure of tests per ray against triangle count; computes nothing."""

from __future__ import annotations

import itertools

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from analysis.page.figures import ADAPTIVE, FRAMED, OTHER

_INK = {"brute": OTHER, "kdtree": FRAMED, "bvh": ADAPTIVE}
_LABEL = {"brute": "brute force", "kdtree": "kd-tree", "bvh": "tree of boxes"}


def tests_figure(rows: pd.DataFrame) -> Figure:
    """Two panels: triangle tests and node visits per ray; full lines for camera rays, broken ones for random rays."""
    figure = Figure(figsize=(9.0, 3.8), layout="constrained")
    for axis, column, label in zip(
        figure.subplots(1, 2), ("tests_per_ray", "visits_per_ray"), ("triangle tests", "node visits"), strict=True
    ):
        for name, kind in itertools.product(_INK, ("camera", "random")):
            part = rows[(rows["structure"] == name) & (rows["rays"] == kind)]
            if np.asarray(part[column]).max(initial=0.0) > 0.0:
                style = "-" if kind == "camera" else "--"
                axis.loglog(part["triangles"], part[column], style, marker="o", ms=3.5, color=_INK[name],
                            label=f"{_LABEL[name]}, {kind} rays")  # fmt: skip
        axis.set_xlabel("triangles")
        axis.set_ylabel(f"{label} per ray")
        axis.grid(True, which="major", alpha=0.3)
        axis.legend(fontsize=7)
    return figure
