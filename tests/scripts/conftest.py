"""Studies from the command line, small."""

from __future__ import annotations

from typing import Any

import pytest

from analysis.study import evaluation
from analysis.study.cases import SCALES, Case, Scale
from analysis.study.evaluation import Resources

TINY = Scale(4, seconds=0.2, reference_rate_hz=20.0, reference_samples_per_axis=1, stride=4)


@pytest.fixture
def runs(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Names of the runs that were made, each in this process and small."""
    made = list[str]()

    def run_cases(asked: list[Case], place: Resources, *rest: Any) -> tuple[dict[Case, str], dict[Case, str]]:
        keys = {case: case.key(evaluation.source_of_results()) for case in asked}
        for case, key in keys.items():
            if evaluation.finished(key, place) is None:
                made.append(case.name)
                evaluation.evaluate(case, key, place)
        return keys, {}

    monkeypatch.setitem(SCALES, "quick", TINY)
    monkeypatch.setattr("analysis.study.farm.run_cases", run_cases)
    return made
