"""Runs of different days on one page: what differs, what is the same once, and what cannot be read."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import numpy as np
import pytest

from analysis.comparison.days import finished_runs, outcome_table, page_of
from analysis.page.comparer import Comparer, Panel, Step, read_comparer
from analysis.page.report import Report, write_report
from tests.analysis.builders import png_bytes
from tests.scripts.commands import call_script

TIMES_S = [0.0, 0.1, 0.2]


def left(folder: Path, own: float, truth: int = 7, seed: int = 0, steps: int = 3, comparer: bool = True) -> Path:
    """The files of a run: errors of a policy and a rival, and pictures that distinguish them."""
    panels = [Panel("reference"), Panel("tsar", truth="reference"), Panel("framed", truth="reference")]
    values = {"reference": truth, "tsar": int(1000 * own), "framed": 90}
    pictures = {name: png_bytes(np.full((2, 2, 3), value, np.uint8)) for name, value in values.items()}
    made = Comparer(panels, [Step(t, pictures) for t in TIMES_S[:steps]], "framed", "tsar") if comparer else None
    write_report(folder / "report.html", Report("t", ["x"], None, comparer=made))
    summary = {
        "policy": "tsar", "rivals": ["framed"], "mse": {"tsar": [own] * 3, "framed": [0.1] * 3},
        "reference_time_s": TIMES_S, "config": {"input": "fly-by", "out": str(folder), "tsar": {"seed": seed}},
        "provenance": {"commit": f"{seed}abc", "processor": "p"},
        "ratio_statistics": {"framed": {"median": own / 0.1}},
    }  # fmt: skip
    (folder / "summary.json").write_text(json.dumps(summary))
    return folder


def test_runs_stand_side_by_side_with_their_differences(tmp_path: Path) -> None:
    runs = finished_runs([left(tmp_path / "monday", 0.05), left(tmp_path / "friday", 0.02, seed=3)])
    page = page_of(runs)
    assert page.comparer is not None
    labels = {panel.label: panel.truth for panel in page.comparer.panels}
    names = [f"{day}: {run}" for day in ("monday", "friday") for run in ("tsar", "framed")]
    assert labels == {"reference": "", **dict.fromkeys(names, "reference")}, "the same reference is there once"
    assert (page.comparer.left, page.comparer.right) == ("monday: tsar", "friday: tsar")
    assert [step.time_s for step in page.comparer.steps] == TIMES_S
    assert page.lead == ["The median error of tsar in friday is 0.400 times that of tsar in monday."]
    errors, ratios = page.comparer.plots
    assert [curve.label for curve in errors.curves] == ["monday: tsar", "monday: framed", "friday: tsar"], (
        "equal ones once"
    )
    assert ratios.curves[0].values == pytest.approx([0.4] * 3)
    assert [row[0] for row in page.tables[0].rows] == ["tsar.seed"] and page.tables[1].rows[0][0] == "commit"
    assert [row[3] for row in outcome_table(runs).rows] == ["—", "0.500", "—", "0.200"]


def test_the_command_takes_several_folders_and_says_where_its_page_is(tmp_path: Path, monkeypatch, capsys) -> None:
    folders = [str(left(tmp_path / name, 0.05, seed=seed)) for seed, name in enumerate("abc")]
    assert call_script("report.py", monkeypatch, *folders, "--out", str(tmp_path / "all")) == 0
    page = tmp_path / "all" / "report.html"
    assert f"look at it: {page.as_uri()}" in capsys.readouterr().out
    shown = read_comparer(page)
    assert {f"{name}: tsar" for name in "abc"} <= {panel.label for panel in shown.panels}


def test_other_references_and_shorter_runs_keep_their_own(tmp_path: Path) -> None:
    first, second = left(tmp_path / "a" / "run", 0.05), left(tmp_path / "b" / "run", 0.02, truth=8, steps=2)
    page = page_of(finished_runs([first, second]))
    assert page.comparer is not None
    labels = {panel.label: panel.truth for panel in page.comparer.panels}
    assert labels["a/run: tsar"] == "reference" and labels["b/run: tsar"] == "b/run: reference"
    last = page.comparer.steps[-1].pictures
    assert last["a/run: tsar"] and last.get("b/run: tsar") is None, "it has no picture of that time"


def test_what_cannot_be_read_is_said(tmp_path: Path) -> None:
    good, bare = left(tmp_path / "good", 0.05), left(tmp_path / "bare", 0.02, comparer=False)
    page = page_of(finished_runs([bare, good]))
    assert page.lead[-1] == "bare: its report.html holds no pictures that can be read back" and page.comparer
    with pytest.raises(ValueError, match="expected a run whose report.html holds pictures, got bare"):
        page_of(finished_runs([bare]))
    with pytest.raises(ValueError, match="folders: expected a folder once"):
        finished_runs([good, good])
    (bare / "summary.json").write_text("{}")
    with pytest.raises(ValueError, match=r"bare: expected the summary.json of a comparison, found none of policy"):
        finished_runs([bare])
    (bare / "summary.json").write_text("[" * 100_000)
    with pytest.raises(ValueError, match=r"bare: expected the folder of a finished run, found no summary.json"):
        finished_runs([bare])
    shutil.rmtree(bare)
    with pytest.raises(ValueError, match=r"bare: expected the folder of a finished run, found no summary.json"):
        finished_runs([bare])
