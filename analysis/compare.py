"""One pass over the reference times in which both renderers run side by side; two images of each are held at a time."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field

import numpy as np
import torch
from numpy.typing import NDArray

from analysis.pictures import webp_bytes
from analysis.player import Step
from analysis.quality import ErrorTrace, Hold, pixel_errors
from analysis.video import PHOTOGRAPHS, ComparisonFilm, FrameSink, Scales, View, panels
from tsar.types import Display, FrameletBatch, SampleBatch, StepRecord, Trace

STEPS_MAX = 60
"""Positions of the slider in the report at most."""
STEP_PX = 256
"""Width of the pictures in the report."""


@dataclass
class Meter:
    """A renderer that counts: work by kind, calls and seconds. Changes in place."""

    trace: Trace
    counters: Counter[str] = field(default_factory=Counter)
    calls: int = 0
    wall_s: float = 0.0

    def __call__(self, batch: FrameletBatch) -> SampleBatch:
        began = time.perf_counter()
        samples = self.trace(batch)
        self.wall_s += time.perf_counter() - began
        self.calls += 1
        self.counters.update(samples.counters)
        return samples


@dataclass
class Totals:
    """Sums over the cycles of the adaptive run that lie within the span; warm-up is left out. Changes in place."""

    cycles: int = 0
    warmup_cycles: int = 0
    simulated_s: float = 0.0
    nonfinite: int = 0
    nonfinite_fields: int = 0
    age_spread_s: float = 0.0
    stage_s: Counter[str] = field(default_factory=Counter)
    counters: Counter[str] = field(default_factory=Counter)

    def add(self, record: StepRecord) -> None:
        if record.cycle < 0:
            self.warmup_cycles += 1
            return
        self.cycles += 1
        self.simulated_s += record.cost_s
        self.nonfinite += record.nonfinite
        self.nonfinite_fields += record.nonfinite_fields
        self.age_spread_s += record.age_spread_s
        self.stage_s.update(record.stage_s)
        self.counters.update(record.counters)


@dataclass(frozen=True)
class Streams:
    """What is compared.

    Attributes:
        adaptive: records and images of the adaptive pipeline.
        framed: images of framed renderers by name; the first is the one shown and compared to.
    """

    adaptive: Iterable[tuple[StepRecord, Display]]
    framed: Mapping[str, Iterable[Display]]


@dataclass(frozen=True)
class Comparison:
    """Errors at the reference times and what else the pass saw.

    Attributes:
        times_s: reference times.
        adaptive: errors of the adaptive run.
        framed: errors of the framed runs.
        refresh_s: display times of the first framed run.
        steps: pictures of evenly spaced times, for the report.
        framed_nonfinite: non-finite values in framed images, each image counted once.
    """

    times_s: NDArray[np.float64]
    adaptive: ErrorTrace
    framed: dict[str, ErrorTrace]
    refresh_s: list[float]
    steps: list[Step]
    framed_nonfinite: dict[str, int]


def compare(
    times_s: NDArray[np.float64],
    reference: NDArray[np.float16],
    streams: Streams,
    scales: Scales,
    film: ComparisonFilm | None,
    sink: FrameSink | None,
    on_view: Callable[[int, View], None] = lambda number, view: None,
    film_stride: int = 1,
    steps_max: int = STEPS_MAX,
) -> Comparison:
    """Holds what each display shows at every reference time and measures it.

    Args:
        times_s: reference times.
        reference: image of each, linear RGB.
        streams: the runs.
        scales: bounds of the colour scales.
        film, sink: composer of frames and where they go; None for no film.
        on_view: called with the number and the view of every reference time.
        film_stride: a film frame every so many reference times.
        steps_max: how many times the report shows at most; every k-th, with the least k that keeps to it.
    """
    nonfinite = dict.fromkeys(streams.framed, 0)
    adaptive = Hold(streams.adaptive)
    framed = {name: Hold(_counting(name, run, nonfinite)) for name, run in streams.framed.items()}
    main = next(iter(framed))
    errors, framed_errors = ErrorTrace(), {name: ErrorTrace() for name in framed}
    step_stride = -(-len(times_s) // steps_max)
    steps: list[Step] = []
    for number, time_s in enumerate(times_s.tolist()):
        truth = torch.from_numpy(reference[number].astype(np.float32))
        shown = {name: hold.at(time_s)[1].image for name, hold in framed.items()}
        record, display = adaptive.at(time_s)
        errors.add(pixel_errors(display.image, truth))
        for name, image in shown.items():
            framed_errors[name].add(pixel_errors(image, truth))
        newest_s = display.samples.newest_s if display.samples else None
        view = View(time_s, truth, shown[main], display.image, record.tiling, record.densities, newest_s)
        if film is not None and sink is not None and number % film_stride == 0:
            sink.add(film.frame(view, times_s[: number + 1].tolist(), errors.mse, framed_errors[main].mse))
        if number % step_stride == 0:
            steps.append(_step(number, view, scales))
        on_view(number, view)
    return Comparison(times_s, errors, framed_errors, framed[main].refresh_s, steps, nonfinite)


def _step(number: int, view: View, scales: Scales) -> Step:
    # encoded at once: the pixels of all steps together would take as much memory as the run
    pictures = {
        label: None if pixels is None else webp_bytes(pixels, lossless=label not in PHOTOGRAPHS)
        for label, pixels in panels(view, scales, STEP_PX).items()
    }
    return Step(number, pictures)


def _counting(name: str, run: Iterable[Display], nonfinite: dict[str, int]) -> Iterator[tuple[None, Display]]:
    for display in run:
        nonfinite[name] += int((~torch.isfinite(display.image)).sum())
        yield None, display
