"""Distances in JOD become the batch sizes that an observer notices and prefers."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pandas as pd
import pytest

from analysis.command.progress import Task
from analysis.perception import adaptive
from analysis.perception.adaptive import judged, scores, thresholds
from analysis.perception.options import AdaptiveOptions
from tsar.config import ConfigError


def test_noticed_and_preferred() -> None:
    table = pd.DataFrame(
        {
            "input": ["a", "a", "b"],
            "batch": [32, 128, 32],
            "jod_policy": [2.21, 0.0, 3.0],
            "jod_framed": [1.0, 1.0, 2.0],
        }
    )
    found = judged(table, 1.048)
    assert found["noticed_policy"][0] == pytest.approx(0.75, abs=2e-3) and found["noticed_policy"][1] == 0.5
    assert found["policy_preferred"][1] == pytest.approx(0.75, abs=2e-3)  # one JOD
    assert found["policy_preferred"][2] == pytest.approx(0.25, abs=2e-3)
    rows = thresholds(judged(table, 1.0)).set_index("input")
    assert rows.loc["a", "noticed_at"] == "32" and rows.loc["a", "preferred_at"] == "128"
    assert rows.loc["b", "framed_preferred_at"] == "32" and rows.loc["b", "preferred_at"] == "none"


def test_any_policy_in_any_scene(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    jods = {"tsar": 9.0, "framed": 7.5}
    monkeypatch.setattr(adaptive, "run_cases", lambda cases, *_: ({case: case for case in cases}, {}))

    def finished(case: Any, place: Any) -> dict[str, Any]:
        assert case.input == "glass"
        return {"key": case.name, "jod": jods[case.policy]}

    monkeypatch.setattr(adaptive, "finished", finished)
    table = scores(AdaptiveOptions(inputs=("glass",), policy="tsar", out=tmp_path, references=tmp_path), Task())
    assert set(table["policy"]) == {"tsar"} and list(table["batch"]) == sorted(table["batch"])
    assert set(table["jod_policy"]) == {1.0} and set(table["jod_framed"]) == {2.5}


def test_what_it_refuses() -> None:
    for wrong, part in (
        ({"inputs": ("glas",)}, "nearest: glass"),
        ({"inputs": ()}, "at least one"),
        ({"policy": "tsra"}, "nearest: tsar"),
        ({"policy": "framed"}, "other than framed"),
    ):
        with pytest.raises(ConfigError, match=part):
            AdaptiveOptions(**wrong)
