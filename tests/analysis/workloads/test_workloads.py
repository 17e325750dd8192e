"""Which runs the map of workloads has, its tables and its figure."""

from __future__ import annotations

import math
from typing import Any, cast

import numpy as np
import pandas as pd
import pytest

from analysis.metrics.cost_model import naive_per_pixel, policy_flops
from analysis.study.cases import is_framed
from analysis.workloads.options import WorkloadOptions
from analysis.workloads.plots import figure
from analysis.workloads.runs import UNPRICED, Run, Workload, runs
from analysis.workloads.tables import RunResult, map_table, paying_table, pays_from, policy_table, shown_tables
from tsar.config import ConfigError
from tsar.policies import POLICIES
from tsar.policy import Setting

OPTIONS = WorkloadOptions(
    inputs=("chase",), policies=("tsar", "framed-super", "afr-simple"), sample_flops=(1e3, 1e4), image_hz=(8.0, 2.0)
)


def test_a_sample_costs_what_is_asked_and_framed_keeps_its_rate() -> None:
    for run in runs(OPTIONS):
        assert run.case is not None
        if run.policy not in UNPRICED:
            assert float(naive_per_pixel(run.case.cost)) == pytest.approx(run.workload.sample_flops)
        per_sample = float(naive_per_pixel(run.case.cost))
        assert run.case.capacity == pytest.approx(run.workload.image_hz * run.case.tsar.resolution_px**2 * per_sample)


def test_what_is_charged_for_samples_alone_runs_once_for_all_prices() -> None:
    for name in UNPRICED:
        case = next(
            run.case for run in runs(WorkloadOptions(inputs=("chase",), policies=(name,))) if run.policy == name
        )
        assert case is not None
        price = POLICIES[name](Setting(case.tsar)).price
        costs = [policy_flops(case.cost, price) / price.samples, naive_per_pixel(case.cost)]
        assert costs[0] == costs[1], name
    planned = runs(OPTIONS)
    of_rate = [{run.case for run in planned if run.policy == "framed-super" and run.workload.image_hz == 8.0}]
    assert [len(cases) for cases in of_rate] == [1]
    assert len({run.case for run in planned if run.policy == "tsar"}) == 4


@pytest.mark.parametrize("side", [128, 256, 512, 1024, 4096])
def test_batches_have_an_eighth_as_many_samples_as_pixels(side: int) -> None:
    options = WorkloadOptions(inputs=("chase",), policies=("tsar",), sides_px=(side,), scale="thesis")
    case = next(run.case for run in runs(options) if not is_framed(run.policy))
    assert case is not None and case.tsar.batch_size * case.tsar.samples == side**2 // 8
    assert case.scale.reference_px == max(1024, side)


@pytest.mark.parametrize(("side", "scale"), [(64, "thesis"), (128, "quick"), (8192, "quick"), (384, "half")])
def test_sides_that_no_row_can_have_are_refused(side: int, scale: str) -> None:
    with pytest.raises(ConfigError, match=f"sides_px: expected powers of two from .* at scale {scale}, got"):
        WorkloadOptions(sides_px=(side,), scale=cast(Any, scale))


def test_a_policy_without_time_for_a_cycle_has_no_case() -> None:
    options = WorkloadOptions(inputs=("chase",), policies=("thesis", "frameless"), sample_flops=(1.0,), image_hz=(2.0,))
    assert [run.case is None for run in runs(options)] == [False, True, False], "frameless is cheaper than thesis"


def results(ratios: dict[str, list[float]]) -> list[RunResult]:
    """Errors of policies at prices of 1e2 and 1e4 FLOPs, over 2.0 of the framed renderer, at 8 images a second."""
    found = []
    for name, values in {"framed": [1.0, 1.0], **ratios}.items():
        for flops, ratio in zip((1e2, 1e4), values, strict=True):
            found.append(RunResult(Run(name, Workload(flops, 8.0, 512), 0, "chase", None), 2.0 * ratio))
    return found


def test_the_map_names_the_best_and_the_second() -> None:
    table = policy_table(results({"tsar": [4.0, 0.25], "afr": [math.nan, 0.5]}))
    found = map_table(table).set_index("sample_flops")
    assert list(found.loc[1e2, ["best", "ratio", "second", "second ratio"]]) == ["framed", 1.0, "tsar", 4.0]
    assert list(found.loc[1e4, ["best", "ratio", "second", "second ratio"]]) == ["tsar", 0.25, "afr", 0.5]
    shown = shown_tables(map_table(table), paying_table(table))
    assert shown[0].rows == [["8", "framed 1.000 (tsar 4.000)", "tsar 0.250 (afr 0.500)"]]
    assert [["512", "tsar", "1,000"], ["512", "afr", "10,000"]] == shown[1].rows
    axis = figure(map_table(table)).axes[0]
    assert [text.get_text() for text in axis.texts] == ["framed\n1.00", "tsar\n0.25"]


@pytest.mark.parametrize(
    ("ratio", "expected"),
    [
        ([0.9, 0.5, 0.2], 1e2),
        ([2.0, 0.5, 0.2], 1e3),
        ([4.0, 4.0, 0.5], 10.0 ** (4.0 + 4.0 / 3.0)),
        ([2.0, 0.5, 1.5], math.inf),
        ([math.nan, 0.5, 0.2], 1e4),
        ([0.5, math.nan, 0.2], 1e6),
    ],
)
def test_a_policy_pays_from_where_its_ratio_falls_below_one_for_good(ratio: list[float], expected: float) -> None:
    assert pays_from(np.array([1e2, 1e4, 1e6]), np.array(ratio)) == pytest.approx(expected)


def test_tables_of_nothing_are_empty() -> None:
    table = policy_table([])
    assert isinstance(table, pd.DataFrame) and map_table(table).empty and paying_table(table).empty
    assert shown_tables(map_table(table), paying_table(table)) == []
