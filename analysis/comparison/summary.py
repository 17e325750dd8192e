"""The measurements of a comparison, and the numbers of its summary and report that follow from them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from analysis.metrics.arrays import Floats
from analysis.metrics.cost_model import (
    LEDGERS,
    CostParameters,
    control_flops,
    policy_flops,
    stage_flops,
)
from analysis.metrics.quality import RatioStatistics, ratio, ratio_statistics
from analysis.page.comparer import Panel, Step
from analysis.study.displays import DisplayRecord
from analysis.study.runs import PolicyRun, Totals
from analysis.study.spending import cycle_flops

AROUND = "all others"
"""Name of the stages around tracing if they have one price."""


@dataclass(frozen=True)
class Measured:
    """Everything a comparison measured.

    Attributes:
        own: name of the policy whose rivals the others are.
        times_s: reference times, seconds.
        seen: errors of the images on every display, by name; ratios are to the first rival.
        runs: the runs, by name.
        steps: pictures at evenly spaced times, for the page.
        panels: the runs and maps that the pictures show.
        reference_nonfinite: number of non-finite values in the reference.
        cost: parameters of the cost model, scalars.
        sequences: values of metrics of sequences, by metric and run.
        recorded: the run whose cycles are on disk; None if no run records them.
    """

    own: str
    times_s: Floats
    seen: Mapping[str, DisplayRecord]
    runs: Mapping[str, PolicyRun]
    steps: list[Step]
    panels: list[Panel]
    reference_nonfinite: int
    cost: CostParameters
    sequences: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    recorded: str | None = None

    @property
    def rivals(self) -> list[str]:
        """Names of the other runs."""
        return [name for name in self.seen if name != self.own]

    @property
    def rival(self) -> str | None:
        """The first rival, to which ratios are; None if there is none."""
        return self.rivals[0] if self.rivals else None

    @property
    def totals(self) -> Totals:
        """Sums over the cycles of the policy ``own``."""
        return self.runs[self.own].totals

    @property
    def own_cost(self) -> CostParameters:
        """Parameters of the cost model with the overdraw of the mean cycle of ``own``."""
        return self.totals.of_a_cycle(self.cost)

    @cached_property
    def invariants(self) -> dict[str, Any] | None:
        """Invariants checked in every recorded cycle of the run whose cycles are on disk, whether all hold in every run
        that records, and the names of these runs (``runs``); None if no run records."""
        found = {name: run.totals.invariants for name, run in self.runs.items() if run.totals.recorded}
        if self.recorded is None or not found:
            return None
        return {**found[self.recorded], "ok": all(one["ok"] for one in found.values()), "runs": list(found)}

    @cached_property
    def mse(self) -> dict[str, Floats]:
        """Mean squared errors at the reference times, by name of the run."""
        return {name: seen.column("mse") for name, seen in self.seen.items()}

    def ratio(self) -> Floats:
        """The error of ``own`` over the first rival's at the reference times; empty if there is no rival."""
        return ratio(self.mse[self.own], self.mse[self.rival]) if self.rival else np.empty(0)

    def statistics(self, rival: str, column: str = "mse") -> RatioStatistics:
        """Statistics of the error ratio to a rival."""
        return ratio_statistics(self.seen[self.own].column(column), self.seen[rival].column(column))

    def period_s(self, name: str) -> float:
        """Mean time between images of a display, seconds; NaN if it showed a single one."""
        refresh = self.seen[name].refresh_s
        return (refresh[-1] - refresh[0]) / (len(refresh) - 1) if len(refresh) > 1 else float("nan")


def ledger_costs(measured: Measured) -> dict[str, dict[str, float]]:
    """Cost of a cycle of every run under every ledger; FLOPs, except under ``wall``, which is seconds."""
    costs: dict[str, dict[str, float]] = {ledger: {} for ledger in LEDGERS}
    for name, run in measured.runs.items():
        totals, meter = run.totals, run.meter
        # the cycles of the measured span, or all if it has none
        counters, cycles = (totals.counters, totals.cycles) if totals.cycles else (meter.counters, max(meter.calls, 1))
        mean = {counter: count / cycles for counter, count in counters.items()}
        for ledger, flops in cycle_flops(totals.of_a_cycle(measured.cost), run.price, mean).items():
            costs[ledger][name] = flops
        costs["wall"][name] = (sum(totals.stage_s.values()) if totals.cycles else meter.wall_s) / cycles
    return {ledger: found for ledger, found in costs.items() if found}


def cycles_per_image(measured: Measured) -> dict[str, float]:
    """Number of cycles of the run that cost as much as one cycle of the rival, under every ledger."""
    own, rival = measured.own, measured.rival
    return {
        ledger: found[rival] / found[own] if found[own] > 0 else float("inf")
        for ledger, found in ledger_costs(measured).items()
        if rival and own in found and rival in found
    }


