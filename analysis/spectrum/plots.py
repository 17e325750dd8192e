"""Figures of spectra, ideal densities and the agreement of the estimate; computes only positions on the paper."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from matplotlib.ticker import FuncFormatter
from numpy.typing import NDArray

from analysis.metrics.arrays import Floats
from analysis.page.figures import ADAPTIVE, FRAMED, GRID, INKS, MARKERS, label_ends
from analysis.spectrum.estimate_check import Example, Tiles
from analysis.spectrum.ideal_density import share_of_total
from analysis.spectrum.spectra import Spectrum

_LEVELS = (0.0, 0.2, 0.4, 0.6, 0.8, 0.9, 0.95, 0.98, 0.99, 0.995, 1.0)


def _plain(axis: Axes) -> None:
    axis.spines[["top", "right"]].set_visible(False)
    axis.grid(True, **GRID)
    axis.set_axisbelow(True)


def slope_figure(spectra: Sequence[Spectrum]) -> Figure:
    """Slopes by group, one dot per spectrum (fig. 1.3)."""
    groups = list(dict.fromkeys(spectrum.group for spectrum in spectra))
    sources = list(dict.fromkeys(s.source for s in spectra if s.group.startswith(("frames", "framelets"))))
    ink = {source: INKS[i % len(INKS)] for i, source in enumerate(sources)}
    mark = {source: MARKERS[i % len(MARKERS)] for i, source in enumerate(sources)}
    figure = Figure(figsize=(8.5, 1.5 + 0.42 * len(groups)), layout="constrained")
    axis = figure.subplots()
    _plain(axis)
    axis.axvline(-2.0, color="0.2", linewidth=1.0, linestyle="--", label="natural imagery, -2")
    for row, group in enumerate(groups):
        members = [spectrum for spectrum in spectra if spectrum.group == group]
        lanes = np.linspace(-0.26, 0.26, len(members)) if len(members) > 1 else [0.0]
        for lane, member in zip(lanes, members, strict=True):
            known = ink.get(member.source, "0.1")
            shape = mark.get(member.source, "o")
            axis.plot(member.slope, row + lane, shape, color=known, markersize=4.5, markeredgewidth=0)
        slopes = [member.slope for member in members]
        axis.plot([np.mean(slopes)] * 2, [row - 0.36, row + 0.36], color="0.2", linewidth=1.6)
    for source in sources:
        axis.plot([], [], mark[source], color=ink[source], markersize=4.5, label=source.replace("$", r"\$"))
    axis.plot([], [], color="0.2", linewidth=1.6, label="mean of the group")
    axis.set_yticks(range(len(groups)), groups)
    axis.set_ylim(len(groups) - 0.4, -0.6)
    axis.set_xlabel("slope of the power spectrum, compressed luminance")
    axis.legend(frameon=False, fontsize=8, ncols=4, loc="lower left", bbox_to_anchor=(-0.1, 1.0))
    return figure


def example_spectra_figure(spectra: Sequence[Spectrum]) -> Figure:
    """Pictures above their power spectra with the fitted lines (fig. 1.4)."""
    columns = min(4, len(spectra))
    rows = -(-len(spectra) // columns)
    figure = Figure(figsize=(3.1 * columns, 5.2 * rows), layout="constrained")
    axes = figure.subplots(2 * rows, columns, squeeze=False, height_ratios=[1.0, 0.8] * rows)
    for axis in axes.flat[:]:
        axis.set_visible(False)
    for number, spectrum in enumerate(spectra):
        row, column = divmod(number, columns)
        above, below = axes[2 * row, column], axes[2 * row + 1, column]
        for axis in (above, below):
            axis.set_visible(True)
        assert spectrum.picture is not None
        above.imshow(spectrum.picture)
        above.set_axis_off()
        above.set_title(f"{spectrum.name}\n{spectrum.group}", fontsize=8, parse_math=False)
        frequency = np.arange(1, len(spectrum.power) + 1)
        _plain(below)
        below.loglog(frequency, spectrum.power, color=FRAMED, linewidth=1.2)
        below.loglog(
            frequency[1:], 10**spectrum.offset * frequency[1:] ** spectrum.slope, "--", color="0.1", linewidth=1
        )
        below.set_title(f"slope {spectrum.slope:.2f}", fontsize=9)
        below.set_xlabel("cycles per picture", fontsize=8)
        below.tick_params(labelsize=7)
        if column == 0:
            below.set_ylabel("power", fontsize=8)
    return figure


def tile_figure(frames: Sequence[NDArray[np.uint8]], times_s: Sequence[float], example: Example) -> Figure:
    """Frames with the tile outlined above the tile enlarged (fig. 5.2)."""
    figure = Figure(figsize=(3.4 * len(frames), 5.6), layout="constrained")
    axes = figure.subplots(2, len(frames), squeeze=False, height_ratios=(3, 2))
    for column, (frame, time_s) in enumerate(zip(frames, times_s, strict=True)):
        left, top, width = example.place(frame.shape[1])
        axes[0, column].imshow(frame)
        axes[0, column].add_patch(
            Rectangle((left - 0.5, top - 0.5), width, width, fill=False, color="w", linewidth=2.4)
        )
        axes[0, column].add_patch(Rectangle((left - 0.5, top - 0.5), width, width, fill=False, color="k", linewidth=1))
        axes[0, column].set_title(f"{time_s:.2f} s", fontsize=9)
        cut = frame[int(top) : int(np.ceil(top + width)), int(left) : int(np.ceil(left + width))]
        axes[1, column].imshow(cut)
        axes[1, column].set_title(f"tile {example.index} of level {example.level}", fontsize=9)
    for axis in axes.flat:
        axis.set_axis_off()
    return figure


def norm_figure(example: Example) -> Figure:
    """Power of the first temporal slice with the square band, and the norm along its diagonal (fig. 5.3)."""
    f_s, _ = example.band
    figure = Figure(figsize=(9.4, 4.0), layout="constrained")
    left, right = figure.subplots(1, 2)
    power = example.power.numpy()
    floor = max(power.max() * 1e-12, np.finfo(float).tiny)
    image = left.imshow(np.log10(np.maximum(power, floor)), origin="lower", cmap="inferno")
    figure.colorbar(image, ax=left, label="log10 power", shrink=0.85)
    left.add_patch(Rectangle((-0.5, -0.5), f_s + 1, f_s + 1, fill=False, color="w", linewidth=1.4))
    limit = power.shape[0] - 1
    left.plot([0, limit], [0, limit], "--", color="w", linewidth=0.8)
    left.set_xlabel("cycles per tile, x")
    left.set_ylabel("cycles per tile, y")
    left.set_title(f"up to one cycle per span; square: $f_s$ = {f_s}", fontsize=9)
    _plain(right)
    norm = share_of_total(example.tiles.norm)[0].numpy()
    frequency = np.arange(1, norm.shape[1] + 1)
    right.loglog(frequency, norm[0], color=FRAMED, label="this slice")
    right.loglog(frequency, norm[-1], color=ADAPTIVE, linestyle="--", label="all frequencies in time")
    right.axvline(f_s, color="0.2", linewidth=0.9, linestyle=":")
    top = {"xycoords": right.get_xaxis_transform(), "textcoords": "offset points"}
    right.annotate("$f_s$", (f_s, 1.0), (0, 3), ha="center", fontsize=9, **top)
    right.set_xlabel("band width s, cycles per tile")
    right.set_ylabel("power norm, share of the total")
    right.yaxis.set_major_formatter("{x:.3g}")
    right.yaxis.set_minor_formatter("{x:.2g}")
    label_ends(right)
    return figure


def _rates(example: Example) -> tuple[Floats, Floats, Floats]:
    """log2 of both rates on the grid of the norm, and the norm as a share."""
    norm = share_of_total(example.tiles.norm)[0].numpy()
    space, time = (np.log2(2 * np.arange(1, n + 1) * unit) for n, unit in zip(norm.T.shape, example.unit, strict=True))
    return space, time, norm


def _rate_axes(axis: Axes) -> None:
    axis.xaxis.set_major_formatter(FuncFormatter(lambda x, _: f"{2**x:.3g}"))
    axis.yaxis.set_major_formatter(FuncFormatter(lambda y, _: f"{1e3 / 2**y:.3g}"))
    axis.set_xlabel("samples per pixel side")
    axis.set_ylabel("refresh interval, ms")


def _contour(figure: Figure, axis: Axes, example: Example) -> None:
    colours = matplotlib.colormaps["viridis"](np.linspace(0.0, 1.0, len(_LEVELS) - 1))
    filled = axis.contourf(*_rates(example), levels=_LEVELS, colors=colours)
    axis.contour(*_rates(example), levels=_LEVELS[1:-1], colors="k", linewidths=0.4)
    figure.colorbar(filled, ax=axis, label="power norm, share of the total", ticks=_LEVELS, format="%g")
    ideal = np.log2(2 * example.band[0] * example.unit[0]), np.log2(2 * example.band[1] * example.unit[1])
    axis.plot(*ideal, "*", color="w", markeredgecolor="k", markersize=15, clip_on=False, zorder=5)
    axis.annotate("Θ*", ideal, (7, 5), textcoords="offset points", fontsize=12, fontweight="bold")
    _rate_axes(axis)


def surface_figure(example: Example) -> Figure:
    """The norm as a surface and as a contour plot (fig. 5.4)."""
    figure = Figure(figsize=(11.0, 4.6), layout="constrained")
    left = figure.add_subplot(1, 2, 1, projection="3d")
    space, time, norm = _rates(example)
    left.plot_surface(*np.meshgrid(space, time), norm, cmap="viridis", rcount=80, ccount=80, linewidth=0)  # type: ignore[attr-defined]
    _rate_axes(left)
    left.set_title("power norm, share of the total", fontsize=9)
    left.view_init(28, -125)  # type: ignore[attr-defined]
    left.set_box_aspect(None, zoom=0.88)  # type: ignore[attr-defined]
    left.tick_params(labelsize=7)
    _contour(figure, figure.add_subplot(1, 2, 2), example)
    return figure


def estimate_figure(example: Example) -> Figure:
    """The realizable rates and the streaming estimate at rates of the grid over the norm (fig. 5.5)."""
    figure = Figure(figsize=(8.6, 6.4), layout="constrained")
    axis = figure.subplots()
    _contour(figure, axis, example)
    at = np.log2(example.tiles.theta.numpy() * example.unit)
    phi = example.tiles.phi[0].numpy()
    axis.quiver(*at.T, *phi.T, angles="xy", scale_units="xy", scale=1.4, color=ADAPTIVE, width=0.005, zorder=4)
    axis.plot(*at.T, "o", color=ADAPTIVE, markersize=3.5, zorder=4, clip_on=False)
    (x0, x1), (y0, y1) = np.log2(example.realizable)
    axis.add_patch(Rectangle((x0, y0), x1 - x0, y1 - y0, fill=False, color="w", linewidth=3.0))
    axis.add_patch(Rectangle((x0, y0), x1 - x0, y1 - y0, fill=False, color="k", linewidth=1.4, linestyle="--"))
    space, time, _ = _rates(example)
    inside = (max(x0, space[0]), min(y1, time[-1]))
    axis.annotate(
        "$\\Omega_\\theta$", inside, (6, -16), textcoords="offset points", color="w", fontsize=12, fontweight="bold"
    )
    axis.set_xlim(min(x0, space[0], at[:, 0].min()), space[-1])
    low = min(y0, at[:, 1].min())
    axis.set_ylim(max(low - 0.6, min(low, time[0])), time[-1])
    axis.set_title("arrows: the streaming estimate φ at rates a; dashed: realizable rates", fontsize=9, loc="left")
    return figure


def agreement_figure(tiles: Mapping[str, Tiles], found: Mapping[str, Any], tau: float) -> Figure:
    """Angles between estimate and truth, and each component of one over that of the other."""
    figure = Figure(figsize=(12.0, 4.2), layout="constrained")
    axes = figure.subplots(1, 3)
    true = {name: t.true(share_of_total(t.norm), tau) for name, t in tiles.items()}
    rows = [("all", found["all"]), ("changing tiles", found["changing_tiles"]), *found["inputs"].items()]
    rows = [(name, row) for name, row in rows if row]
    for place, (_, row) in enumerate(rows):
        median, low, high = row["angle_median_deg"]["value"], *row["angle_quartiles_deg"][::2]
        axes[0].plot([low, high], [place, place], color=FRAMED, linewidth=5, alpha=0.35, solid_capstyle="butt")
        axes[0].plot(median, place, "o", color=FRAMED)
        axes[0].plot(row["angle_median_deg"]["permuted"], place, "x", color="0.3")
    axes[0].plot([], [], "o", color=FRAMED, label="median (bar: quartiles)")
    axes[0].plot([], [], "x", color="0.3", linestyle="", label="median, estimates permuted among tiles")
    axes[0].axvline(90.0, color="0.5", linewidth=0.9, linestyle=":", label="median, random directions")
    axes[0].set_yticks(range(len(rows)), [name for name, _ in rows])
    axes[0].set_ylim(len(rows) - 0.5, -0.5)
    axes[0].set_xlim(0, 120)
    axes[0].set_xlabel("angle between φ and the direction to Θ*, degrees")
    axes[0].legend(frameon=False, fontsize=7, loc="lower left", bbox_to_anchor=(-0.3, 1.0))
    for axis, component, name in zip(axes[1:], (0, 1), ("space", "time"), strict=True):
        for ink, mark, (source, t) in zip(INKS, MARKERS, tiles.items(), strict=False):
            x, y = true[source][..., component].ravel(), t.phi[..., component].numpy().ravel()
            axis.plot(x, y, mark, color=ink, markersize=2.4, alpha=0.45, markeredgewidth=0, label=source)
        axis.axhline(0.0, color="0.2", linewidth=0.8)
        axis.axvline(0.0, color="0.2", linewidth=0.8)
        axis.set_ylim(-1.05, 1.05)
        rank = found["all"][name]["spearman"]
        axis.set_title(f"{name}: rank correlation {rank:.2f}", fontsize=9)
        axis.set_xlabel(f"octaves to Θ* in {name}")
        axis.set_ylabel(f"estimate φ in {name}")
    figure.legend(*axes[1].get_legend_handles_labels(), frameon=False, fontsize=7, markerscale=3,
                  loc="outside right upper")  # fmt: skip
    for axis in axes:
        _plain(axis)
    return figure
