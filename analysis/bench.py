"""Samples per second of a renderer, measured in turns so that a machine's ups and downs fall on all alike."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from statistics import median, quantiles
from typing import Annotated, Any

import torch
import tyro

from tsar.config import require
from tsar.morton import deinterleave
from tsar.types import FrameletBatch, Trace


@dataclass(frozen=True)
class BenchOptions:
    """Samples per second of the ray tracer: threads, and the order of samples in a batch."""

    out: Path
    """Folder for summary.json."""
    input: Annotated[str, tyro.conf.Positional] = "fly-by"
    """Built-in scene, by name or number."""
    threads: int = 2
    """Threads that are compared with one."""
    repetitions: int = 9
    """Measurements of each case; their median counts."""
    batch_size: int = 128
    """Framelets per batch."""
    framelet_side: int = 16
    """Samples along a framelet's side, a power of two."""
    level: int = 5
    """Quad level of the tiles: the picture is cut into 4^level of them."""

    def __post_init__(self) -> None:
        require(self.threads >= 2, "threads", "at least 2", self.threads)
        require(self.repetitions >= 7, "repetitions", "at least 7", self.repetitions)
        require(0 <= self.level <= 8, "level", "between 0 and 8", self.level)
        require(1 <= self.batch_size <= 4**self.level, "batch_size", "between 1 and 4^level", self.batch_size)
        side = self.framelet_side
        require(1 <= side <= 64 and side & (side - 1) == 0, "framelet_side", "a power of two up to 64", side)


def morton_batches(options: BenchOptions, duration_s: float) -> list[FrameletBatch]:
    """Batches that cover the picture once between them, each spread over all of it as the pipeline's are.

    Args:
        options: sizes.
        duration_s: length of the animation, over which the batches are spread too.
    """
    count = -(-(4**options.level) // options.batch_size)
    side = options.framelet_side
    offset = (torch.stack(deinterleave(torch.arange(side * side)), dim=1) + 0.5) / side
    batches = []
    for number in range(count):
        index = torch.arange(number, 4**options.level, count)
        corner = torch.stack(deinterleave(index), dim=1)
        position = ((corner[:, None, :] + offset) * 0.5**options.level).to(torch.float32)
        time_s = torch.full(position.shape[:2], duration_s * (number + 0.5) / count, dtype=torch.float64)
        batches.append(FrameletBatch(torch.full_like(index, options.level), index, position, time_s))
    return batches


def in_rows(batch: FrameletBatch) -> FrameletBatch:
    """The same samples in the order of reading: row by row across all tiles of the batch."""
    flat = batch.position.reshape(-1, 2)
    order = torch.argsort(flat[:, 0], stable=True)
    order = order[torch.argsort(flat[order, 1], stable=True)]
    return replace(
        batch,
        position=flat[order].reshape(batch.position.shape),
        time_s=batch.time_s.reshape(-1)[order].reshape(batch.time_s.shape),
    )


def take_turns(
    cases: Mapping[str, Callable[[], object]], repetitions: int, on_round: Callable[[int], None] = lambda done: None
) -> dict[str, list[float]]:
    """Wall seconds of every case, ``repetitions`` times each, after one run that is not counted.

    Cases take turns, forwards and backwards, so that neither drift nor an order of precedence favours one.
    """
    for run in cases.values():
        run()
    seconds: dict[str, list[float]] = {name: [] for name in cases}
    for number in range(repetitions):
        for name in list(cases) if number % 2 == 0 else reversed(list(cases)):
            start = time.perf_counter()
            cases[name]()
            seconds[name].append(time.perf_counter() - start)
        on_round(number + 1)
    return seconds


def measure(
    options: BenchOptions,
    tracers: Mapping[int, Trace],
    duration_s: float,
    on_round: Callable[[int], None] = lambda done: None,
) -> dict[str, Any]:
    """Times tracing in Morton and in row order.

    Args:
        options: sizes and repetitions.
        tracers: a renderer for each number of threads.
        duration_s: length of the animation.
        on_round: told how many repetitions are done.

    Returns:
        Counts of samples and rays, a row per case with samples per second (median, quartiles, all values), and the
        median ratios that the cases are compared by.
    """
    morton = morton_batches(options, duration_s)
    orders = {"Morton": morton, "rows": [in_rows(batch) for batch in morton]}
    cases = {
        (threads, order): (lambda trace=trace, batches=batches: [trace(batch) for batch in batches])
        for order, batches in orders.items()
        for threads, trace in tracers.items()
    }
    seconds = take_turns(
        {f"{threads} {order}": run for (threads, order), run in cases.items()}, options.repetitions, on_round
    )
    counters: dict[str, int] = {}
    for batch in morton:
        for name, value in next(iter(tracers.values()))(batch).counters.items():
            counters[name] = counters.get(name, 0) + value
    samples = sum(batch.position.shape[0] * batch.position.shape[1] for batch in morton)
    rows = []
    for threads, order in cases:
        rates = [samples / taken for taken in seconds[f"{threads} {order}"]]
        low, _, high = quantiles(rates, n=4)
        row = {"threads": threads, "order": order, "samples_per_s": median(rates), "quartiles": (low, high)}
        rows.append({**row, "all": rates})

    def ratio(slower: str, faster: str) -> float:
        return median(a / b for a, b in zip(seconds[slower], seconds[faster], strict=True))

    one, many = min(tracers), max(tracers)
    return {
        "samples": samples,
        "counters": counters,
        "cases": rows,
        "speed_up_of_threads": {order: ratio(f"{one} {order}", f"{many} {order}") for order in orders},
        "speed_up_of_morton_order": {
            str(threads): ratio(f"{threads} rows", f"{threads} Morton") for threads in tracers
        },
    }
