"""Clocks: the only source of time in the pipeline.

Simulated time advances by what the cost model says a cycle takes; wall time by what it took. Either is a function from
the work a cycle did to seconds, so the pipeline does not know which it has.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping

CycleSeconds = Callable[[Mapping[str, int], float], float]
"""``(counters, wall_s) -> seconds``: what one cycle or frame costs on the chosen clock."""


def fixed_clock(seconds: float) -> CycleSeconds:
    """Every cycle takes the same simulated time."""
    return lambda counters, wall_s: seconds


def checked(clock: CycleSeconds, counters: Mapping[str, int], wall_s: float) -> float:
    """What the clock says; it must be finite and positive, or time would stop or run backwards.

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
        time_s: at its start, seconds.
        cycle_s: its length, seconds.

    Raises:
        ValueError: float64 holds no such time between the two: the run would never end.
    """
    end_s = time_s + cycle_s
    if not end_s > time_s:
        raise ValueError(f"clock: expected cycles that move time on from {time_s:g} s, got {cycle_s:g} s")
    return end_s


class Timed:
    """A context that adds its duration to an entry of a table, also where it ends with an error."""

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
        """A context whose duration counts for a stage."""
        return Timed(self.seconds, stage)

    def divide(self, seconds: float, shares: Mapping[str, float]) -> None:
        """Divides a span among the stages that share it, in proportion to ``shares``; these need not add up to one."""
        whole = sum(shares.values()) or 1.0
        for stage, share in shares.items():
            self.seconds[stage] = self.seconds.get(stage, 0.0) + seconds * share / whole

    @property
    def total(self) -> float:
        return sum(self.seconds.values())
