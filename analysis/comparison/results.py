"""Figures and page of a finished run."""

from __future__ import annotations

import io
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from analysis.comparison import plots
from analysis.comparison.rivalry import best_rival_table
from analysis.comparison.summary import Measured, measured_stages, modelled_stages
from analysis.comparison.tables import key_table, ledger_table, metric_table, stage_table
from analysis.page import figures
from analysis.page.player import Curve, Player
from analysis.page.report import Report, write_report
from analysis.storage.records import density_quantiles, read_limits


def _size(tsar: Mapping[str, Any]) -> str:
    return f"{tsar['width_px']} x {tsar['height_px']}" if tsar["width_px"] else f"{tsar['resolution_px']}²"


def _title(summary: Mapping[str, Any]) -> str:
    config = summary["config"]
    tsar = config["tsar"]
    others = ", ".join(summary["rivals"])
    beside = f" beside {others}" if others else ""
    return (
        f"{config['input']}: {summary['policy']} (batch {tsar['batch_size']}){beside} at {_size(tsar)}, "
        f"equal cost by ledger {summary['ledger']}"
    )


def _error_figure(summary: Mapping[str, Any], measured: Measured) -> Figure:
    refresh = measured.seen[measured.rival].refresh_s if measured.rival else []
    return plots.error_figure(measured.times_s, measured.mse, measured.own, measured.ratio(), refresh, _title(summary))


def write_figures(out: Path, summary: Mapping[str, Any], measured: Measured) -> None:
    """Writes ``error.png``."""
    figures.save(_error_figure(summary, measured), out / "error.png")


def _player(measured: Measured) -> Player:
    inks = figures.inks(list(measured.seen), measured.own)
    rival = measured.rival
    marks = f" Dotted: the display of {rival} changes." if rival else ""
    return Player(
        times_s=measured.times_s,
        steps=measured.steps,
        curves=[Curve(name, ink, measured.mse[name].tolist()) for name, ink in inks.items()],
        quantity="mean squared error",
        marks_s=measured.seen[rival].refresh_s if rival else [],
        readings={f"{measured.own} / {rival}": [f"{value:.3f}" for value in measured.ratio()]} if rival else {},
        note="Every view shows what stands on the display at that time, latency included. Move the slider, also by "
        f"the arrow keys, or click into the curves.{marks} Of the framed rivals the one of the lowest median error has "
        f"a view. Maps that name no run are of {measured.own}; ages are of the newest sample in each place.",
    )


def write_page(out: Path, summary: Mapping[str, Any], measured: Measured) -> None:
    """Writes ``report.html``."""
    drawn = {"Error over time": _error_figure(summary, measured)}
    tables = [ledger_table(measured)]
    if measured.recorded is not None:
        limits = read_limits(out / "steps.parquet")
        bounds = {"density_spatial": limits.density_spatial, "density_temporal": limits.density_temporal}
        caption = f"Densities of {measured.recorded} over time"
        drawn[caption] = plots.density_figure(density_quantiles(out / "steps.parquet"), bounds)
    if measured.totals.cycles:
        drawn[f"Stages of {measured.own}"] = plots.stage_figure(modelled_stages(measured), measured_stages(measured))
        tables.insert(0, stage_table(measured))
    further = [metric_table(measured), best_rival_table(measured)]
    write_report(
        out / "report.html",
        Report(
            title=_title(summary),
            lead=_lead(summary, measured),
            key_numbers=key_table(measured),
            figures=[(caption, _png(figure)) for caption, figure in drawn.items()],
            player=_player(measured),
            tables=[*(table for table in further if table), *tables],
            details={"Configuration": summary["config"], "Provenance": summary["provenance"]},
        ),
    )


def _lead(summary: Mapping[str, Any], measured: Measured) -> list[str]:
    config = summary["config"]
    machine = (
        "" if summary["ledger"] == "wall" else f" on a simulated machine of {summary['capacity_flops']:.3g} FLOP/s"
    )
    latency = ", ".join(f"{name} {run.latency_cycles}" for name, run in measured.runs.items())
    found = [
        f"Input {config['input']}, {config['seconds']:g} s from {config['start_s']:g} s. All runs trace the same scene "
        f"with the same ray tracer{machine}; a cycle of each takes the time that its cost has under the ledger "
        f"{summary['ledger']}. What each display shows, latency included (in cycles: {latency}), is compared with a "
        f"reference of {config['reference_rate_hz']:g} images a second and "
        f"{config['reference_samples_per_axis']}² samples a pixel."
    ]
    if measured.rival is not None:
        statistics = measured.statistics(measured.rival)
        better = "less" if statistics.median < 1 else "more"
        found.append(
            f"{measured.own} has {better} error than {measured.rival} at the median of the reference times (ratio "
            f"{statistics.median:.3f}); its error is at most as large {100 * statistics.share_suitable:.0f} % of the "
            "time."
        )
    error = "The error is the mean squared difference of display-encoded values in [0, 1] over pixels and channels."
    return [*found, error]


def _png(figure: Figure) -> bytes:
    FigureCanvasAgg(figure)
    buffer = io.BytesIO()
    figure.savefig(buffer, dpi=110, format="png")
    return buffer.getvalue()
