"""The study of parts from the command line, small: its files, continuing where it was, and its failures."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pandas as pd
import pytest
from PIL import Image

from analysis.metrics.budget import SHARES
from analysis.study.cases import Case
from tests.scripts.commands import call_script

SMALL = ("--inputs", "fly-by", "--rows", "0", "--repetitions", "1", "--rivals", "--parts", "smoothing", "latency")


def test_a_small_study(runs: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys) -> None:
    places = ("--out", str(tmp_path / "out"), "--references", str(tmp_path / "cache"))
    assert call_script("ablation.py", monkeypatch, *SMALL, *places) == 0
    out, shown = tmp_path / "out", capsys.readouterr().out
    assert len(runs) == 4 and "4 of 4 runs" in shown and "no blending at display" in shown

    summary = json.loads((out / "summary.json").read_text())
    assert summary["runs"] == summary["runs_done"] == 4 and not summary["failures"]
    assert summary["parts"]["latency of 3 cycles"] == {"latency_cycles": 3}
    parts, budget, floor = (pd.read_csv(out / "tables" / f"{name}.csv") for name in ("parts", "budget", "floor"))
    assert len(parts) == 3 * 2 and (parts["change"][parts["policy"] == "all of it"] == 1.0).all()
    assert (parts["change"][parts["policy"] != "all of it"] != 1.0).all()
    assert budget[list(SHARES)].sum(axis=1)[0] == pytest.approx(budget["ratio"][0]) == pytest.approx(floor["policy"][0])
    moments = pd.read_parquet(out / "moments.parquet")
    assert len(moments) == 3 * 4 and (moments["best-rival"] == moments["framed"]).all()
    assert Image.open(out / "parts_row_0.png").width > 1000

    tables = {file.name: file.read_bytes() for file in (out / "tables").iterdir()}
    assert call_script("ablation.py", monkeypatch, *SMALL, "--markdown", *places) == 0
    assert len(runs) == 4, "nothing is run twice"
    assert {file.name: file.read_bytes() for file in (out / "tables").iterdir()} == tables
    assert (out / "tables.md").read_text() in capsys.readouterr().out


def test_the_reasons_of_failures_are_said(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys) -> None:
    def run_cases(asked: list[Case], *rest: Any) -> tuple[dict[Case, str], dict[Case, str]]:
        keys = {case: case.key("source") for case in asked}
        return keys, dict.fromkeys(keys, "OSError: No space left on device")

    monkeypatch.setattr("analysis.study.farm.run_cases", run_cases)
    places = ("--out", str(tmp_path), "--references", str(tmp_path))
    assert call_script("ablation.py", monkeypatch, *SMALL, *places) == 1
    shown = capsys.readouterr()
    assert shown.err.count("failed: ") == 1 and "and 3 more: OSError" in shown.err and "0 of 4 runs" in shown.out
    found = json.loads((tmp_path / "summary.json").read_text())
    assert (found["runs_done"], len(found["failures"])) == (0, 4) and not list(tmp_path.glob("*.png"))
