"""Groups cores, order and hits: framelet batches on two threads against one, in Morton order against row order, and
with first hits against without."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import TYPE_CHECKING

from analysis.bench.options import BenchOptions
from analysis.bench.rows import Row, rate_row
from analysis.bench.scenes import bumpy_scene, driving_scenes, in_rows, morton_batches, renderer_of
from analysis.command.timing import take_turns
from scenes.canonical import Scene
from tsar.types import FrameletBatch, Trace

if TYPE_CHECKING:
    from analysis.command.progress import Bars

_CORES_SCENE = "fly-by"
_CORES_TARGET = 1.8


def _scenes(options: BenchOptions) -> dict[str, Scene]:
    return {**driving_scenes(options), "bumpy sphere": bumpy_scene()}


def _tracing(trace: Trace, batches: list[FrameletBatch]) -> Callable[[], object]:
    return lambda: [trace(batch) for batch in batches]


def _samples(batches: list[FrameletBatch]) -> float:
    return sum(batch.times.numel() for batch in batches) / 1e6


def cores(options: BenchOptions, bars: Bars) -> Iterator[Row]:
    """Batches on two threads against one; no row where this process may use one core only."""
    from renderer.compute.device import core_count

    if core_count() < 2:
        return
    scenes = _scenes(options)
    chosen = _CORES_SCENE if _CORES_SCENE in scenes else next(iter(scenes))
    task = bars.task("cores", 2 * options.repetitions)
    for name in dict.fromkeys((chosen, "bumpy sphere")):
        scene = scenes[name]
        batches = morton_batches(options, scene.duration_s)
        renderers = {threads: renderer_of(scene, options, threads) for threads in (1, 2)}
        cases = {str(threads): _tracing(renderer.trace, batches) for threads, renderer in renderers.items()}
        seconds = take_turns(cases, options.repetitions, task, lead_in=True)
        for renderer in renderers.values():
            renderer.close()
        row = Row("cores", f"{name}, 2 threads", "M samples/s", 0.0, "1 thread")
        yield rate_row(row, _samples(batches), seconds["2"], seconds["1"], _CORES_TARGET)


def order(options: BenchOptions, bars: Bars) -> Iterator[Row]:
    """The same batches in Morton order and row by row, on all cores."""
    scenes = _scenes(options)
    task = bars.task("order", len(scenes) * options.repetitions)
    for name, scene in scenes.items():
        batches = morton_batches(options, scene.duration_s)
        renderer = renderer_of(scene, options)
        cases = {
            "Morton": _tracing(renderer.trace, batches),
            "rows": _tracing(renderer.trace, [in_rows(batch) for batch in batches]),
        }
        seconds = take_turns(cases, options.repetitions, task, lead_in=True)
        renderer.close()
        row = Row("order", f"{name}, Morton order", "M samples/s", 0.0, "row order")
        yield rate_row(row, _samples(batches), seconds["Morton"], seconds["rows"])


def hits(options: BenchOptions, bars: Bars) -> Iterator[Row]:
    """The same batches with first hits and without, in CPU seconds of one thread."""
    scenes = _scenes(options)
    task = bars.task("hits", len(scenes) * options.repetitions)
    for name, scene in scenes.items():
        batches = morton_batches(options, scene.duration_s)
        renderer = renderer_of(scene, options, 1)
        cases = {
            "with": _tracing(renderer.trace, [replace(batch, hits=True) for batch in batches]),
            "without": _tracing(renderer.trace, batches),
        }
        seconds = take_turns(cases, options.repetitions, task, clock=time.process_time)
        renderer.close()
        row = Row("hits", f"{name}, with first hits", "M samples/s", 0.0, "without")
        yield rate_row(row, _samples(batches), seconds["with"], seconds["without"])
