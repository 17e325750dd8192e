"""Launches in parallel: every item is run exactly once."""

from __future__ import annotations

import subprocess
import sys
import threading
import time

import numpy as np
import pytest
import warp as wp

from renderer.compute import device as devices
from renderer.compute.launching import Address, Command
from renderer.compute.team import PATIENCE_US, Team

wp.set_module_options({"enable_backward": False})


@wp.func_native("return __atomic_fetch_add((int*)counter, 1, __ATOMIC_RELAXED);")
def take(counter: Address) -> wp.int32: ...


@wp.kernel
def count_up(counter: Address, done: Address, last: wp.int32):
    """Marks every number below ``last`` that no other launch has taken."""
    marks = wp.array(ptr=done, shape=(last,), dtype=wp.int32)
    number = take(counter)
    while number < last:
        marks[number] = marks[number] + 1
        number = take(counter)


class Job:
    """Numbers to be marked, each exactly once, by launches that share them."""

    def __init__(self, size: int) -> None:
        devices.load_kernels(sys.modules[__name__], "cpu")
        self.counter, self.done = np.zeros(1, np.int32), np.zeros(size, np.int32)
        self.command = Command(count_up, self.counter.ctypes.data, self.done.ctypes.data)

    def run(self, team: Team, threads: int) -> bool:
        """Whether every number was marked once."""
        self.counter[:], self.done[:] = 0, 0
        self.command.set(len(self.done))
        team.run([self.command] * threads)
        return bool((self.done == 1).all()) and self.counter[0] >= len(self.done) + threads


@pytest.mark.parametrize("threads", [1, 2, 3, 5])
@pytest.mark.parametrize("size", [1, 1000, 1_000_000])
def test_everything_is_done_once(threads: int, size: int) -> None:
    team, job = Team(), Job(size)
    assert all(job.run(team, threads) for _ in range(50))
    team.rest()


def test_helpers_wake_up_after_a_pause() -> None:
    team, job = Team(), Job(100_000)
    for _ in range(5):
        assert job.run(team, 2)
        time.sleep(5e-6 * PATIENCE_US)
    team.rest()
    assert job.run(team, 2)
    team.rest()


def test_callers_who_come_at_once_are_all_served() -> None:
    team, results = Team(), []
    jobs = [Job(50_000) for _ in range(4)]

    def caller(job: Job) -> None:
        results.extend(job.run(team, 2) for _ in range(100))

    callers = [threading.Thread(target=caller, args=(job,)) for job in jobs]
    for one in callers:
        one.start()
    for one in callers:
        one.join()
    assert len(results) == 400 and all(results)
    team.rest()


def test_an_interpreter_may_end_while_helpers_wait() -> None:
    code = (
        "import torch; from renderer.trace import Renderer; from scenes import catalog;"
        "from tsar.types import FrameletBatch; tile = torch.zeros(8, dtype=torch.int64);"
        "Renderer(catalog.load('fly-by'), 'cpu', 2).trace(FrameletBatch(tile, tile, torch.rand(8, 256, 2), 0.0))"
    )
    for _ in range(3):
        ended = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=120, check=False)
        assert ended.returncode == 0, ended.stderr
