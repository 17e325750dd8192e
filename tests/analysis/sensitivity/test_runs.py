"""Which runs a sensitivity study has, and which options it refuses."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest

from analysis.sensitivity.options import SensitivityOptions
from analysis.sensitivity.runs import TemplateSetting, runs, sweeps
from analysis.study.cases import SCALES, framed_config
from analysis.study.inputs import INPUTS
from tests.analysis.sensitivity.builders import TWO
from tsar.config import ConfigError, ErrorConfig, ResponseConfig, TsarConfig


def test_cases_are_made_once() -> None:
    planned = runs(SensitivityOptions())
    assert len(planned) == len({run.case for run in planned}) == len({run.place for run in planned})
    per_input = 1 + 9 + 4 + 4 + 4
    assert len(planned) == len(INPUTS) * per_input
    default = TemplateSetting.of(TsarConfig())
    assert sum(run.setting == default for run in planned) == len(INPUTS)
    assert all(default in settings for settings in sweeps(SensitivityOptions()).values())
    assert sum(run.case.policy == "framed" for run in planned) == sum(run.setting is None for run in planned) == 5


def test_a_case_is_the_row_at_its_setting() -> None:
    base = TsarConfig(error=ErrorConfig(norm="linf", spatial_offset=-6.0), response=ResponseConfig(gain=0.5))
    options = SensitivityOptions(inputs=("fast-crossing",), row=8, tsar=base, repetitions=2, scale="half")
    row = SCALES["half"].config(8, base)
    for run in runs(options):
        if run.setting is None:
            assert run.case.tsar == framed_config(row.resolution_px)
            continue
        assert TemplateSetting.of(run.case.tsar) == run.setting
        back = TemplateSetting.of(base).applied(dataclasses.replace(run.case.tsar, seed=0))
        assert back == row and run.case.tsar.seed == run.repetition
        assert run.case.phase == run.repetition / 2
        assert run.case.stills_s == ((options.still_s,) if run.repetition == 0 else ())
    offsets = {one.spatial_offset for one in sweeps(options)["spatial offset"]}
    assert offsets == {-10.0, -8.0, -6.0, -4.0, -2.0}
    assert {one.temporal_offset for one in sweeps(options)["spatial offset"]} == {-9.0}


def test_the_default_runs_even_where_no_sweep_holds_it() -> None:
    options = SensitivityOptions(
        inputs=("chase",), figure_input="chase", spatial_slopes=(-3.0,), temporal_slopes=(-3.0,), offsets=(), biases=()
    )
    assert [run.setting for run in runs(options)] == [
        None,
        TemplateSetting.of(TsarConfig()),
        TemplateSetting.of(TsarConfig()).changed(spatial_slope=-3, temporal_slope=-3),
    ]


def test_slopes_run_from_steep_to_flat_in_any_order_given() -> None:
    options = dataclasses.replace(TWO, spatial_slopes=(0.0, -2.0, -1.0), temporal_slopes=(-0.0, -3.0))
    pairs = [(one.temporal_slope, one.spatial_slope) for one in sweeps(options)["slopes"]]
    assert pairs == [(-3, -2), (-3, -1), (-3, 0), (0, -2), (0, -1), (0, 0)]
    assert all(np.copysign(1.0, pair[0]) == 1.0 for pair in pairs[3:]), "-0.0 would be another file than 0.0"


@pytest.mark.parametrize(
    ("values", "parts"),
    [
        ({"inputs": ("moon",)}, ("inputs", "moon", "fly-by")),
        ({"inputs": ()}, ("inputs", "at least one")),
        ({"inputs": ("chase",)}, ("figure_input", "fast-crossing")),
        ({"row": 16}, ("row", "16")),
        ({"spatial_slopes": ()}, ("spatial_slopes",)),
        ({"temporal_slopes": (0.0, -0.0)}, ("temporal_slopes", "none twice")),
        ({"offsets": (1.0, 1.0)}, ("offsets", "none twice")),
        ({"repetitions": 0}, ("repetitions", "0")),
        ({"still_s": SCALES["quick"].seconds}, ("still_s", f"{SCALES['quick'].seconds:g} s")),
        ({"biases": (9.0,)}, ("biases", "9.0")),
        ({"offsets": (float("nan"),)}, ("offsets", "nan")),
        ({"ledger": "wall"}, ("ledger", "wall")),
    ],
)
def test_what_is_refused(values: dict[str, Any], parts: tuple[str, ...]) -> None:
    with pytest.raises(ConfigError) as refused:
        runs(SensitivityOptions(**values))
    assert all(part in str(refused.value) for part in parts)
