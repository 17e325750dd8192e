"""Figures and page of a finished run."""

from __future__ import annotations

import io
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from analysis import plots
from analysis.cost_model import stage_flops
from analysis.player import Curve, Player
from analysis.records import density_quantiles, read_limits
from analysis.report import Report, write_report
from analysis.summary import Measured, key_table, ledger_table, stage_table


def _title(summary: Mapping[str, Any]) -> str:
    config = summary["config"]
    tsar = config["tsar"]
    return (
        f"{config['input']}: TSAR (batch {tsar['batch_size']}) and framed at {tsar['resolution_px']}², "
        f"equal cost by ledger {summary['ledger']}"
    )


def _error_figure(summary: Mapping[str, Any], measured: Measured) -> Figure:
    c = measured.comparison
    framed = {name: np.array(trace.mse) for name, trace in c.framed.items()}
    return plots.error_figure(
        c.times_s, np.array(c.adaptive.mse), framed, summary["ratio"], c.refresh_s, _title(summary)
    )


def write_figures(out: Path, summary: Mapping[str, Any], measured: Measured) -> None:
    """Writes ``error.png``."""
    plots.save(_error_figure(summary, measured), out / "error.png")


def _player(summary: Mapping[str, Any], measured: Measured) -> Player:
    c = measured.comparison
    inks = zip(c.framed.items(), (plots.FRAMED, plots.OTHER), strict=False)
    return Player(
        times_s=c.times_s,
        steps=c.steps,
        curves=[
            Curve("TSAR", plots.ADAPTIVE, c.adaptive.mse),
            *(Curve(name, ink, trace.mse) for (name, trace), ink in inks),
        ],
        quantity="mean squared error",
        marks_s=c.refresh_s,
        readings={f"TSAR / {measured.main}": [f"{value:.3f}" for value in summary["ratio"]]},
        note="Every view shows what stands on the display at that time, latency included. Move the slider, also by "
        "the arrow keys, or click into the curves. Dotted: the framed display changes. Ages are of the newest sample "
        "in each place of the TSAR image.",
    )


def write_page(out: Path, summary: Mapping[str, Any], measured: Measured) -> None:
    """Writes ``report.html``."""
    limits = read_limits(out / "steps.parquet")
    bounds = {"density_spatial": limits.density_spatial, "density_temporal": limits.density_temporal}
    flops = {name: float(value) for name, value in stage_flops(measured.cost).items()}
    figures = {
        "Error over time": _error_figure(summary, measured),
        "Densities over time": plots.density_figure(density_quantiles(out / "steps.parquet"), bounds),
        "Stages": plots.stage_figure(flops, measured.totals.stage_s),
    }
    write_report(
        out / "report.html",
        Report(
            title=_title(summary),
            lead=_lead(summary),
            key_numbers=key_table(measured, framed_period_s(summary)),
            figures=[(caption, _png(figure)) for caption, figure in figures.items()],
            player=_player(summary, measured),
            tables=[stage_table(measured), ledger_table(measured)],
            details={"Configuration": summary["config"], "Provenance": summary["provenance"]},
        ),
    )


def framed_period_s(summary: Mapping[str, Any]) -> float:
    """Mean time between images of the framed renderer, seconds; NaN where it showed one."""
    refresh = summary["framed_refresh_s"]
    return (refresh[-1] - refresh[0]) / (len(refresh) - 1) if len(refresh) > 1 else float("nan")


def _lead(summary: Mapping[str, Any]) -> list[str]:
    config, statistics = summary["config"], summary["ratio_statistics"]
    better = "less" if statistics.median < 1 else "more"
    machine = (
        "" if summary["ledger"] == "wall" else f" on a simulated machine of {summary['capacity_flops']:.3g} FLOP/s"
    )
    return [
        f"Input {config['input']}, {config['seconds']:g} s from {config['start_s']:g} s. Both renderers trace the same "
        f"scene with the same ray tracer{machine}; a cycle of TSAR and an image of the framed renderer each take the "
        f"time their cost has under the ledger {summary['ledger']}. What each display shows, latency included (three "
        f"cycles, two frames), is compared with a reference of {config['reference_rate_hz']:g} images a second and "
        f"{config['reference_samples_per_axis']}² samples a pixel.",
        f"TSAR has {better} error than the framed renderer at the median of the reference times (ratio "
        f"{statistics.median:.3f}); its error is at most as large {100 * statistics.share_suitable:.0f} % of the time.",
        "The error is the mean squared difference of display-encoded values in [0, 1] over pixels and channels.",
    ]


def _png(figure: Figure) -> bytes:
    FigureCanvasAgg(figure)
    buffer = io.BytesIO()
    figure.savefig(buffer, dpi=110, format="png")
    return buffer.getvalue()
