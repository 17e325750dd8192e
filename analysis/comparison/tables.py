"""Tables of a comparison, for the terminal and the report."""

from __future__ import annotations

import statistics
from collections.abc import Mapping
from typing import Any

import numpy as np

from analysis.command.console import Table
from analysis.comparison.summary import (
    Measured,
    cycles_per_image,
    ledger_costs,
    measured_stages,
    metrics_of,
    modelled_stages,
    overdraw,
    segments,
)
from analysis.metrics import METRICS
from analysis.metrics.cost_model import per_segment
from analysis.metrics.quality import RatioStatistics


def key_table(measured: Measured) -> Table:
    """The numbers to look at first."""
    totals, own = measured.totals, measured.own
    holds = said_of(measured.invariants, "yes")
    rows = [
        (f"median MSE, {own}", f"{np.median(measured.mse[own]):.3e}"),
        (f"cycles of {own}", f"{totals.cycles}, {1e3 * totals.simulated_s / max(totals.cycles, 1):.2f} ms each"),
        (f"samples per cycle of {own}", f"{totals.counters.get('primary_rays', 0) / max(totals.cycles, 1):,.0f}"),
        ("non-finite samples replaced", str(measured.runs[own].nonfinite_samples)),
        *_recorded_rows(measured, holds),
    ]
    for name in measured.rivals:
        s = measured.statistics(name)
        rows += [
            (f"median MSE, {name}", f"{np.median(measured.mse[name]):.3e}"),
            (f"period of {name}", f"{1e3 * measured.period_s(name):.1f} ms"),
            (f"ratio to {name}: median", f"{s.median:.3f}"),
            (f"ratio to {name}: quartiles", f"{s.quartile_low:.3f} – {s.quartile_high:.3f}"),
            (f"ratio to {name}: at most 1", f"{100 * s.share_suitable:.0f} % of the time"),
            (f"ratio to {name}: greatest suitable percentile", f"{s.suitable_percentile:.0f}"),
            (f"ratio to {name}: outliers, infinite", f"{s.outliers}, {s.infinite}"),
        ]
    note = ""
    if measured.rival is not None:
        log, plain = (measured.statistics(measured.rival, column).median for column in ("log_mse", "mse"))
        rows.append((f"ratio of log-compressed MSE to {measured.rival}: median", f"{log:.3f}"))
        if (log > 1) != (plain > 1):
            note = "The two measures disagree on which run is better."
    return Table("Key numbers", ("", "value"), rows, note)


def _recorded_rows(measured: Measured, holds: str) -> list[tuple[str, str]]:
    """Rows on the run whose cycles are on disk."""
    if measured.recorded is None:
        return []
    name = measured.recorded
    totals = measured.runs[name].totals
    return [
        (f"non-finite densities and errors of {name}", str(totals.nonfinite_fields)),
        (f"invariants of {name} hold in every cycle", holds),
        (f"framelets drawn per pixel by {name}", f"{overdraw(measured, name):.2f}"),
        (f"moved elements of {name} that one decision drove to a bound", f"{100 * totals.saturation:.0f} %"),
        (
            f"spread of ages in moving regions of {name}",
            f"{1e3 * totals.age_spread_s / max(totals.cycles, 1):.0f} ms",
        ),
    ]


def said_of(invariants: Mapping[str, Any] | None, hold: str) -> str:
    """Words that say whether invariants were checked and hold."""
    if invariants is None:
        return "not recorded by these policies"
    return hold if invariants["ok"] else f"BROKEN: {dict(invariants)}"


