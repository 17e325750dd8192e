"""The sensitivity study from the command line, on results made up beforehand, and what it refuses."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from PIL import Image

from analysis.command.cli import parse
from analysis.sensitivity import run as study
from analysis.sensitivity import runs as sensitivity
from analysis.sensitivity.options import SensitivityOptions
from analysis.sensitivity.runs import Run, TemplateSetting, runs
from analysis.study import cases
from analysis.study.cases import Case, Scale
from analysis.study.evaluation import Resources, finished, source_of_results
from tests.scripts.commands import assert_refused, call_script
from tsar.config import TsarConfig

SMALL = ("--inputs", "chase", "fast-crossing", "--offsets", "-2", "0", "2", "--biases", "0", "1")
FIGURES = {f"{name}.{kind}" for name in "fig_7_23 fig_7_24 fig_7_25 slopes sweeps".split() for kind in ("png", "svg")}


def options(*arguments: str) -> SensitivityOptions:
    return parse(SensitivityOptions, "", list(arguments))


def error(run: Run) -> float:
    """The least lies at the steepest spatial slope and the default temporal one; the framed renderer has 1."""
    if run.setting is None:
        return 1.0
    return float(np.exp(0.1 * (run.setting.spatial_slope + 2) + 0.2 * (run.setting.temporal_slope + 1) ** 2 - 0.3))


def fill(out: Path, planned: list[Run], more: dict[Case, dict[str, Any]] | None = None) -> None:
    """Results as the runs would leave them, without the runs."""
    place = Resources(out / "runs", out / "cache")
    (out / "runs" / "stills").mkdir(parents=True)
    rng, source = np.random.default_rng(0), source_of_results()
    for run in planned:
        key = run.case.key(source)
        files, store = place.files(key), place.store(key)
        with store.make(files["times"].name) as made:
            pd.DataFrame({"time_s": [0.0, 0.1], "mse": [error(run)] * 2}).to_parquet(made.path)
        stills = [f"stills/{place.still(key, what, 0).name}" for what in ("shown", "reference", "tiling")]
        for name in stills:
            with store.make(name) as made:
                Image.fromarray(rng.integers(0, 256, (64, 64, 3), dtype=np.uint8)).save(made.path)
        store.write_json(
            files["summary"].name, {"key": key, "case": run.case, "stills": stills, **(more or {}).get(run.case, {})}
        )


def summary(out: Path) -> dict[str, Any]:
    return json.loads((out / "summary.json").read_text())


def slopes(found: dict[str, Any]) -> dict[str, dict[str, Any]]:
    return {line["input"]: line for line in found["optima"] if line["sweep"] == "slopes"}


def test_results_on_disk_are_read_and_not_made_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture
) -> None:
    out, cache = tmp_path / "out", tmp_path / "cache"
    fill(out, runs(options(*SMALL)))
    before = {path: path.stat().st_mtime_ns for path in (out / "runs").rglob("*") if path.is_file()}
    assert call_script("sensitivity.py", monkeypatch, *SMALL, "--out", str(out), "--references", str(cache)) == 0
    shown = capsys.readouterr().out
    assert all(part in shown for part in ("slopes, best", "slopes, flatness", "bias, best", "30 of 30 runs", str(out)))
    found = summary(out)
    assert (found["runs"], found["runs_done"], found["failures"], found["ledger"]) == (30, 30, {}, "thesis")
    assert found["config"]["offsets"] == [-2.0, 0.0, 2.0] and len(found["provenance"]["config_hash"]) == 16
    for name in ("chase", "fast-crossing", "all inputs"):
        best = slopes(found)[name]
        assert (best["spatial_slope"], best["temporal_slope"]) == (-2.0, -1.0)
        assert best["to_default"] == pytest.approx(np.exp(-0.1)) and best["edge"] == "steepest spatial slope"
    table = pd.read_csv(out / "tables" / "settings.csv")
    assert len(table) == len(found["settings"]) == 2 * (9 + 3 + 3 + 2)
    assert table["ratio"].to_list() == pytest.approx([line["ratio"] for line in found["settings"]])
    assert len(pd.read_csv(out / "tables" / "optima.csv")) == len(found["optima"]) == 4 * 3
    assert {path.name for path in (out / "figures").iterdir()} == FIGURES
    for name in (one for one in FIGURES if one.endswith(".png")):
        with Image.open(out / "figures" / name) as picture:
            assert min(picture.size) > 300 and np.asarray(picture.convert("L"), float).std() > 5.0
    assert {path: path.stat().st_mtime_ns for path in (out / "runs").rglob("*") if path.is_file()} == before


def test_broken_invariants_end_with_a_status_of_their_own(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture
) -> None:
    out, planned = tmp_path / "out", runs(options(*SMALL))
    one = next(run.case for run in planned if run.case.policy == "thesis")
    fill(out, planned, {one: {"invariants": {"ok": False}}})
    monkeypatch.setattr(study, "write_all", lambda *_: [])
    status = call_script(
        "sensitivity.py", monkeypatch, *SMALL, "--out", str(out), "--references", str(tmp_path / "cache")
    )
    assert status == 3 and f"invariants are broken in 1 runs: {one.name}" in capsys.readouterr().err
    assert summary(out)["runs_done"] == 30


def test_failures_are_listed_and_the_rest_is_shown(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture
) -> None:
    out, source = tmp_path / "out", source_of_results()
    planned = runs(options(*SMALL))
    steep = TemplateSetting.of(TsarConfig()).changed(spatial_slope=-2.0, temporal_slope=-1.0)
    flat = steep.changed(temporal_slope=0.0)
    failed = [run for run in planned if run.input == "chase" and run.setting in (steep, flat)]
    fill(out, [run for run in planned if run not in failed])

    def no_workers(asked: Any, *rest: Any) -> tuple[dict[Any, str], dict[Any, str]]:
        return {case: case.key(source) for case in asked}, {failed[0].case: "RuntimeError: out of luck"}

    monkeypatch.setattr("analysis.study.farm.run_cases", no_workers)
    status = call_script(
        "sensitivity.py", monkeypatch, *SMALL, "--out", str(out), "--references", str(tmp_path / "cache")
    )
    assert status == 1
    shown = capsys.readouterr()
    names = [f"{run.case.name} {run.setting}" for run in failed]
    reasons = dict(zip(names, ("RuntimeError: out of luck", "no result"), strict=True))
    assert len(reasons) == 2 and all(f"failed: {name}: {reason}" in shown.err for name, reason in reasons.items())
    assert "28 of 30 runs" in shown.out
    found = summary(out)
    assert found["failures"] == reasons
    best = slopes(found)
    assert best["fast-crossing"]["spatial_slope"] == -2.0 and best["fast-crossing"]["settings"] == 9
    assert best["chase"]["spatial_slope"] == -1.0 and best["chase"]["settings"] == 7
    assert {path.name for path in (out / "figures").iterdir()} == FIGURES


def test_a_folder_that_cannot_be_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture
) -> None:
    (tmp_path / "file").write_text("kept")
    status = call_script("sensitivity.py", monkeypatch, "--out", str(tmp_path / "file" / "below"))
    assert_refused(status, capsys, ("out: cannot write to", str(tmp_path / "file")))
    assert (tmp_path / "file").read_text() == "kept"


@pytest.mark.slow
def test_a_study_from_end_to_end(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture
) -> None:
    """Runs on a cluster of one process, at a size far below any of the study's."""
    tiny = Scale(4, seconds=0.2, reference_rate_hz=15.0, reference_samples_per_axis=1, stride=2)
    monkeypatch.setitem(cases.SCALES, "quick", tiny)
    assert sensitivity.SCALES is cases.SCALES
    out, cache = tmp_path / "out", tmp_path / "cache"
    chosen = ("--inputs", "fast-crossing", "--temporal-slopes", "-1", "--offsets", "--biases", "2", "--still-s", "0.1")
    chosen = (*chosen, "--workers", "1", "--out", str(out), "--references", str(cache))
    assert call_script("sensitivity.py", monkeypatch, *chosen) == 0
    assert "5 of 5 runs" in capsys.readouterr().out and "distributed" in sys.modules
    first = summary(out)
    errors = [line["mse"] for line in first["settings"]]
    assert min(errors) > 0 and len(set(errors)) > 1 and all(line["ratio"] > 0 for line in first["settings"])
    assert {path.name for path in (out / "figures").iterdir()} == FIGURES
    place = Resources(out / "runs", cache)
    planned = runs(options(*chosen))
    kept = [finished(run.case.key(source_of_results()), place) for run in planned]
    assert all(found is not None for found in kept)
    assert call_script("sensitivity.py", monkeypatch, *chosen) == 0
    assert summary(out)["settings"] == first["settings"]
