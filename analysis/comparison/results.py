"""The figures and the page of a finished run."""

from __future__ import annotations

import io
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from analysis.comparison import plots
from analysis.comparison.rivalry import Panels, best_rival_table
from analysis.comparison.summary import Measured, measured_stages, modelled_stages
from analysis.comparison.tables import key_table, ledger_table, metric_table, stage_table
from analysis.comparison.viewers import EXACT, MAP_PX
from analysis.metrics import METRICS
from analysis.metrics.quality import ratio
from analysis.page import figures
from analysis.page.comparer import Comparer
from analysis.page.curves import Curve, Plot
from analysis.page.report import Report, write_report
from analysis.page.video import REFERENCE
from analysis.storage.records import density_quantiles, stage_seconds


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


def _short_title(summary: Mapping[str, Any]) -> str:
    config, rivals = summary["config"], summary["rivals"]
    beside = f" beside {rivals[0]}" + (f" and {len(rivals) - 1} more" if rivals[1:] else "") if rivals else ""
    return f"{config['input']}: {summary['policy']}{beside} at {_size(config['tsar'])}"


def _error_figure(summary: Mapping[str, Any], measured: Measured) -> Figure:
    refresh = measured.seen[measured.rival].refresh_s if measured.rival else []
    return plots.error_figure(measured.times_s, measured.mse, measured.own, measured.ratio(), refresh, _title(summary))


def write_figures(out: Path, summary: Mapping[str, Any], measured: Measured) -> None:
    """Writes ``error.png`` and ``error.svg``."""
    figures.save(_error_figure(summary, measured), out / "error.png")


def _comparer(summary: Mapping[str, Any], measured: Measured, steps: Path | None) -> Comparer:
    panels, rival = Panels.of(measured.mse, measured.own), measured.rival
    how = (
        "without loss"
        if summary["config"]["page"] == EXACT
        else (
            f"nearly without loss (codes off by 1 of 255 or so; maps of more than {MAP_PX} pixels a side are thinned)"
        )
    )
    return Comparer(
        panels=measured.panels,
        steps=measured.steps,
        left=panels.best_framed or rival or REFERENCE,
        right=measured.own,
        plots=[*_error_plots(measured), *(_cycle_plots(measured.recorded or "", steps) if steps else [])],
        note=f"Pictures show the image on each display, latency included, pixel for pixel, {how}. Curves show the "
        "exact values.",
    )


def _error_plots(measured: Measured) -> list[Plot]:
    styles, times = figures.styles(list(measured.seen), measured.own), measured.times_s.tolist()
    rival = measured.rival
    marks = measured.seen[rival].refresh_s if rival else []
    errors = [Curve(name, times, values.tolist(), styles[name]) for name, values in measured.mse.items()]
    found = [Plot("Mean squared error of the shown image", "", errors, marks_s=marks)]
    if rival:
        own = measured.mse[measured.own]
        ratios = [Curve(name, times, ratio(own, measured.mse[name]).tolist(), styles[name])
                  for name in measured.rivals]  # fmt: skip
        found.append(Plot(f"Error of {measured.own} over that of each rival", "", ratios, level=1.0))
    return found


def _cycle_plots(name: str, path: Path) -> list[Plot]:
    """Densities and stages of the run whose cycles are on disk."""
    quantiles = density_quantiles(path)
    times, words = quantiles["sim_time_s"].tolist(), ("5 %", "25 %", "median", "75 %", "95 %")
    found = []
    for column, title, unit in (
        ("density_spatial", f"Spatial density of {name} over the picture", "samples per element"),
        ("density_temporal", f"Temporal density of {name} over the picture", "refreshes per cycle"),
    ):
        curves = [Curve(word, times, quantiles[column][:, i].tolist(), abs(i - 2)) for i, word in enumerate(words)]
        found.append(Plot(title, unit, curves[::-1]))
    at_s, stages = stage_seconds(path)
    curves = [
        Curve(stage, at_s, (1e3 * values).tolist(), style) for style, (stage, values) in enumerate(stages.items())
    ]
    return [*found, Plot(f"Stages of a cycle of {name}, as measured", "ms", curves)] if curves else found


def write_page(out: Path, summary: Mapping[str, Any], measured: Measured) -> None:
    """Writes ``report.html``."""
    drawn: dict[str, Figure] = {}
    tables, steps = [ledger_table(measured)], out / "steps.parquet" if measured.recorded is not None else None
    if measured.totals.cycles:
        drawn[f"Stages of {measured.own}"] = plots.stage_figure(modelled_stages(measured), measured_stages(measured))
        tables.insert(0, stage_table(measured))
    further = [metric_table(measured), best_rival_table(measured)]
    write_report(
        out / "report.html",
        Report(
            title=_short_title(summary),
            lead=_lead(summary, measured),
            key_numbers=key_table(measured),
            figures=[(caption, _png(figure)) for caption, figure in drawn.items()],
            comparer=_comparer(summary, measured, steps),
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
        statistics, own, rival = measured.statistics(measured.rival), measured.own, measured.rival
        found.insert(
            0,
            f"The squared error of {own} is {statistics.median:.3f} times that of {rival} at the median of the "
            f"reference times, and at most as large {100 * statistics.share_suitable:.0f} % of the time.",
        )
        if "best_rival" in summary:
            times = summary["best_rival"]["ratio_statistics"].median
            found[0] += f" It is {times:.3f} times the least of all rivals at each of them."
        found[0] += "".join(_score(metric, values, measured) for metric, values in summary["metrics"].items())
    error = "The error is the mean squared difference of display-encoded values in [0, 1] over pixels and channels."
    return [*found, error]


def _score(metric: str, values: Mapping[str, float], measured: Measured) -> str:
    """A sentence about a metric: the run's own, that of the rival, and that of the best of all rivals."""
    better = METRICS[metric].better
    best = (max if better == "higher" else min)(measured.rivals, key=lambda name: values[name])
    named = ", ".join(f"{name} {values[name]:.3g}" for name in dict.fromkeys((measured.rival or best, best)))
    return f" {metric.upper()} is {values[measured.own]:.3g} ({named}; {better} is better)."


def _png(figure: Figure) -> bytes:
    FigureCanvasAgg(figure)
    buffer = io.BytesIO()
    figure.savefig(buffer, dpi=110, format="png")
    return buffer.getvalue()
