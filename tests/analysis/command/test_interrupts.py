"""Ctrl-C ends a command, whatever library loses it, and lets it clean up."""

from __future__ import annotations

import re
import signal
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path

import pytest

from analysis.command import interrupts
from analysis.command.cli import run_cli
from analysis.command.interrupts import heeded, settled
from analysis.command.later import command
from tests.scripts.commands import ROOT


@pytest.fixture(autouse=True)
def soon(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(interrupts, "_AGAIN_S", 0.02)


def lost() -> None:
    """A library that loses a Ctrl-C."""
    with suppress(KeyboardInterrupt):
        signal.raise_signal(signal.SIGINT)


def test_one_that_is_lost_comes_again(capsys: pytest.CaptureFixture) -> None:
    def main() -> None:
        lost()
        time.sleep(60.0)

    with pytest.raises(SystemExit) as stop:
        run_cli(main)
    assert stop.value.code == 130 and capsys.readouterr().err.count("\n") == 1
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_an_error_that_follows_a_lost_one_is_the_interrupt(capsys: pytest.CaptureFixture) -> None:
    """Like a module whose own code turns it into an ImportError."""

    def main() -> None:
        lost()
        raise ImportError("half a library")

    with pytest.raises(SystemExit) as stop:
        run_cli(main)
    assert stop.value.code == 130 and capsys.readouterr().err.startswith("interrupted")


def test_a_command_is_interrupted_while_it_loads(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture
) -> None:
    (tmp_path / "slow_to_load.py").write_text("import signal\nsignal.raise_signal(signal.SIGINT)\n")
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.raises(SystemExit) as stop:
        run_cli(command("slow_to_load"))
    assert stop.value.code == 130 and capsys.readouterr().err.count("\n") == 1


LITTER = """
import atexit, signal, sys
from analysis.command.cli import run_process

class Litter:
    def __del__(self):
        print("collected", file=sys.stderr)

def main():
    sys.litter = Litter()
    atexit.register(print, "ended")
    signal.raise_signal(signal.SIGINT)

run_process(main)
"""


def test_an_interrupted_process_collects_no_garbage() -> None:
    command = [sys.executable, "-c", LITTER]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=120)
    assert done.returncode == 130 and done.stderr.count("\n") == 1 and done.stdout == "ended\n"


def test_no_script_loads_its_command_before_it_runs() -> None:
    """All of it lies within the block that heeds Ctrl-C."""
    scripts = sorted((ROOT / "scripts").glob("*.py"))
    loads = [re.findall(r"(?m)^ *(?:from|import) (\S+)", script.read_text()) for script in scripts]
    assert len(scripts) > 15 and all(
        names == ["sys", "pathlib", "analysis.command.cli", "analysis.command.later"] for names in loads
    )


def test_what_is_cleaned_up_is_not_disturbed() -> None:
    done = []

    def main() -> None:
        try:
            signal.raise_signal(signal.SIGINT)
        finally:
            time.sleep(0.1)
            done.append("with")
            with suppress(ValueError):
                raise ValueError
            time.sleep(0.1)
            done.append("all")

    with pytest.raises(SystemExit) as stop:
        run_cli(main)
    assert stop.value.code == 130 and done == ["with", "all"]


def test_one_that_was_heeded_does_not_come_again() -> None:
    with heeded():
        lost()
        settled()
        time.sleep(0.1)
    with heeded():
        pass
    time.sleep(0.05)


def test_one_that_comes_while_workers_start_is_heard_afterwards() -> None:
    """Also if another thread takes the signal, so that Python would raise KeyboardInterrupt in this one."""
    program = """
import os, signal, threading, time
from analysis.command.cli import run_cli
from analysis.command.later import command
from analysis.command.cluster import _interrupts_blocked
taker = threading.Thread(target=time.sleep, args=(60,), daemon=True)
taker.start()
def main():
    with _interrupts_blocked():
        try:
            os.kill(os.getpid(), signal.SIGINT)
            time.sleep(0.3)
        except KeyboardInterrupt:
            print("lost within")
    print("went on")
run_cli(main)
"""
    root = Path(__file__).resolve().parents[3]
    heed = lambda: signal.signal(signal.SIGINT, signal.SIG_DFL)  # noqa: E731
    done = subprocess.run(
        [sys.executable, "-c", program], cwd=root, capture_output=True, text=True, timeout=60, preexec_fn=heed
    )
    assert (done.returncode, done.stdout) == (130, "") and done.stderr.startswith("interrupted; "), done


ELSEWHERE = """
import os, signal, sys
import psutil  # on Linux it imports what it replaces
for name in ("SIGALRM", "SIGKILL", "ITIMER_REAL", "setitimer", "getitimer", "pthread_sigmask"):
    delattr(signal, name)
sys.modules["resource"] = None
from analysis.command.cli import run_cli
from analysis.command.cluster import _interrupts_blocked
from tsar.memory import core_count, free_memory_bytes

def main():
    with _interrupts_blocked():
        print(core_count() > 0, free_memory_bytes() > 0)
    signal.raise_signal(signal.SIGINT)

run_cli(main)
"""


def test_a_system_without_timers_and_masks_of_signals_is_interrupted_all_the_same() -> None:
    """Windows has none of these names; the rest of it is not here to be tried."""
    done = subprocess.run([sys.executable, "-c", ELSEWHERE], cwd=ROOT, capture_output=True, text=True)
    assert (done.returncode, done.stdout, done.stderr.count("\n")) == (130, "True True\n", 1), done.stderr
    assert done.stderr.startswith("interrupted; ")
