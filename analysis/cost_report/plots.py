"""Figures of the cost report; computes only positions on the paper."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from analysis.page.figures import ADAPTIVE, FRAMED, INKS, label_ends, line_style, plain_log, save
from analysis.storage.files import atomic

if TYPE_CHECKING:
    from pyvista import PolyData
    from torch import Tensor

    from analysis.cost_report.refit import Cell, MemoryTrace, PowerLaw, StageFit
    from analysis.cost_report.sweeps import ParameterSweep

__all__ = [
    "advantage_figure",
    "cost_figure",
    "memory_figure",
    "refit_figure",
    "save",
    "scaling_figure",
    "surface_picture",
]

_AXES = {
    "recon_res": "output resolution, pixels",
    "batch_size": "batch size, framelets per cycle",
    "trace_segments": "ray segments per sample",
}
_SIDES = (64, 128, 256, 512, 1024, 2048)
_MIB = 2.0**20
_BOX = 0.016  # edge of a box as a share of an axis: less than the distance between batch sizes 32 and 64


def _axes(width: float, height: float, columns: int = 1, rows: int = 1) -> tuple[Figure, list[Axes]]:
    figure = Figure(figsize=(width, height), layout="constrained")
    found = list(figure.subplots(rows, columns, squeeze=False).ravel())
    for axis in found:
        axis.spines[["top", "right"]].set_visible(False)
        axis.grid(True, color="0.85", linewidth=0.6)
        axis.set_axisbelow(True)
    return figure, found


def _resolution_axis(axis: Axes) -> None:
    axis.set_xscale("log", base=2)
    low, high = axis.get_xlim()
    sides = [side for side in _SIDES if low <= side**2 <= high]
    axis.set_xticks([side**2 for side in sides], [f"{side}²" for side in sides])
    axis.minorticks_off()


def cost_figure(found: ParameterSweep, title: str, crossing: float | None = None) -> Figure:
    """Cost per output pixel along one parameter, with thin lines for stages and thick lines for sums (figs 7.3 to 7.5).

    Args:
        found: the costs.
        title: text above the figure.
        crossing: parameter at which both renderers cost the same, if it is to be marked.
    """
    figure, (axis,) = _axes(9.0, 5.0)
    x = found.values.numpy()
    for style, (name, values) in enumerate(found.stages.items(), 2):
        cost = values.numpy()
        axis.plot(x, np.where(cost > 0, cost, np.nan), **{**line_style(style), "linewidth": 1.1}, label=name)
    axis.plot(x, found.adaptive.numpy(), color=ADAPTIVE, linewidth=2.6, label="adaptive, total")
    framed = found.nonadaptive.numpy()
    framed = np.where(framed > 0, framed, np.nan)
    axis.plot(x, framed, color=FRAMED, linewidth=2.6, linestyle="--", label="nonadaptive")
    axis.set_yscale("log")
    axis.set_xlim(x[0], x[-1])
    if found.name == "recon_res":
        _resolution_axis(axis)
    else:
        axis.set_xlim(left=0)
    if crossing is not None and x[0] <= crossing <= x[-1]:
        axis.axvline(crossing, color="0.3", linewidth=0.9, linestyle=":", label=f"equal cost at {crossing:,.0f}")
    axis.set_xlabel(_AXES[found.name])
    axis.set_ylabel("FLOP per output pixel")
    axis.set_title(f"Cost per output pixel, {title}", fontsize=10, loc="left")
    label_ends(axis)
    return figure


def advantage_figure(
    batch: Tensor, advantages: Mapping[str, Tensor], measured: Sequence[Mapping[str, float]] = ()
) -> Figure:
    """Cycles per framed image over the batch size under every ledger, with measurements at the same output side."""
    figure, (axis,) = _axes(9.0, 4.4)
    for style, (name, values) in enumerate(advantages.items()):
        axis.plot(batch.numpy(), values.numpy(), **line_style(style), label=f"ledger {name}")
    if measured:
        x = [row["batch_size"] for row in measured]
        for name, mark, label in (
            ("measured", "o", "wall, measured"),
            ("refitted", "x", "thesis, refitted with fixed costs"),
            ("modelled", "+", "thesis, segments counted"),
        ):
            axis.plot(
                x, [row[name] for row in measured], mark, color="0.15", markersize=6, label=label, fillstyle="none"
            )
    axis.axhline(1.0, color="0.0", linewidth=0.8)
    axis.set_xscale("log", base=2)
    axis.set_yscale("log")
    axis.xaxis.set_major_formatter("{x:g}")
    axis.yaxis.set_major_formatter("{x:g}")
    axis.set_xlabel(_AXES["batch_size"])
    axis.set_ylabel("adaptive cycles per framed image")
    axis.set_title("Advantage by ledger; below 1 a cycle costs more than an image", fontsize=10, loc="left")
    label_ends(axis)
    return figure


def refit_figure(fits: Mapping[str, StageFit]) -> Figure:
    """Seconds of each stage against its modelled operations, with the fitted lines."""
    columns = 4
    figure, axes = _axes(13.0, 5.6, columns, math.ceil(len(fits) / columns))
    for axis, (name, fit) in zip(axes, fits.items(), strict=False):
        flops, ms = np.array(fit.flops) / 1e6, 1e3 * np.array(fit.seconds)
        line = np.linspace(0.0, 1.08 * flops.max(), 2)
        axis.plot(line, [1e3 * fit.origin(1e6 * x) for x in line], color=FRAMED, linewidth=1.1, label="through zero")
        if fit.affine is not None:
            shown = [1e3 * fit.affine(1e6 * x) for x in line]
            axis.plot(line, shown, color=ADAPTIVE, linewidth=1.1, label="with a fixed cost", linestyle="--")
        axis.plot(flops, ms, "o", color="0.15", markersize=4, fillstyle="none", label="measured, a setting each")
        axis.set_xlim(0, line[-1])
        axis.set_ylim(0, 1.25 * ms.max())
        axis.set_title(f"{name}: {fit.relative_to_tracing:,.3g} x a tracing FLOP", fontsize=9, loc="left")
        axis.set_xlabel("modelled, MFLOP a cycle", fontsize=8)
        axis.set_ylabel("measured, ms a cycle", fontsize=8)
        axis.tick_params(labelsize=8)
        axis.xaxis.set_major_locator(MaxNLocator(4))
    for axis in axes[len(fits) :]:
        axis.set_axis_off()
    handles, labels = axes[0].get_legend_handles_labels()
    axes[-1].legend(handles, labels, frameon=False, fontsize=9, loc="center")
    return figure


def scaling_figure(cells: Sequence[Cell], laws: Mapping[str, PowerLaw], centre: tuple[int, int]) -> Figure:
    """Seconds per cycle over the batch size and over output pixels, with the power laws through them."""
    figure, (left, right) = _axes(11.0, 4.2, 2)
    by_batch = [cell for cell in cells if cell.resolution_px == centre[1]]
    by_side = [cell for cell in cells if cell.batch_size == centre[0]]
    panels = (
        (left, "batch", [cell.batch_size for cell in by_batch], by_batch, "tracing"),
        (right, "pixels", [cell.resolution_px**2 for cell in by_side], by_side, "reconstruction"),
    )
    for axis, against, x, shown, stage in panels:
        seconds = {stage: [c.stage_s[stage] for c in shown], "cycle": [c.cycle_s for c in shown]}
        for (name, values), ink, dash, mark in zip(
            seconds.items(), (FRAMED, ADAPTIVE), ("--", "-"), ("s", "o"), strict=True
        ):
            law = laws[f"{name}_by_{against}"]
            line = np.geomspace(law.low, law.high, 64)
            label = f"{name}: exponent {law.exponent:.2f} (±{100 * law.spread:.0f} %)"
            axis.plot(x, 1e3 * np.array(values), mark, color=ink, markersize=5, label="_measured")
            axis.plot(line, 1e3 * law.factor * line**law.exponent, color=ink, linewidth=1.0, linestyle=dash,
                      label=label)  # fmt: skip
            straight = 1e3 * np.array([law.linear(value) for value in line])
            axis.plot(line, np.where(straight > 0, straight, np.nan), color=ink, linewidth=1.0, linestyle=":",
                      label=f"{name}: straight line")  # fmt: skip
        axis.set_yscale("log")
        axis.set_ylabel("ms per cycle")
        plain_log(axis.yaxis)
    left.set_xscale("log", base=2)
    left.xaxis.set_major_formatter("{x:g}")
    left.set_xlabel(f"{_AXES['batch_size']}, at {centre[1]}²")
    _resolution_axis(right)
    right.set_xlabel(f"{_AXES['recon_res']}, at batch {centre[0]}")
    figure.suptitle("Wall time of a cycle, with power laws and straight lines of a fixed cost", fontsize=10, x=0.01,
                    ha="left")  # fmt: skip
    for axis in (left, right):
        label_ends(axis)
    return figure


def memory_figure(trace: MemoryTrace, growth: Mapping[str, Any]) -> Figure:
    """Resident memory over the cycles."""
    figure, (axis,) = _axes(9.0, 3.4)
    axis.plot(trace.cycle, np.array(trace.resident_bytes) / _MIB, color=ADAPTIVE, linewidth=1.4, label="resident")
    axis.axhline(trace.before_bytes / _MIB, color=FRAMED, linewidth=1.0, linestyle="--", label="before the pipeline")
    axis.set_ylim(0, 1.25 * max(trace.resident_bytes) / _MIB)
    axis.set_xlim(0, trace.cycle[-1])
    axis.set_xlabel(f"cycle after the warm-up, batch {trace.batch_size} at {trace.resolution_px}²")
    axis.set_ylabel("memory, MiB")
    slope = growth["slope_settled_bytes_per_1000_cycles"] / _MIB
    axis.set_title(f"Resident memory: {slope:+.2f} MiB per 1000 cycles once settled", fontsize=10, loc="left")
    label_ends(axis)
    return figure


def surface_picture(
    surface: PolyData, rows: Sequence[tuple[float, float, float]], limits: Sequence[float], path: Path
) -> None:
    """The equal-cost surface with boxes at the admitted combinations (fig. 7.6), rendered off screen to PNG and SVG.

    Args:
        surface: points in batch size, segments, output side.
        rows: coordinates of the boxes.
        limits: upper ends of the three axes, which begin at zero.
        path: of the picture.
    """
    import pyvista
    from vtkmodules.vtkCommonCore import vtkLogger

    # without a display VTK reports that on standard error, but draws nevertheless
    vtkLogger.SetStderrVerbosity(vtkLogger.VERBOSITY_ERROR)
    top = np.array(limits)
    theme = pyvista.themes.DocumentTheme()
    plotter = pyvista.Plotter(off_screen=True, window_size=[1300, 1000], theme=theme)
    if surface.n_points:
        scaled = pyvista.PolyData(np.asarray(surface.points) / top, surface.faces)
        plotter.add_mesh(scaled, color=INKS[6], opacity=0.85, smooth_shading=True, specular=0.2)
        plotter.add_mesh(scaled.extract_feature_edges(), color=FRAMED, line_width=2)
    for row in rows:
        centre = np.array(row) / top
        if (centre <= 1.0).all():
            box = pyvista.Cube(center=centre, x_length=_BOX, y_length=_BOX, z_length=_BOX)
            plotter.add_mesh(box, color=ADAPTIVE)
    plotter.renderer.show_bounds(
        bounds=(0.0, 1.0, 0.0, 1.0, 0.0, 1.0),
        axes_ranges=[float(value) for most in limits for value in (0.0, most)],
        xtitle="batch size, framelets",
        ytitle="ray segments per sample",
        ztitle="output side, pixels",
        n_xlabels=4,
        n_ylabels=5,
        n_zlabels=4,
        fmt="%.0f",
        font_size=16,
        color="black",
        location="outer",
        grid="back",
    )
    plotter.camera_position = [(-1.35, 2.75, 1.75), (0.52, 0.5, 0.4), (0.0, 0.0, 1.0)]
    with atomic(path) as temporary:
        plotter.screenshot(temporary)
    with atomic(path.with_suffix(".svg")) as temporary:
        plotter.save_graphic(temporary)
    plotter.close()
