"""Running the command lines, in a process of their own or in this one."""

from __future__ import annotations

import importlib
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from analysis.command.cli import run_cli

ROOT = Path(__file__).resolve().parents[2]


def run_script(name: str, folder: Path, *arguments: str, timeout_s: float = 600) -> subprocess.CompletedProcess[str]:
    """Runs ``scripts/name`` from a folder, in a process of its own."""
    command = [sys.executable, str(ROOT / "scripts" / name), *arguments]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=timeout_s)


def call_script(name: str, monkeypatch: pytest.MonkeyPatch, *arguments: str) -> int:
    """Runs the script's main function in this process as from the command line; returns the exit status."""
    module = importlib.import_module(f"scripts.{name.removesuffix('.py')}")
    monkeypatch.setattr(sys, "argv", [name, *arguments])
    try:
        run_cli(module.main)
    except SystemExit as stop:
        return int(stop.code or 0)
    return 0


def one_line(error: str) -> bool:
    """Whether standard error holds one line of an error and nothing else."""
    return error.startswith("error: ") and error.endswith("\n") and error.count("\n") == 1 and "Traceback" not in error


def assert_refused(status: int, capsys: pytest.CaptureFixture, parts: tuple[str, ...]) -> None:
    """Bad input: status 2, nothing on standard output, and one line that holds every part."""
    shown = capsys.readouterr()
    assert status == 2 and shown.out == "" and one_line(shown.err), shown.err
    assert all(part in shown.err for part in parts), shown.err


def nothing_in(folder: Path) -> bool:
    """Whether no result was written; what says whose the folder and its names are stays."""
    return not folder.exists() or not any(path.name not in (".owner", "files.journal") for path in folder.iterdir())


def started_script(name: str, folder: Path, *arguments: str) -> subprocess.Popen[str]:
    """Starts ``scripts/name`` as a terminal would: in a group of its own, which Ctrl-C reaches."""

    def heed_interrupts() -> None:
        signal.signal(signal.SIGINT, signal.SIG_DFL)  # a shell in the background has its children ignore them

    command = [sys.executable, str(ROOT / "scripts" / name), *arguments]
    pipe = subprocess.PIPE
    return subprocess.Popen(
        command, cwd=folder, stdout=pipe, stderr=pipe, text=True, start_new_session=True, preexec_fn=heed_interrupts
    )
