"""A command that is killed at any moment continues, and ends with the results of an uninterrupted one."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

from tests.scripts.commands import ROOT

KILLS = {
    "reference": 8, "evaluate": 8, "inputs": 4, "run": 4, "render": 8, "job": 6, "stimuli": 6, "tiles": 6, "session": 6,
    "suitability": 2, "ablation": 2, "trade": 2, "sensitivity": 2, "workloads": 2, "spectrum": 2,
}  # fmt: skip
"""``python -m tests.killed --kills 50`` kills more. ``test_suitability.py`` kills a study with its workers."""
FEW = {"reference": 4, "render": 2}


@pytest.mark.parametrize(
    ("name", "count"),
    [*FEW.items(), *(pytest.param(name, count, marks=pytest.mark.slow) for name, count in KILLS.items())],
)
def test_what_was_killed_ends_as_the_unbroken(
    name: str, count: int, tmp_path: Path, capsys: pytest.CaptureFixture
) -> None:
    options = ("--kinds", name, "--kills", str(count), "--out", str(tmp_path))
    command = [sys.executable, "-m", "tests.killed", *options]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=900)
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout.splitlines()[-1])
    assert found["operations"] > 0 and not found["lost"] and not found["wrong"], found
    assert found["kills"] == count, "every kill came before the end"
    with capsys.disabled():
        print(f"\n{name}: {found['kills']} kills, 0 lost")
