"""Requests of a run to the renderer, and sums over its cycles."""

from __future__ import annotations

import pytest
import torch

from analysis.study.runs import Meter, Totals
from tests.analysis.builders import good_record
from tsar.config import TsarConfig
from tsar.types import FrameletBatch, SampleBatch, Spent


def test_meter_counts_and_changes_nothing() -> None:
    answers = iter((SampleBatch(torch.ones(1, 2, 3), {"primary_rays": 2}), SampleBatch(torch.zeros(1, 2, 3), {"b": 5})))
    asked: list[FrameletBatch] = []

    def trace(batch: FrameletBatch) -> SampleBatch:
        asked.append(batch)
        return next(answers)

    zero = torch.zeros(1, dtype=torch.int64)
    batch = FrameletBatch(zero, zero, torch.zeros(1, 2, 2), 0.0)
    meter = Meter(trace)
    assert meter(batch).counters == {"primary_rays": 2} and meter(batch).counters == {"b": 5}
    assert asked[0] is batch and meter.calls == 2 and meter.counters == {"primary_rays": 2, "b": 5}
    assert meter.wall_s > 0.0


def test_totals_leave_out_warm_up() -> None:
    totals = Totals(TsarConfig())
    assert not totals.recorded
    for cycle in (-2, -1, 0, 1, 2):
        record = good_record(1, cycle=cycle, nonfinite=abs(cycle), nonfinite_fields=2 * abs(cycle))
        totals.count(Spent(cycle, 0.02, record.stage_s, record.counters))
        assert totals.recorded == (cycle > -2), "counting is not recording"
        totals.add(record)
    assert (totals.cycles, totals.warmup_cycles, totals.nonfinite) == (3, 2, 3) and totals.recorded
    assert totals.nonfinite_fields == 6
    assert totals.simulated_s == pytest.approx(0.06) and totals.age_spread_s == pytest.approx(0.375)
    assert totals.stage_s == {"tracing": 1.5, "error": 0.75}
    assert totals.counters == {"primary_rays": 3072, "shadow_rays": 30}


def test_totals_check_invariants_in_every_cycle() -> None:
    """These records are of a smaller batch and other bounds than the configuration's."""
    totals = Totals(TsarConfig())
    totals.add(good_record(1, cycle=-1))
    assert totals.invariants["cycles"] == 1 and not totals.invariants["ok"] and totals.invariants["batch_not_full"] == 1
