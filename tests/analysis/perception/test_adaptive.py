"""Distances in JOD become the batch sizes that an observer notices and prefers."""

from __future__ import annotations

import pandas as pd
import pytest

from analysis.perception.adaptive import judged, thresholds


def test_noticed_and_preferred() -> None:
    table = pd.DataFrame(
        {
            "input": ["a", "a", "b"],
            "batch": [32, 128, 32],
            "jod_thesis": [2.21, 0.0, 3.0],
            "jod_framed": [1.0, 1.0, 2.0],
        }
    )
    found = judged(table, 1.048)
    assert found["noticed_thesis"][0] == pytest.approx(0.75, abs=2e-3) and found["noticed_thesis"][1] == 0.5
    assert found["thesis_preferred"][1] == pytest.approx(0.75, abs=2e-3)  # one JOD
    assert found["thesis_preferred"][2] == pytest.approx(0.25, abs=2e-3)
    rows = thresholds(judged(table, 1.0)).set_index("input")
    assert rows.loc["a", "noticed_at"] == "32" and rows.loc["a", "preferred_at"] == "128"
    assert rows.loc["b", "framed_preferred_at"] == "32" and rows.loc["b", "preferred_at"] == "none"
