"""Which runs a suitability study has, and which options it refuses."""

from __future__ import annotations

import pytest

from analysis.study.inputs import INPUTS
from analysis.suitability.options import SuitabilityOptions
from analysis.suitability.runs import runs
from tsar.config import ConfigError
from tsar.policies import RIVALS


def test_the_whole_study() -> None:
    planned = runs(SuitabilityOptions(repetitions=2))
    adaptive = [run for run in planned if run.label == "thesis"]
    assert len(adaptive) == 2 * 5 * 16
    assert {(run.case.input, run.row, run.repetition) for run in adaptive} == {
        (name, row, number) for name in INPUTS for row in range(16) for number in (0, 1)
    }
    framed = [run for run in planned if run.label == "framed"]
    assert len(framed) == len({run.case for run in framed}) == 2 * 5 * 3
    assert {run.case.tsar.seed for run in adaptive if run.repetition == 1} == {1}
    assert {run.case.phase for run in planned if run.repetition == 1} == {0.5}
    assert {run.repetition for run in planned if run.case.jod_span_s} == {0}
    assert len({run.case for run in planned}) == len(planned)
    assert {run.case.scale.stride for run in runs(SuitabilityOptions(repetitions=1, metric_stride=30))} == {30}


def test_policies_and_rivals_run_at_every_row() -> None:
    options = SuitabilityOptions(
        inputs=("chase",), rows=(0, 7), repetitions=1, policies=("frameless",), rivals=("framed-half", "afr"), beside=()
    )
    found = [(run.label, run.row, run.side_px) for run in runs(options)]
    framed = [(name, None, side) for name in ("framed", "framed-half") for side in (64, 128)]
    rows = [(name, row, side) for name in ("frameless", "afr") for row, side in ((0, 64), (7, 128))]
    assert sorted(found, key=str) == sorted(framed + rows, key=str), "solvers are of the policy thesis"


def test_all_rivals_run_by_default() -> None:
    planned = runs(SuitabilityOptions(inputs=("chase",), repetitions=1))
    assert set(RIVALS) <= {run.label for run in planned} and "oracle" not in RIVALS
    for name in RIVALS:
        assert sum(run.label == name for run in planned) == (3 if name.startswith("framed-") else 16)


def test_some_stand_beside_at_one_row() -> None:
    planned = runs(SuitabilityOptions(inputs=("chase",), rows=(0, 7), repetitions=1, rivals=("afr",)))
    others = {run.label: run for run in planned if run.label not in ("thesis", "framed", "afr")}
    assert set(others) == {"oracle", "thesis trivial"}
    assert {run.side_px for run in others.values()} == {128}
    assert others["thesis trivial"].case.tsar.response.solver == "trivial"
    only = runs(SuitabilityOptions(inputs=("chase",), rows=(0,), repetitions=1, rivals=()))
    assert [run.label for run in only] == ["framed", "thesis"], "that row was not asked for"


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"inputs": ("nowhere",)}, "inputs.*nowhere"),
        ({"inputs": ()}, "inputs"),
        ({"metric_stride": 0}, "metric_stride"),
        ({"rows": (16,)}, "rows.*0 to 15"),
        ({"rows": (1, 1)}, "rows.*none twice"),
        ({"policies": ("magic",)}, "policies"),
        ({"policies": ()}, "policies"),
        ({"rivals": ("magic",)}, "rivals"),
        ({"beside": ("magic",)}, "beside"),
        ({"repetitions": 0}, "repetitions"),
        ({"policy_row": -1}, "policy_row"),
    ],
)
def test_bad_options_are_refused(changes, message) -> None:
    with pytest.raises(ConfigError, match=message):
        SuitabilityOptions(**changes)
