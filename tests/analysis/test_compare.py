"""The comparison pass against streams whose errors are known: image ``i`` has ``i`` white pixels before a black one."""

from __future__ import annotations

import io
import math
from collections.abc import Iterator, Sequence

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image

from analysis.compare import STEP_PX, STEPS_MAX, Comparison, Meter, Streams, Totals, compare
from analysis.video import PHOTOGRAPHS, ComparisonFilm, panels
from tests.analysis.builders import SCALES, good_record
from tsar.types import Display, FrameletBatch, SampleBatch, SampleMap, StepRecord

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
    few = {"steps_max": 1, **options}
    return compare(np.array(times_s), reference, streams, SCALES, few.pop("film", None), **few)


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


@pytest.mark.parametrize(("count", "steps"), [(1, 1), (2, 2), (60, 60), (61, 31), (119, 60), (121, 41)])
def test_steps_are_evenly_spaced_over_the_span(count: int, steps: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("analysis.compare.STEP_PX", 96)
    reference = np.zeros((count, SIDE, SIDE, 3), np.float16)
    streams = Streams(adaptive([0.0]), {"framed": framed([0.0])})
    found = compare(np.arange(count) / 10, reference, streams, SCALES, None, None)
    at = [step.number for step in found.steps]
    assert len(at) == steps <= STEPS_MAX and at == list(range(0, count, at[1] if steps > 1 else 1))


def decoded(picture: bytes | None) -> np.ndarray:
    assert picture is not None
    return np.asarray(Image.open(io.BytesIO(picture)).convert("RGB")).astype(int)


def test_steps_hold_what_is_shown_then() -> None:
    """Maps to the last bit, images nearly."""
    views = []
    streams = Streams(adaptive([0.0, 0.1, 0.3]), {"framed": framed([0.0, 0.2], 5)})
    reference = np.stack([image(i).numpy().astype(np.float16) for i in range(5)])
    times_s = [0.0, 0.1, 0.2, 0.3, 0.4]
    found = run(times_s, streams, reference, sink=None, on_view=lambda _, view: views.append(view), steps_max=5)
    assert [step.number for step in found.steps] == [0, 1, 2, 3, 4]
    for step, view in zip(found.steps, views, strict=True):
        expected = panels(view, SCALES, STEP_PX)
        assert list(step.pictures) == list(expected) and expected.pop("age of samples") is None
        assert step.pictures["age of samples"] is None, "these streams do not know"
        for label, pixels in expected.items():
            error = np.abs(decoded(step.pictures[label]) - pixels)
            assert error.mean() < 1.0 if label in PHOTOGRAPHS else not error.any(), label


def test_ages_are_of_the_image_on_the_display() -> None:
    maps = [SampleMap(torch.full((2, 2), t, dtype=torch.float64), torch.zeros(2, 2, dtype=torch.int64)) for t in (3, 4)]
    shown = [(good_record(i), Display(i * 0.2, 0.0, image(i), maps[i])) for i in range(2)]
    views = []
    run([0.1, 0.3], Streams(shown, {"f": framed([0.0])}), sink=None, on_view=lambda number, view: views.append(view))
    assert [view.newest_s is maps[i].newest_s for i, view in enumerate(views)] == [True, True]


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
    batch = FrameletBatch(zero, zero, torch.zeros(1, 2, 2), 0.0)
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
