"""Parallel launches on the caller's thread and on helper threads that spin for a moment between two launches.

A cycle gives work to other threads several times within milliseconds. Waking a thread takes longer than some of that
work, so a helper spins for a while before it sleeps.
"""

from __future__ import annotations

import atexit
import threading
import time
from collections.abc import Sequence
from itertools import pairwise

import numpy as np
import torch

from renderer.compute import device as devices
from renderer.compute import team_kernels as kernels
from renderer.compute.launching import Command, address
from renderer.compute.sizes import MAIL_WORDS, Mail, State

PATIENCE_US = 1000
"""Time for which a helper spins, microseconds: longer than any pause between the launches of one cycle."""


class _Helper:
    """A thread that runs one launch at a time for the caller."""

    def __init__(self, patience_us: int) -> None:
        self._mail = np.zeros(MAIL_WORDS, np.int64)
        self._mail[Mail.STATE] = State.PARKED
        where = address("mail", self._mail, torch.int64, len(self._mail))
        self._serve = Command(kernels.serve, where, patience_us)
        self._post, self._join = Command(kernels.post, where), Command(kernels.join, where)
        self._wake = threading.Semaphore(0)
        threading.Thread(target=self._live, daemon=True, name="tsar helper").start()

    def _live(self) -> None:
        while True:
            self._wake.acquire()
            self._serve.launch()

    def start(self, command: Command) -> None:
        """Posts a launch; the command must not change until :meth:`finish`."""
        self._post(*command.entry)
        if self._mail[Mail.ANSWER]:
            self._wake.release()

    def finish(self, command: Command) -> None:
        """Waits for the launch, or runs it here if the helper has not begun."""
        self._join.launch()
        if self._mail[Mail.ANSWER]:
            command.launch()

    def rest(self) -> None:
        """Parks the thread; returns when it has left the kernel, at the latest after a second."""
        self._mail[Mail.REST] = 1
        until = time.monotonic() + 1.0
        while self._mail[Mail.STATE] != State.PARKED and time.monotonic() < until:
            time.sleep(1e-4)
        self._mail[Mail.REST] = 0


class Team:
    """Helper threads for one caller at a time; a caller that finds them busy works alone."""

    def __init__(self) -> None:
        self._busy = threading.Lock()
        self._helpers: list[_Helper] = []

    def run(self, commands: Sequence[Command]) -> None:
        """Runs all launches, the first one on the caller's thread; returns when all are done."""
        first, *others = commands
        if not others or not self._busy.acquire(blocking=False):
            for command in commands:
                command.launch()
            return
        started: list[tuple[_Helper, Command]] = []
        try:
            for number, command in enumerate(others):
                helper = self._helper(number)
                started.append((helper, command))
                helper.start(command)
            first.launch()
        finally:
            for helper, command in started:
                helper.finish(command)
            self._busy.release()

    def rest(self) -> None:
        """Parks all helpers, before the interpreter unloads kernels at exit."""
        with self._busy:
            for helper in self._helpers:
                helper.rest()

    def _helper(self, number: int) -> _Helper:
        if number == len(self._helpers):
            devices.load_kernels(kernels, "cpu")
            # With more threads than cores, spinning threads would delay working ones.
            self._helpers.append(_Helper(PATIENCE_US if number + 1 < devices.core_count() else 0))
        return self._helpers[number]


TEAM = Team()
"""The team of this process."""

atexit.register(TEAM.rest)


def shares(rows: int, threads: int) -> list[tuple[int, int]]:
    """Range of rows (end exclusive) of each thread that has any."""
    edges = [rows * number // threads for number in range(threads + 1)]
    return [(first, last) for first, last in pairwise(edges) if last > first]
