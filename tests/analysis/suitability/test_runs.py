"""Which runs a suitability study has, and which options it refuses."""

from __future__ import annotations

import pytest

from analysis.study.cases import INPUTS
from analysis.suitability.options import SuitabilityOptions
from analysis.suitability.runs import runs
from tsar.config import ConfigError


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


def test_policies_are_compared_at_one_row() -> None:
    planned = runs(SuitabilityOptions(inputs=("chase",), rows=(0, 7), repetitions=1))
    others = {run.label: run for run in planned if run.label not in ("thesis", "framed")}
    assert set(others) == {"framed-super", "frameless", "afr", "oracle", "thesis trivial"}
    assert {run.side_px for run in others.values()} == {128}
    assert others["thesis trivial"].case.tsar.response.solver == "trivial"
    only = runs(SuitabilityOptions(inputs=("chase",), rows=(0,), repetitions=1))
    assert [run.label for run in only] == ["framed", "thesis"], "the row of the policies was not asked for"


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"inputs": ("nowhere",)}, "inputs.*nowhere"),
        ({"inputs": ()}, "inputs"),
        ({"rows": (16,)}, "rows.*0 to 15"),
        ({"rows": (1, 1)}, "rows.*none twice"),
        ({"policies": ("magic",)}, "policies"),
        ({"repetitions": 0}, "repetitions"),
        ({"policy_row": -1}, "policy_row"),
    ],
)
def test_bad_options_are_refused(changes, message) -> None:
    with pytest.raises(ConfigError, match=message):
        SuitabilityOptions(**changes)