def run_tables(summary: Mapping[str, Any], title: str) -> list[Table]:
    """The errors of every run, and those of the policy beside each rival's. For the terminal.

    Args:
        summary: as in ``summary.json``, with statistics as records.
        title: above the first table.
    """
    own, metrics, config = summary["policy"], summary["metrics"], summary["config"]
    rows = [
        (name, f"{statistics.median(errors):.2g}", *(f"{values[name]:.3f}" for values in metrics.values()))
        for name, errors in summary["mse"].items()
    ]
    named = (f"{metric.upper()}, {METRICS[metric].better} is better" for metric in metrics)
    taken = [f"{metric.upper()}: {_span(config) if METRICS[metric].sequence else _mean(config)}" for metric in metrics]
    beside = dict(summary.get("ratio_statistics", {}))
    if "best_rival" in summary:
        beside["the best of them"] = summary["best_rival"]["ratio_statistics"]
    ratios = [(name, *_beside(found)) for name, found in beside.items()]
    ours = ("rival", "median", "quartiles", "times at most its", "suitable percentile")
    tables = [Table(title, ("run", "MSE, median", *named), rows, "; ".join(taken))]
    return tables + ([Table(f"MSE of {own} over that of each rival", ours, ratios)] if ratios else [])


def _span(config: Mapping[str, Any]) -> str:
    return f"{min(config['jod_s'], config['seconds']):g} s in the middle"


def _mean(config: Mapping[str, Any]) -> str:
    return f"mean over one in {config['metric_stride']} images of the reference"


def _beside(found: RatioStatistics) -> tuple[str, ...]:
    share = f"{100 * found.share_suitable:.0f} %"
    quartiles = f"{found.quartile_low:.3f} – {found.quartile_high:.3f}"
    return f"{found.median:.3f}", quartiles, share, f"{found.suitable_percentile:.0f}"


def metric_table(measured: Measured) -> Table | None:
    """Metrics of every run; None if none was asked for."""
    found = metrics_of(measured)
    rows = [(name, *(f"{found[metric][name]:.4f}" for metric in found)) for name in measured.seen]
    note = "Metrics of images are means over the times at which they were taken; jod scores the middle of the run."
    return Table("Metrics", ("run", *found), rows, note) if found else None


def stage_table(measured: Measured) -> Table:
    """Modelled and measured cost of each stage."""
    flops, wall, cycles = modelled_stages(measured), measured_stages(measured), max(measured.totals.cycles, 1)
    total, total_s = sum(flops.values()), sum(wall.values()) or 1.0
    rows = []
    for name in dict.fromkeys((*flops, *wall)):
        cost, seconds = float(flops.get(name, 0.0)), wall.get(name, 0.0)
        shares = (f"{100 * cost / total:.1f} %", f"{1e3 * seconds / cycles:.2f}", f"{100 * seconds / total_s:.1f} %")
        rows.append((name, f"{cost / 1e6:,.2f}", *shares))
    header = ("stage", "modelled, MFLOP a cycle", "modelled share", "measured, ms a cycle", "measured share")
    counted = segments(measured.totals.counters)
    note = f"Segments per sample: {counted:.2f} counted, {measured.cost.trace_segments} modelled."
    return Table(f"Stages of {measured.own}: model against measurement", header, rows, note)


def ledger_table(measured: Measured) -> Table:
    """Cost of a cycle of every run under every ledger."""
    rows, per_image = [], cycles_per_image(measured)
    for ledger, costs in ledger_costs(measured).items():
        scale, unit = (1e3, "ms") if ledger == "wall" else (1e-9, "GFLOP")
        values = (f"{costs[name] * scale:,.3f} {unit}" if name in costs else "—" for name in measured.runs)
        rows.append((ledger, *values, f"{per_image[ledger]:.2f}" if ledger in per_image else "—"))
    header = ("ledger", *measured.runs, f"{measured.rival} / {measured.own}")
    note = (
        "Equal cost depends on how cost is counted. Where the last column is below 1, a cycle costs more than a whole "
        "image of the rival, and the comparison does not favour the run. The ledger work prices every counted ray at "
        f"{per_segment(measured.cost):,.0f} FLOP."
    )
    return Table("Cost of a cycle by ledger", header, rows, note)