def segments(counters: Mapping[str, float]) -> float:
    """Counted ray segments per sample."""
    primary = counters.get("primary_rays", 0)
    return sum(value for name, value in counters.items() if name.endswith("_rays")) / primary if primary else 0.0


def summarise(measured: Measured) -> dict[str, Any]:
    """The results part of ``summary.json``."""
    totals, own, seen = measured.totals, measured.own, measured.seen
    found: dict[str, Any] = {
        "policy": own,
        "rivals": measured.rivals,
        "reference_time_s": measured.times_s,
        "mse": measured.mse,
        "log_mse": {name: one.column("log_mse") for name, one in seen.items()},
        "metrics": metrics_of(measured),
        "images": {name: one.images for name, one in seen.items()},
        "refresh_s": {name: one.refresh_s for name, one in seen.items()},
        **_ratios(measured),
        "cycles": totals.cycles,
        "warmup_cycles": totals.warmup_cycles,
        "cycle_s": totals.simulated_s / max(totals.cycles, 1),
        "recorded": measured.recorded,
        "age_spread_s": totals.age_spread_s / max(totals.cycles, 1) if totals.recorded else float("nan"),
        "samples_traced": totals.counters.get("primary_rays", 0),
        "samples_per_s": totals.counters.get("primary_rays", 0) / totals.simulated_s if totals.simulated_s else 0.0,
        "counters": dict(totals.counters),
        "segments_counted": segments(totals.counters),
        "segments_modelled": measured.cost.trace_segments,
        "stage_wall_s": dict(totals.stage_s),
        "stage_flops": {name: flops * totals.cycles for name, flops in modelled_stages(measured).items()},
        "overdraw": overdraw(measured, own),
        "saturation": totals.saturation,
        "ledgers": ledger_costs(measured),
        "cycles_per_image": cycles_per_image(measured),
        "conclusion_changes_with_ledger": len({n >= 1 for n in cycles_per_image(measured).values()}) > 1,
        "invariants": measured.invariants,
        "nonfinite": {
            **{name: one.nonfinite + measured.runs[name].nonfinite_samples for name, one in seen.items()},
            "fields": sum(run.totals.nonfinite_fields for run in measured.runs.values()),
            "reference": measured.reference_nonfinite,
        },
    }
    return found


def metrics_of(measured: Measured) -> dict[str, dict[str, float]]:
    """Mean over time of all metrics beside the squared errors, by metric and run."""
    known = ("time_s", "mse", "log_mse", "refresh")
    names = dict.fromkeys(name for seen in measured.seen.values() for row in seen.rows for name in row)
    means = {
        metric: {name: float(np.nanmean(seen.column(metric))) for name, seen in measured.seen.items()}
        for metric in names
        if metric not in known
    }
    return means | {metric: dict(values) for metric, values in measured.sequences.items()}


def _ratios(measured: Measured) -> dict[str, Any]:
    if measured.rival is None:
        return {}
    statistics = {name: measured.statistics(name) for name in measured.rivals}
    first = statistics[measured.rival]
    return {
        "ratio": measured.ratio(),
        "ratio_median": first.median,
        "ratio_quartiles": [first.quartile_low, first.quartile_high],
        "share_suitable": first.share_suitable,
        "suitable_percentile": first.suitable_percentile,
        "ratio_statistics": statistics,
        "log_ratio_statistics": {name: measured.statistics(name, "log_mse") for name in measured.rivals},
    }


def overdraw(measured: Measured, name: str) -> float:
    """Framelets that the mean cycle of a run accumulated at each pixel; NaN if it accumulates none."""
    totals = measured.runs[name].totals
    drawn = totals.counters.get("framelet_pixels", 0)
    return float(totals.of_a_cycle(measured.cost).overdraw) if drawn else float("nan")


def modelled_stages(measured: Measured) -> dict[str, float]:
    """FLOPs of a cycle of ``own`` by stage; the stages around tracing are one entry if they have one price."""
    cost, price = measured.own_cost, measured.runs[measured.own].price
    if price.adaptive_stages:
        return {name: float(flops) for name, flops in stage_flops(cost).items()}
    control = float(control_flops(cost, price))
    return {"tracing": float(policy_flops(cost, price)) - control, AROUND: control}


def measured_stages(measured: Measured) -> dict[str, float]:
    """Wall seconds of ``own`` by the stages of :func:`modelled_stages`."""
    seconds: dict[str, float] = dict(measured.totals.stage_s)
    if measured.runs[measured.own].price.adaptive_stages or not seconds:
        return seconds
    return {"tracing": seconds.pop("tracing", 0.0), AROUND: sum(seconds.values())}
