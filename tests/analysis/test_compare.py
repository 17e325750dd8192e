"""The comparison pass against streams whose errors are known: image ``i`` has ``i`` white pixels before a black one."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from analysis.compare import MOMENTS, Comparison, Meter, Streams, Totals, compare
from analysis.video import ComparisonFilm
from tests.analysis.builders import SCALES, good_record
from tsar.types import Display, FrameletBatch, SampleBatch, StepRecord

SIDE = 4
DARK = np.zeros((40, SIDE, SIDE, 3), np.float16)


def image(white: int) -> torch.Tensor:
    pixels = torch.zeros(SIDE * SIDE, 3)
    pixels[:white] = 1.0
    return pixels.reshape(SIDE, SIDE, 3)


def framed(display_s: Sequence[float], first: int = 0, latency_s: float = 0.2) -> list[Display]:
    return [Display(t, t - latency_s, image(first + i)) for i, t in enumerate(display_s)]


def adaptive(display_s: Sequence[float]) -> list[tuple[StepRecord, Display]]:
    return [(good_record(i), display) for i, display in enumerate(framed(display_s))]


def run(times_s: Sequence[float], streams: Streams, reference: np.ndarray = DARK, **options) -> Comparison:
    return compare(np.array(times_s), reference, streams, SCALES, options.pop("film", None), **options)


def white(errors: Sequence[float]) -> list[int]:
    """Number of white pixels of each image from its error."""
    return [round(e * SIDE * SIDE) for e in errors]


def test_errors_are_of_what_stands_on_the_display() -> None:
    """Not of what has been sampled by then: the sample times lie 0.2 s earlier."""
    streams = Streams(adaptive([-0.1, 0.2, 0.5]), {"framed": framed([-0.3, 0.3], 5), "fine": framed([0.0, 0.1], 9)})
    found = run([0.0, 0.1, 0.2, 0.3, 0.4, 0.5], streams, sink=None)
    assert white(found.adaptive.mse) == [0, 0, 1, 1, 1, 2]
    assert white(found.framed["framed"].mse) == [5, 5, 5, 6, 6, 6]
    assert white(found.framed["fine"].mse) == [9, 10, 10, 10, 10, 10]
    assert found.adaptive.mse == pytest.approx([0, 0, 1 / 16, 1 / 16, 1 / 16, 2 / 16], abs=1e-7)
    assert found.adaptive.log_mse[-1] == pytest.approx(2 / 16 * math.log(2) ** 2)
    assert list(found.framed) == ["framed", "fine"] and found.times_s.tolist() == [0.0, 0.1, 0.2, 0.3, 0.4, 0.5]


def test_every_time_has_its_own_reference() -> None:
    reference = np.stack([image(i).numpy().astype(np.float16) for i in (3, 5, 1)])
    streams = Streams([(good_record(), Display(0.0, 0.0, image(3)))], {"f": framed([0.0])})
    found = run([0.0, 1.0, 2.0], streams, reference, sink=None)
    assert white(found.adaptive.mse) == [0, 2, 2] and white(found.framed["f"].mse) == [3, 5, 1]


times = st.lists(st.integers(1, 40), min_size=1, max_size=12, unique=True).map(sorted)


@settings(max_examples=15)
@given(times, times)
def test_holding_agrees_with_a_search(shown: list[int], also: list[int]) -> None:
    ask = [0.5 * k for k in range(40)]
    found = run(ask, Streams(adaptive([0, *shown]), {"framed": framed([-1, *also])}), sink=None)
    assert white(found.adaptive.mse) == [sum(s <= t for s in shown) for t in ask]
    assert white(found.framed["framed"].mse) == [sum(s <= t for s in also) for t in ask]
    assert found.refresh_s == [-1, *(s for s in also if s <= ask[-1])]


def test_the_first_framed_run_is_the_one_shown() -> None:
    views, records = [], adaptive([0.0, 0.1])
    streams = Streams(records, {"second name": framed([0.0, 0.1], 7), "first name": framed([0.0], 3)})
    found = run([0.0, 0.1], streams, sink=None, on_view=lambda number, view: views.append((number, view)))
    assert [number for number, _ in views] == [0, 1] and found.refresh_s == [0.0, 0.1]
    for number, view in views:
        assert view.time_s == [0.0, 0.1][number] and torch.equal(view.reference, image(0))
        assert torch.equal(view.framed, image(7 + number)) and torch.equal(view.adaptive, image(number))
        assert view.tiling is records[number][0].tiling and view.densities is records[number][0].densities


def test_nothing_shown_at_the_start_is_an_error() -> None:
    with pytest.raises(ValueError, match="warm-up"):
        run([0.0], Streams(adaptive([0.0]), {"framed": framed([0.01])}), sink=None)


def test_nonfinite_values_count_once_an_image_however_long_it_is_shown() -> None:
    bad = image(2)
    bad[3, 3] = torch.tensor([math.nan, math.inf, 0.0])
    shown = [Display(0.0, 0.0, bad), Display(0.9, 0.9, image(2))]
    found = run(np.arange(10) / 10, Streams(adaptive([0.0]), {"framed": shown, "fine": framed([0.0])}), sink=None)
    assert found.framed_nonfinite == {"framed": 2, "fine": 0}
    assert white(found.framed["framed"].mse) == [2] * 10


class Sink:
    """Keeps frames."""

    def __init__(self) -> None:
        self.frames: list[np.ndarray] = []

    def add(self, pixels: np.ndarray) -> None:
        self.frames.append(pixels)


@pytest.mark.parametrize(("stride", "expected"), [(1, 7), (2, 4), (3, 3)])
def test_the_film_has_a_frame_every_stride(stride: int, expected: int) -> None:
    sink, film = Sink(), ComparisonFilm(96, SCALES, (0.0, 0.7))
    streams = Streams(adaptive([0.0]), {"framed": framed([0.0, 0.3])})
    run(np.arange(7) / 10, streams, film=film, sink=sink, film_stride=stride)
    assert len(sink.frames) == expected and sink.frames[0].shape == (film.height_px, film.width_px, 3)
    assert not np.array_equal(sink.frames[0], sink.frames[-1])


@pytest.mark.parametrize("count", [1, 2, 6, 40])
def test_moments_are_spread_within_the_span(count: int) -> None:
    ask = np.arange(count) / 10
    found = run(ask, Streams(adaptive([0.0]), {"framed": framed([0.0])}), sink=None)
    at = [moment.time_s for moment in found.moments]
    assert at == sorted(set(at)) and set(at) <= set(ask) and 1 <= len(at) <= MOMENTS
    if count == 40:
        assert np.abs(np.array(at) - ask[-1] * np.arange(1, 6) / 6).max() <= 0.051
    assert {"reference", "framed", "TSAR"} <= set(found.moments[0].pictures)


def test_both_streams_are_read_side_by_side() -> None:
    """No run is played to its end before the other begins: only two images of each are held."""
    taken: list[str] = []

    def noted(name: str, stream: list) -> Iterator:
        for item in stream:
            taken.append(name)
            yield item

    shown = [0.1 * i for i in range(12)]
    run(shown, Streams(noted("a", adaptive(shown)), {"f": noted("f", framed(shown))}), sink=None)
    lead = np.cumsum([1 if name == "a" else -1 for name in taken])
    assert len(taken) == 24 and np.abs(lead).max() <= 2


def test_meter_counts_and_changes_nothing() -> None:
    answers = iter((SampleBatch(torch.ones(1, 2, 3), {"primary_rays": 2}), SampleBatch(torch.zeros(1, 2, 3), {"b": 5})))
    asked: list[FrameletBatch] = []

    def trace(batch: FrameletBatch) -> SampleBatch:
        asked.append(batch)
        return next(answers)

    zero = torch.zeros(1, dtype=torch.int64)
    batch = FrameletBatch(zero, zero, torch.zeros(1, 2, 2), torch.zeros(1, 2))
    meter = Meter(trace)
    assert meter(batch).counters == {"primary_rays": 2} and meter(batch).counters == {"b": 5}
    assert asked[0] is batch and meter.calls == 2 and meter.counters == {"primary_rays": 2, "b": 5}
    assert meter.wall_s > 0.0


def test_totals_leave_out_warm_up() -> None:
    totals = Totals()
    for cycle in (-2, -1, 0, 1, 2):
        totals.add(good_record(1, cycle=cycle, nonfinite=abs(cycle), cost_s=0.02))
    assert (totals.cycles, totals.warmup_cycles, totals.nonfinite) == (3, 2, 3)
    assert totals.simulated_s == pytest.approx(0.06) and totals.age_spread_s == pytest.approx(0.375)
    assert totals.stage_s == {"tracing": 1.5, "error": 0.75}
    assert totals.counters == {"primary_rays": 3072, "shadow_rays": 30}
