"""From what a comparison measured to the tables of its summary and report."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from analysis.compare import Comparison, Meter, Totals
from analysis.cost_model import (
    LEDGERS,
    MODELLED,
    CostParameters,
    adaptive_flops,
    nonadaptive_flops,
    per_segment,
    stage_flops,
    work_flops,
)
from analysis.quality import RatioStatistics, ratio, ratio_statistics
from analysis.report import Table


@dataclass(frozen=True)
class Measured:
    """Everything a run measured.

    Attributes:
        comparison: errors over time.
        totals: sums over the adaptive cycles.
        framed: meter of each framed renderer by name; the first is the one compared to.
        framed_samples_per_axis: of each framed renderer.
        invariants: result of the check of the step records.
        reference_nonfinite: non-finite values in the reference.
        cost: parameters of the cost model, scalars.
    """

    comparison: Comparison
    totals: Totals
    framed: Mapping[str, Meter]
    framed_samples_per_axis: Mapping[str, int]
    invariants: Mapping[str, Any]
    reference_nonfinite: int
    cost: CostParameters

    @property
    def main(self) -> str:
        """Name of the framed renderer compared to."""
        return next(iter(self.framed))

    def statistics(self, name: str, log: bool = False) -> RatioStatistics:
        """Statistics of the error ratio to one framed renderer."""
        kind = "log_mse" if log else "mse"
        adaptive, framed = getattr(self.comparison.adaptive, kind), getattr(self.comparison.framed[name], kind)
        return ratio_statistics(np.array(adaptive), np.array(framed))


def ledger_costs(measured: Measured) -> dict[str, dict[str, float]]:
    """Cost of an adaptive cycle and of a framed image, and their ratio, under every ledger.

    FLOPs, except under ``wall``, which is seconds.
    """
    p, totals, meter = measured.cost, measured.totals, measured.framed[measured.main]
    cycles = max(totals.cycles, 1)
    axis = measured.framed_samples_per_axis[measured.main]
    costs = {
        ledger: (float(adaptive_flops(p, ledger)), float(nonadaptive_flops(p, ledger, axis))) for ledger in MODELLED
    }
    control = sum(float(value) for name, value in stage_flops(p).items() if name != "tracing")
    if totals.counters and meter.counters:
        # means of counts are not whole, which the price does not mind
        adaptive = work_flops(p, totals.counters) / cycles + control
        costs["work"] = (adaptive, work_flops(p, meter.counters) / max(meter.calls, 1))
    costs["wall"] = (sum(totals.stage_s.values()) / cycles, meter.wall_s / max(meter.calls, 1))
    return {
        ledger: {"adaptive": costs[ledger][0], "nonadaptive": costs[ledger][1], "advantage": _over(*costs[ledger])}
        for ledger in LEDGERS
        if ledger in costs
    }


def _over(adaptive: float, nonadaptive: float) -> float:
    return nonadaptive / adaptive if adaptive > 0 else float("inf")


def segments(counters: Mapping[str, float]) -> float:
    """Ray segments per sample that were counted."""
    primary = counters.get("primary_rays", 0)
    return sum(value for name, value in counters.items() if name.endswith("_rays")) / primary if primary else 0.0


def summarise(measured: Measured) -> dict[str, Any]:
    """The results part of ``summary.json``."""
    c, totals, main = measured.comparison, measured.totals, measured.main
    flops = {name: float(value) * totals.cycles for name, value in stage_flops(measured.cost).items()}
    statistics = measured.statistics(main)
    adaptive, framed = np.array(c.adaptive.mse), np.array(c.framed[main].mse)
    ledgers = ledger_costs(measured)
    found: dict[str, Any] = {
        "reference_time_s": c.times_s,
        "mse_tsar": adaptive,
        "mse_framed": framed,
        "ratio": ratio(adaptive, framed),
        "log_mse_tsar": c.adaptive.log_mse,
        "log_mse_framed": c.framed[main].log_mse,
        "suitable_percentile": statistics.suitable_percentile,
        "ratio_median": statistics.median,
        "ratio_quartiles": [statistics.quartile_low, statistics.quartile_high],
        "share_suitable": statistics.share_suitable,
        "ratio_statistics": statistics,
        "log_ratio_statistics": measured.statistics(main, log=True),
        "cycles": totals.cycles,
        "warmup_cycles": totals.warmup_cycles,
        "framed_images": measured.framed[main].calls,
        "framed_refresh_s": c.refresh_s,
        "cycle_s": totals.simulated_s / max(totals.cycles, 1),
        "age_spread_s": totals.age_spread_s / max(totals.cycles, 1),
        "samples_traced": totals.counters.get("primary_rays", 0),
        "samples_per_s": totals.counters.get("primary_rays", 0) / totals.simulated_s if totals.simulated_s else 0.0,
        "counters": dict(totals.counters),
        "segments_counted": segments(totals.counters),
        "segments_modelled": measured.cost.trace_segments,
        "stage_wall_s": dict(totals.stage_s),
        "stage_flops": flops,
        "ledgers": ledgers,
        "conclusion_changes_with_ledger": len({entry["advantage"] >= 1 for entry in ledgers.values()}) > 1,
        "invariants": measured.invariants,
        "nonfinite": {
            "tsar": totals.nonfinite,
            "tsar_fields": totals.nonfinite_fields,
            "reference": measured.reference_nonfinite,
            **c.framed_nonfinite,
        },
    }
    for name in list(c.framed)[1:]:
        key = name.replace(" ", "_")
        found[f"mse_{key}"] = c.framed[name].mse
        found[f"ratio_statistics_{key}"] = measured.statistics(name)
    return found


def key_table(measured: Measured, framed_period_s: float) -> Table:
    """The numbers to look at first."""
    c, totals = measured.comparison, measured.totals
    rows = [
        ("cycles of TSAR", f"{totals.cycles}, {1e3 * totals.simulated_s / max(totals.cycles, 1):.2f} ms each"),
        ("period of the framed renderer", f"{1e3 * framed_period_s:.1f} ms"),
        ("samples per cycle of TSAR", f"{totals.counters.get('primary_rays', 0) / max(totals.cycles, 1):,.0f}"),
        ("non-finite samples replaced", str(totals.nonfinite)),
        ("non-finite densities and errors", str(totals.nonfinite_fields)),
        ("invariants hold in every cycle", "yes" if measured.invariants["ok"] else f"NO: {dict(measured.invariants)}"),
        ("spread of ages in moving regions", f"{1e3 * totals.age_spread_s / max(totals.cycles, 1):.0f} ms"),
    ]
    rows.insert(0, ("median MSE of TSAR", f"{np.median(c.adaptive.mse):.3e}"))
    for name, trace in c.framed.items():
        s = measured.statistics(name)
        rows.append((f"median MSE, {name}", f"{np.median(trace.mse):.3e}"))
        rows.append((f"ratio to {name}: median", f"{s.median:.3f}"))
        rows.append((f"ratio to {name}: quartiles", f"{s.quartile_low:.3f} – {s.quartile_high:.3f}"))
        rows.append((f"ratio to {name}: at most 1", f"{100 * s.share_suitable:.0f} % of the time"))
        rows.append((f"ratio to {name}: greatest suitable percentile", f"{s.suitable_percentile:.0f}"))
        rows.append((f"ratio to {name}: outliers, infinite", f"{s.outliers}, {s.infinite}"))
    log = measured.statistics(measured.main, log=True)
    rows.append((f"ratio of log-compressed MSE to {measured.main}: median", f"{log.median:.3f}"))
    disagree = (log.median > 1) != (measured.statistics(measured.main).median > 1)
    note = "The two measures disagree on which renderer is better." if disagree else ""
    return Table("Key numbers", ("", "value"), rows, note)


def stage_table(measured: Measured) -> Table:
    """Per stage: share by the model beside what was measured."""
    flops, wall, cycles = stage_flops(measured.cost), measured.totals.stage_s, max(measured.totals.cycles, 1)
    total, total_s = sum(float(v) for v in flops.values()), sum(wall.values()) or 1.0
    rows = []
    for name in dict.fromkeys((*flops, *wall)):
        cost, seconds = float(flops.get(name, 0.0)), wall.get(name, 0.0)
        shares = (f"{100 * cost / total:.1f} %", f"{1e3 * seconds / cycles:.2f}", f"{100 * seconds / total_s:.1f} %")
        rows.append((name, f"{cost / 1e6:,.2f}", *shares))
    header = ("stage", "modelled, MFLOP a cycle", "modelled share", "measured, ms a cycle", "measured share")
    counted = segments(measured.totals.counters)
    note = f"Segments per sample: {counted:.2f} counted, {measured.cost.trace_segments} modelled."
    return Table("Stages: model against measurement", header, rows, note)


def ledger_table(measured: Measured) -> Table:
    """Cost of both renderers under every ledger."""
    rows = []
    for ledger, cost in ledger_costs(measured).items():
        scale, unit = (1e3, "ms") if ledger == "wall" else (1e-9, "GFLOP")
        values = (f"{cost[name] * scale:,.3f} {unit}" for name in ("adaptive", "nonadaptive"))
        rows.append((ledger, *values, f"{cost['advantage']:.2f}"))
    header = ("ledger", "adaptive cycle", "framed image", "cycles per image")
    note = (
        "Equal cost depends on how cost is counted. Below 1 a cycle costs more than a whole framed image, and the "
        "comparison no longer favours the adaptive renderer. The ledger work prices every counted ray at "
        f"{per_segment(measured.cost):,.0f} FLOP."
    )
    return Table("Sensitivity to the ledger", header, rows, note)
