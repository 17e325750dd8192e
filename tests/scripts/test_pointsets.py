"""The command that measures point sets."""

from __future__ import annotations

import json
from pathlib import Path

import pandas as pd

from analysis.tracer.point_sets import SETS
from tests.scripts.commands import call_script


def test_tables_and_figures(tmp_path: Path, monkeypatch, capsys) -> None:
    out = tmp_path / "out"
    arguments = ("--levels", "1", "8", "27", "--cases", "64", "--sets-of-each", "1", "--frame-px", "16")
    assert call_script("pointsets.py", monkeypatch, *arguments, "--out", str(out)) == 0
    for name in ("projections", "gaussian", "times", "convergence", "blur"):
        assert (out / f"{name}.png").stat().st_size > 5_000, name
    assert len(pd.read_csv(out / "evenness.csv")) == 3 * len(SETS) and len(pd.read_csv(out / "errors.csv")) == 9 * len(
        SETS
    )
    assert len(json.loads((out / "summary.json").read_text())["slopes"]) == len(SETS)
    assert "slopes" in capsys.readouterr().out
