"""Clocks: the only source of time in the pipeline.

Simulated time advances by the duration that the cost model gives a cycle, wall time by the measured duration. Either
clock is a function from the work of a cycle to seconds, so the pipeline does not depend on which is used.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping

CycleSeconds = Callable[[Mapping[str, int], float], float]
"""``(counters, wall_s) -> seconds``: duration of one cycle or frame on the chosen clock."""


def fixed_clock(seconds: float) -> CycleSeconds:
    """A clock on which every cycle takes ``seconds`` of simulated time."""
    return lambda counters, wall_s: seconds


def checked(clock: CycleSeconds, counters: Mapping[str, int], wall_s: float) -> float:
    """Duration of a cycle by a clock, seconds. It must be finite and positive, or time would stop or run backwards.

    Raises:
        ValueError: the clock returned a value that is not finite and positive.
    """
    seconds = clock(counters, wall_s)
    if not 0.0 < seconds < float("inf"):
        raise ValueError(f"clock: expected a finite, positive cycle time, got {seconds!r} s")
    return seconds


def end_of_cycle(time_s: float, cycle_s: float) -> float:
    """The time at the end of a cycle.

    Args:
        time_s: start of the cycle, seconds.
        cycle_s: length of the cycle, seconds.

    Raises:
        ValueError: the cycle is too short to change the time in float64: the run would never end.
    """
    end_s = time_s + cycle_s
    if not end_s > time_s:
        raise ValueError(f"clock: expected cycles that move time on from {time_s:g} s, got {cycle_s:g} s")
    return end_s


class Timed:
    """A context manager that adds its duration to an entry of a table, even if it ends with an exception."""

    __slots__ = ("_seconds", "_stage", "_start")

    def __init__(self, seconds: dict[str, float], stage: str) -> None:
        self._seconds, self._stage = seconds, stage

    def __enter__(self) -> None:
        self._start = time.perf_counter()

    def __exit__(self, *fault: object) -> None:
        self._seconds[self._stage] = self._seconds.get(self._stage, 0.0) + time.perf_counter() - self._start


class StageTimer:
    """Wall seconds per named stage of one cycle."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}

    def __call__(self, stage: str) -> Timed:
        """A context manager that adds its duration to a stage."""
        return Timed(self.seconds, stage)

    def divide(self, seconds: float, shares: Mapping[str, float]) -> None:
        """Divides a span among the stages that share it, in proportion to ``shares``; these need not add up to one."""
        whole = sum(shares.values()) or 1.0
        for stage, share in shares.items():
            self.seconds[stage] = self.seconds.get(stage, 0.0) + seconds * share / whole

    @property
    def total(self) -> float:
        return sum(self.seconds.values())
