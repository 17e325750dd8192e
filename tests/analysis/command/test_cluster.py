"""What a local cluster leaves behind when its workers are killed."""

from __future__ import annotations

import subprocess
import sys

from tests.scripts.commands import ROOT

LOST = """
import os
from multiprocessing import resource_tracker
from analysis.command.cluster import _interrupts_blocked
with _interrupts_blocked():
    resource_tracker.register("/nobody", "semaphore")
os._exit(0)
"""


def test_semaphores_of_killed_workers_are_not_reported() -> None:
    """The process that tracks them ends after this one, so its words would follow the one line of an interrupt."""
    done = subprocess.run([sys.executable, "-c", LOST], cwd=ROOT, capture_output=True, text=True, timeout=120)
    assert (done.returncode, done.stderr) == (0, "")
