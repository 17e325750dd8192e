"""What all figures share: axes, colours and files."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from numpy.typing import NDArray

from analysis.storage.files import atomic

Floats = NDArray[np.float64]

ADAPTIVE, FRAMED, OTHER = "#c9570c", "#1f6fb4", "#5a8f29"
_RIVALS = (FRAMED, OTHER, "#8a56ac", "#b8860b", "#2a9d8f", "#b5485d", "#6b6b6b")
_GRID = {"color": "0.85", "linewidth": 0.6}


def save(figure: Figure, path: Path, dpi: int = 130) -> None:
    """Writes a figure as PNG, atomically."""
    FigureCanvasAgg(figure)
    with atomic(path) as temporary:
        figure.savefig(temporary, dpi=dpi, format="png")


def inks(runs: Sequence[str], own: str) -> dict[str, str]:
    """A colour for each run; the rivals' repeat where there are many."""
    rivals = itertools.cycle(_RIVALS)
    return {name: ADAPTIVE if name == own else next(rivals) for name in runs}


def new_figure(width: float, height: float, rows: int = 1, **kwargs) -> tuple[Figure, NDArray]:
    figure = Figure(figsize=(width, height), layout="constrained")
    axes = figure.subplots(rows, 1, squeeze=False, **kwargs)[:, 0]
    for axis in axes:
        axis.spines[["top", "right"]].set_visible(False)
        axis.grid(True, **_GRID)
        axis.set_axisbelow(True)
    return figure, axes
