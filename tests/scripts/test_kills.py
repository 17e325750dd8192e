"""A command that is killed at any moment continues, and ends with the results of an uninterrupted one."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

from tests.durable import KINDS
from tests.scripts.commands import ROOT

KILLS = {
    "reference": 8, "evaluate": 8, "inputs": 4, "run": 4, "render": 8, "job": 6, "stimuli": 6, "tiles": 6, "session": 6,
}  # fmt: skip
"""More than 50 in all; a study is killed in ``test_suitability.py``, its workers with it."""
FEW = {"reference": 4, "render": 2}


@pytest.mark.parametrize(
    ("name", "count"),
    [*FEW.items(), *(pytest.param(name, count, marks=pytest.mark.slow) for name, count in KILLS.items())],
)
def test_what_was_killed_ends_as_the_unbroken(
    name: str, count: int, tmp_path: Path, capsys: pytest.CaptureFixture
) -> None:
    command = [sys.executable, "-m", "tests.killed", name, str(tmp_path), str(count), "0"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=900)
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout.splitlines()[-1])
    logs = "".join(file.read_text() for file in tmp_path.glob("*.log"))
    assert set(found["statuses"]) == {0} and "Traceback" not in logs, logs
    assert found["kills"] == count, "every kill came before the end"
    kind = KINDS[name]
    expected = kind.result(tmp_path / "whole")
    assert expected
    for folder in sorted(path for path in tmp_path.iterdir() if path.is_dir() and path.name != "whole"):
        result = kind.result(folder)
        differing = [one for one in expected if result.get(one) != expected[one]]
        assert result.keys() == expected.keys() and not differing, f"{folder}: differing: {differing}"
    with capsys.disabled():
        print(f"\n{name}: {found['kills']} kills at one of {found['operations']} operations on files, 0 lost")
