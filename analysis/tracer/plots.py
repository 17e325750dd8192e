"""Figures of acceleration structures and of point sets; computes nothing.

Those of point sets follow figures 4, 5, 7 and 9 of the motion-blur perception thesis.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence

import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from numpy.typing import NDArray

from analysis.page.figures import ADAPTIVE, FRAMED, OTHER, label_ends, line_style

_STRUCTURE_INK = {"brute": OTHER, "kdtree": FRAMED, "bvh": ADAPTIVE}
_MARK = dict(zip(_STRUCTURE_INK, ("s", "^", "o"), strict=True))
_LABEL = {"brute": "brute force", "kdtree": "kd-tree", "bvh": "tree of boxes"}


def tests_figure(rows: pd.DataFrame) -> Figure:
    """Two panels: triangle tests and node visits per ray, with solid lines for camera rays and dashed ones for random
    rays."""
    figure = Figure(figsize=(9.0, 3.8), layout="constrained")
    for axis, column, label in zip(
        figure.subplots(1, 2), ("tests_per_ray", "visits_per_ray"), ("triangle tests", "node visits"), strict=True
    ):
        for name, kind in itertools.product(_STRUCTURE_INK, ("camera", "random")):
            part = rows[(rows["structure"] == name) & (rows["rays"] == kind)]
            if np.asarray(part[column]).max(initial=0.0) > 0.0:
                style = "-" if kind == "camera" else "--"
                axis.loglog(part["triangles"], part[column], style, marker=_MARK[name], ms=3.5,
                            color=_STRUCTURE_INK[name], label=f"{_LABEL[name]}, {kind} rays")  # fmt: skip
        axis.set_xlabel("triangles")
        axis.set_ylabel(f"{label} per ray")
        axis.grid(True, which="major", alpha=0.3)
        label_ends(axis)
    return figure


def projections_figure(sets: Mapping[str, NDArray[np.float64]]) -> Figure:
    """Points on the pixel, without their times (figure 4)."""
    figure = Figure(figsize=(2.1 * len(sets), 2.4), layout="constrained")
    for axis, (name, points) in zip(np.atleast_1d(figure.subplots(1, len(sets))), sets.items(), strict=True):
        axis.plot(points[:, 0], points[:, 1], "k.", ms=3)
        axis.set(xlim=(0, 1), ylim=(0, 1), aspect="equal", title=name, xticks=(0, 0.5, 1), yticks=(0, 0.5, 1))
    return figure


def frames_figure(frames: Mapping[tuple[str, int], NDArray[np.uint8]]) -> Figure:
    """Motion blur by point set and number of samples (figure 5)."""
    sets, levels = list(dict.fromkeys(key[0] for key in frames)), list(dict.fromkeys(key[1] for key in frames))
    figure = Figure(figsize=(2.6 * len(sets), 2.6 * len(levels)), layout="constrained")
    axes = figure.subplots(len(levels), len(sets), squeeze=False)
    for row, level in enumerate(levels):
        for column, name in enumerate(sets):
            axes[row, column].imshow(frames[name, level], interpolation="nearest")
            axes[row, column].set(xticks=(), yticks=())
            if row == 0:
                axes[row, column].set_title(name)
        axes[row, 0].set_ylabel(f"{level} samples a pixel")
    return figure


def warp_figure(points: NDArray[np.float64], warped: NDArray[np.float64]) -> Figure:
    """A point set before and after the Gaussian warp, in pixels from the centre (figure 7)."""
    figure = Figure(figsize=(7.0, 3.5), layout="constrained")
    for axis, places, title in zip(
        figure.subplots(1, 2), (points - 0.5, warped), ("unmodified", "Gaussian-warped"), strict=True
    ):
        axis.plot(places[:, 0], places[:, 1], "k.", ms=4)
        axis.set(xlim=(-2, 2), ylim=(-2, 2), aspect="equal", title=title, xlabel="pixels", ylabel="pixels")
    return figure


def time_figure(rows: Mapping[str, NDArray[np.float64]]) -> Figure:
    """Evenly spaced times, before and after the warps of the time filters (figure 9)."""
    figure = Figure(figsize=(7.0, 2.0), layout="constrained")
    axis = figure.subplots()
    for number, (name, times) in enumerate(rows.items()):
        axis.plot(times, np.full(len(times), -number), "k|", ms=14)
        axis.text(-0.02, -number, name, ha="right", va="center")
    axis.set(xlim=(-0.02, 1.02), ylim=(0.6 - len(rows), 0.6), yticks=(), xlabel="time, share of the shutter's")
    return figure


def convergence_figure(errors: pd.DataFrame, sets: Sequence[str], kinds: Sequence[str]) -> Figure:
    """Mean squared error against the number of points, with a panel for each integrand."""
    figure = Figure(figsize=(4.0 * len(kinds), 3.6), layout="constrained")
    for axis, kind in zip(np.atleast_1d(figure.subplots(1, len(kinds))), kinds, strict=True):
        for style, name in enumerate(sets):
            part = errors[(errors["set"] == name) & (errors["integrand"] == kind) & (errors["points"] > 1)]
            axis.loglog(part["points"], np.maximum(part["mse"], 1e-12), ".", label=name, **line_style(style))
        axis.set(title=kind, xlabel="samples", ylabel="mean squared error")
        axis.grid(True, alpha=0.3)
    for axis in figure.axes:
        label_ends(axis)
    return figure
