"""The study from the command line: bad input, and the files of a killed one (slow)."""

from __future__ import annotations

import errno
import json
import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pandas as pd
import psutil
import pytest

from analysis.study.cases import POLICIES, Case
from analysis.suitability.tables import SIGNS
from tests.scripts.commands import ROOT, call_script, started_script

SMALL = ("--inputs", "fly-by", "--rows", "0", "6", "--repetitions", "2", "--jod-repetitions", "0")


def test_a_scheduler_that_does_not_answer(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture
) -> None:
    arguments = (
        *SMALL,
        "--scheduler",
        "tcp://127.0.0.1:9",
        "--out",
        str(tmp_path),
        "--references",
        str(tmp_path / "cache"),
    )
    assert call_script("suitability.py", monkeypatch, *arguments) == 2
    error = capsys.readouterr().err
    assert "error: scheduler: nothing answers at 'tcp://127.0.0.1:9'" in error and "Traceback" not in error


def tables(folder: Path) -> dict[str, bytes]:
    return {file.name: file.read_bytes() for file in sorted((folder / "tables").iterdir())}


@pytest.mark.slow
def test_a_study_killed_twice_gives_the_tables_of_an_unbroken_one(tmp_path: Path) -> None:
    """Killed by SIGKILL, including children and all survivors, each time when some more results are on disk."""
    cache = ("--references", str(tmp_path / "cache"))

    def command(name: str) -> list[str]:
        return [sys.executable, str(ROOT / "scripts/suitability.py"), *SMALL, "--out", str(tmp_path / name), *cache]

    subprocess.run(command("whole"), check=True, capture_output=True, timeout=600)
    for wanted in (1, 3):
        process = subprocess.Popen(command("broken"), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        runs = tmp_path / "broken" / "runs"
        deadline = time.monotonic() + 300
        while len(list(runs.glob("*.json"))) < wanted and time.monotonic() < deadline:
            time.sleep(0.05)
        process.send_signal(signal.SIGKILL)
        process.wait()
        assert not (tmp_path / "broken" / "summary.json").exists()
    subprocess.run(command("broken"), check=True, capture_output=True, timeout=600)
    assert tables(tmp_path / "whole") == tables(tmp_path / "broken")
    summary = json.loads((tmp_path / "broken" / "summary.json").read_text())
    assert summary["runs"] == summary["runs_done"] and not summary["failures"] and summary["invariants_ok"]
    assert (tmp_path / "broken" / "report.html").stat().st_size > 10_000
    assert list((tmp_path / "broken" / "figures").glob("fig_7_10.png"))


REASONS = ("OSError: No space left on device", "KilledWorker: it died three times")
MEASURED = {"reference_s": 0.0, "run_s": 1.0, "jod_s": 0.0, "threads": 1, "peak_memory_bytes": 1}
SUMMARY = {"jod": None, "cycles": 9, "cycle_s": 0.01, "nonfinite_samples": 0, "machine": MEASURED, "regions": {},
           "invariants": {"ok": True}}  # fmt: skip


def let_fail(policies: tuple[str, ...], monkeypatch: pytest.MonkeyPatch) -> None:
    """In place of running cases: those of some policies fail, for two reasons, and the others have results."""

    def run_cases(asked: list[Case], *rest: Any) -> tuple[dict[Case, str], dict[Case, str]]:
        keys = {case: case.key("source") for case in asked}
        failed = [case for case in keys if case.policy in policies]
        return keys, {case: REASONS[number % 2] for number, case in enumerate(failed)}

    def finished(key: str, place: Any) -> dict[str, Any] | None:
        return None if key.startswith(tuple(f"{one}-chase".replace(" ", "-") for one in policies)) else SUMMARY

    times = pd.DataFrame({"time_s": [0.0, 0.1], "refresh": [1, 2]} | {name: [0.5, 0.75] for name in SIGNS})
    times = times.assign(flicker=0.0, causes_known=0.0, aliasing=0.0)
    monkeypatch.setattr("analysis.study.farm.run_cases", run_cases)
    for name, made in (("finished", finished), ("times_of", lambda *_: times)):
        monkeypatch.setattr(f"analysis.study.outcomes.{name}", made)


@pytest.mark.parametrize("policies", [("thesis",), ("framed",), ("thesis", "framed"), POLICIES])
@pytest.mark.parametrize("full", [False, True])
def test_the_reasons_of_failures_are_said_whatever_is_left(
    policies: tuple[str, ...],
    full: bool,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture,
) -> None:
    let_fail(policies, monkeypatch)
    if full:

        def no_space(*_: Any, **__: Any) -> None:
            raise OSError(errno.ENOSPC, "No space left on device", "table.csv")

        monkeypatch.setattr(pd.DataFrame, "to_csv", no_space)
    arguments = (
        "--inputs",
        "chase",
        "--rows",
        "6",
        "7",
        "--repetitions",
        "2",
        "--out",
        str(tmp_path),
        "--references",
        str(tmp_path),
    )
    status = call_script("suitability.py", monkeypatch, *arguments)
    shown = capsys.readouterr()
    lines = [line for line in shown.err.splitlines() if line.startswith("failed: ")]
    assert len(lines) == 2 and lines[0].endswith("more: OSError: No space left on device"), shown.err
    assert lines[1].endswith("more: KilledWorker: it died three times") and "Traceback" not in shown.err
    assert status == (2 if full else 1)
    assert ("table.csv: cannot be written (No space left on device)" in shown.err) == full
    if not full:
        found = json.loads((tmp_path / "summary.json").read_text())
        assert found["runs_done"] + len(found["failures"]) == found["runs"] and (tmp_path / "report.html").exists()


def test_without_the_policy_thesis_nothing_is_said_of_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture
) -> None:
    let_fail(("nobody",), monkeypatch)
    named = ("--policies", "tsar", "--rivals", "framed-super", "--beside", "--solvers")
    sizes = ("--inputs", "chase", "--rows", "6", "--repetitions", "1")
    where = ("--out", str(tmp_path), "--references", str(tmp_path))
    assert call_script("suitability.py", monkeypatch, *sizes, *named, *where) == 0
    shown, page = capsys.readouterr().out, (tmp_path / "report.html").read_text()
    assert f"look at it: {(tmp_path / 'report.html').as_uri()}" in shown
    assert "Error of policies beside framed (F)" in shown and "<title>Suitability of tsar" in page
    for text in (shown, page, (tmp_path / "tables.md").read_text()):
        assert "tsar" in text and not re.search("thesis better|ours \\(thesis\\)|policy thesis|Agreement", text)


def test_an_interrupt_ends_a_study_with_one_line(tmp_path: Path) -> None:
    """As a terminal sends it: to the study and all of its workers, in the middle of a run."""
    arguments = ("--inputs", "fly-by", "--rows", "0", "--workers", "2", "--out", str(tmp_path), "--references", "cache")
    with started_script("suitability.py", tmp_path, *arguments) as study:
        deadline = time.monotonic() + 60
        while len(psutil.Process(study.pid).children(recursive=True)) < 3 and time.monotonic() < deadline:
            time.sleep(0.05)  # until both workers are there
        time.sleep(2.0)
        assert study.poll() is None and study.stderr is not None
        os.killpg(study.pid, signal.SIGINT)
        error = study.stderr.read()
    lines = [
        line for line in error.splitlines() if line.strip() and not line.startswith(("runs ", "dashboard of Dask: "))
    ]
    assert study.returncode == 130 and len(lines) == 1 and lines[0].startswith("interrupted; "), error
    assert not list((tmp_path / "runs").rglob("*.partial*")) and not (tmp_path / "summary.json").exists()
