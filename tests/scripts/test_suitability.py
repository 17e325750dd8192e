"""The study from the command line: bad input, and what a killed one leaves (slow)."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from tests.scripts.commands import ROOT, assert_refused, call_script, nothing_in

SMALL = ("--inputs", "fly-by", "--rows", "0", "6", "--repetitions", "2", "--jod-repetitions", "0")


@pytest.mark.parametrize(
    ("arguments", "parts"),
    [
        (("--inputs", "nowhere"), ("inputs", "nowhere")),
        (("--rows", "16"), ("rows", "0 to 15")),
        (("--scale", "huge"), ("--scale", "huge")),
        (("--repetitions", "0"), ("repetitions", "between 1 and 1000")),
        (("--ledger", "wall"), ("ledger", "wall")),
        (("--workers", "-1"), ("workers", "-1")),
        (("--display.rate-hz", "75"), ("rate_hz", "60 or 120")),
        (("--framed-rate-hz", "0"), ("framed_rate_hz", "between 0.01 and 1000")),
    ],
)
def test_bad_input_ends_with_one_line(
    arguments: tuple[str, ...],
    parts: tuple[str, ...],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture,
) -> None:
    out = ("--out", str(tmp_path / "out"), "--cache", str(tmp_path / "cache"))
    assert_refused(call_script("suitability.py", monkeypatch, *arguments, *out), capsys, parts)
    assert nothing_in(tmp_path / "out")


def test_a_scheduler_that_does_not_answer(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture
) -> None:
    monkeypatch.setattr("analysis.farm._WAIT_S", 1)
    arguments = (*SMALL, "--scheduler", "tcp://127.0.0.1:9", "--out", str(tmp_path), "--cache", str(tmp_path / "cache"))
    assert call_script("suitability.py", monkeypatch, *arguments) == 2
    error = capsys.readouterr().err
    assert "error: scheduler: nothing answers at 'tcp://127.0.0.1:9'" in error and "Traceback" not in error


def tables(folder: Path) -> dict[str, bytes]:
    return {file.name: file.read_bytes() for file in sorted((folder / "tables").iterdir())}


@pytest.mark.slow
def test_a_study_killed_twice_gives_the_tables_of_an_unbroken_one(tmp_path: Path) -> None:
    """Killed hard, children and all survivors included, each time when some more results are on disk."""
    cache = ("--cache", str(tmp_path / "cache"))

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
