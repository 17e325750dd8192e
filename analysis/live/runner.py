"""A policy at work on the wall clock: the one loop of policies, in a thread of its own, as its turns come."""

from __future__ import annotations

import dataclasses
import math
import threading
import time
from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import torch
from torch import Tensor

from analysis.live.turns import Over, Turns
from analysis.metrics.quality import Shown
from tsar.policy import Policy, run
from tsar.types import FrameletBatch, Hits, SampleBatch, Trace

PART_SAMPLES = 1 << 14
"""Samples of a batch after which others may go on."""
_PROBE_S = 1e-3  # what a run takes a cycle for before its first has ended


class SessionTime:
    """Seconds that the live view has gone on, without those in which it stood. Changes in place."""

    def __init__(self, now: Callable[[], float] = time.perf_counter) -> None:
        """Takes a clock, seconds. Time stands at first."""
        self._now, self._gone_s, self._since = now, 0.0, math.nan

    @property
    def stands(self) -> bool:
        return math.isnan(self._since)

    def now(self) -> float:
        """Seconds so far."""
        return self._gone_s + (0.0 if self.stands else self._now() - self._since)

    def stop(self) -> None:
        """It stands from now on."""
        self._gone_s, self._since = self.now(), math.nan

    def go(self) -> None:
        """It goes on."""
        self._since = self._now() if self.stands else self._since


@dataclass(frozen=True)
class DisplayState:
    """What stands on a display.

    Attributes:
        number: of the picture, counting those of its run.
        shown: the record of its cycle, where the policy makes any, and its image.
    """

    number: int
    shown: Shown


class _Clock:
    """Makes the time of a run that of the live view: a cycle ends when the next can begin."""

    def __init__(self, start_s: float, next_s: Callable[[], float]) -> None:
        self._time_s, self._next_s, self._begun = start_s, next_s, False

    def __call__(self, counters: Mapping[str, int], wall_s: float) -> float:
        if not self._begun:
            self._begun = True
            return _PROBE_S
        cycle_s = max(self._next_s() - self._time_s, 1e-6)
        self._time_s += cycle_s  # as the loop adds it up
        return cycle_s


class Runner:
    """A run of a policy. Changes in place.

    Attributes:
        name: of the policy.
        cycles: how many have ended.
        busy_s: seconds that these cycles have worked, others' turns left out.
        error: why it has ended by itself, in one line; empty while it goes on.
    """

    def __init__(
        self,
        name: str,
        make: Callable[[], tuple[Policy[Any], Trace]],
        turns: Turns,
        session: SessionTime,
        refresh: Callable[[], None],
        latency_cycles: int = 0,
    ) -> None:
        """Takes what it needs, and begins.

        Args:
            name: of the policy.
            make: makes it, and its renderer, which others use too.
            turns: who works when.
            session: the time of the live view.
            refresh: brings what renderers see up to now.
            latency_cycles: from sampling to display; 0 for the policy's own.
        """
        self.name, self._make, self._turns, self._session = name, make, turns, session
        self._refresh, self._latency = refresh, latency_cycles
        self.cycles, self.busy_s, self.error = 0, 0.0, ""
        self._before_s = 0.0
        self._lock, self._ready = threading.Lock(), deque[DisplayState]()
        self._who = turns.join()
        self._thread = threading.Thread(target=self._work, name=f"live {name}", daemon=True)
        self._thread.start()

    @property
    def worked_s(self) -> float:
        """Seconds that it has worked so far, also on the cycle that has not ended."""
        return self._turns.worked(self._who) - self._before_s

    def at(self, time_s: float) -> DisplayState | None:
        """What stands on its display; None before the first picture."""
        with self._lock:
            self._drop(time_s)
            first = self._ready[0] if self._ready else None
            return first if first is not None and first.shown[1].display_time_s <= time_s else None

    def end(self, wait: bool = False) -> None:
        """Ends it, at the end of the part of a batch that is traced now."""
        self._turns.end(self._who)
        if wait:
            self._thread.join()

    def _work(self) -> None:
        try:
            self._turns.take(self._who)
            policy, trace = self._make()
            start_s = self._session.now() + policy.warmup_cycles * _PROBE_S
            first_s = start_s + -policy.warmup_cycles * _PROBE_S
            latency = self._latency or policy.latency_cycles
            self._refresh()
            for shown in run(policy, self._in_parts(trace), _Clock(first_s, self._next_s), start_s, math.inf):
                self._put(shown, latency)
        except Over:
            pass
        except Exception as error:  # a policy may be anybody's: its side says why it stopped, the other goes on
            self.error = " ".join(f"{error}".split())[:300] or type(error).__name__
        finally:
            self._turns.leave(self._who)

    def _next_s(self) -> float:
        """When the next cycle begins."""
        if self.cycles == 0:
            self._turns.forgive(self._who)
            self._before_s = self._turns.worked(self._who)
        self._turns.offer(self._who)
        self._refresh()
        return self._session.now()

    def _put(self, shown: Shown, latency: int) -> None:
        record, display = shown
        spent = display.spent
        assert spent is not None
        display = dataclasses.replace(display, display_time_s=display.sample_time_s + latency * spent.cost_s)
        with self._lock:
            self.cycles += 1
            self.busy_s = self.worked_s
            self._ready.append(DisplayState(self.cycles, (record, display)))
            self._drop(self._session.now())

    def _drop(self, time_s: float) -> None:
        """Lets go of what was shown before."""
        while len(self._ready) > 1 and self._ready[1].shown[1].display_time_s <= time_s:
            self._ready.popleft()

    def _in_parts(self, trace: Trace) -> Trace:
        def traced(batch: FrameletBatch) -> SampleBatch:
            return in_parts(trace, batch, PART_SAMPLES, lambda: self._turns.offer(self._who))

        return traced


def in_parts(trace: Trace, batch: FrameletBatch, samples: int, between: Callable[[], None]) -> SampleBatch:
    """The answer to a batch that is traced part by part: the same bits.

    Args:
        trace: the renderer.
        batch: what is asked for.
        samples: of a part, at least one framelet.
        between: called after each part but the last.
    """
    count, each = batch.position.shape[:2]
    step = max(1, samples // max(each, 1))
    if count <= step:
        return trace(batch)
    found: list[SampleBatch] = []
    for first in range(0, count, step):
        if found:
            between()
        found.append(trace(_part(batch, slice(first, first + step))))
    counters = {name: sum(one.counters.get(name, 0) for one in found) for name in found[0].counters}
    return SampleBatch(torch.cat([one.color for one in found]), counters, _together([one.hits for one in found]))


def _part(batch: FrameletBatch, rows: slice) -> FrameletBatch:
    def of(values: Any) -> Any:
        return values[rows] if isinstance(values, Tensor) else values

    names = ("level", "index", "position", "time_s", "footprint")
    return dataclasses.replace(batch, **{name: of(getattr(batch, name)) for name in names})


def _together(hits: list[Hits | None]) -> Hits | None:
    known = [one for one in hits if one is not None]
    if not known:
        return None
    return Hits(*(torch.cat([getattr(one, name) for one in known]) for name in ("instance", "point", "occluder")))
