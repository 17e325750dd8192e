"""The same command twice into one folder: the second ends and names the first; a killed one does not block the
folder."""

from __future__ import annotations

import time
from pathlib import Path

import pytest

from tests.scripts.commands import one_line, run_script, started_script

SMALL = ("--seconds", "0.2", "--resolution-px", "64", "--batch-size", "16", "--reference-rate-hz", "20")
COMMANDS = {
    "render.py": ("plain", "--width-px", "256", "--height-px", "256", "--samples-per-axis", "4", "--frames", "200"),
    "run.py": ("fly-by", *SMALL, "--reference-samples-per-axis", "1", "--no-film", "--references", "cache"),
    "inputs.py": ("fly-by", *SMALL, "--repetitions", "1"),
    "suitability.py": (
        *("--inputs", "fly-by", "--rows", "0", "--repetitions", "1", "--jod-repetitions", "0", "--workers", "1"),
        *("--references", "cache", "--policies"),
    ),
}
SLOW = [pytest.param(name, marks=pytest.mark.slow) for name in COMMANDS if name != "render.py"]


@pytest.mark.parametrize("script", ["render.py", *SLOW])
def test_the_second_is_told_who_is_there(script: str, tmp_path: Path) -> None:
    arguments = (*COMMANDS[script], "--out", "out")
    with started_script(script, tmp_path, *arguments) as first:
        deadline = time.monotonic() + 60.0
        while not (tmp_path / "out" / ".owner").exists() and time.monotonic() < deadline:
            time.sleep(0.02)
        second = run_script(script, tmp_path, *arguments)
        assert first.poll() is None, "the first is still at work"
        first.kill()
        first.communicate()
    assert second.returncode == 2 and one_line(second.stderr), second.stderr
    assert f"is in use by process {first.pid} on " in second.stderr
    fewer = [{"200": "3"}.get(part, part) for part in arguments]
    third = run_script(script, tmp_path, *fewer)
    assert third.returncode == 0 and (tmp_path / "out" / "summary.json").exists(), third.stderr
