"""The engine against streams whose errors are known: image ``i`` has ``i`` white pixels before a black one."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from analysis.metrics.causes import Truths
from analysis.metrics.quality import DisplayedImages, Shown
from analysis.study.displays import DisplayRecord, Measuring, watch
from tests.analysis.builders import good_record
from tsar.types import SampleMap, ShownImage

SIDE = 4


def image(white: int) -> torch.Tensor:
    pixels = torch.zeros(SIDE * SIDE, 3)
    pixels[:white] = 1.0
    return pixels.reshape(SIDE, SIDE, 3)


def stream(display_s: Sequence[float], first: int = 0, latency_s: float = 0.2) -> list[Shown]:
    return [(None, ShownImage(t, t - latency_s, image(first + i))) for i, t in enumerate(display_s)]


def recorded(display_s: Sequence[float]) -> list[Shown]:
    return [(good_record(i), display) for i, (_, display) in enumerate(stream(display_s))]


def look(
    times_s: Sequence[float], runs: Mapping[str, Iterable[Shown]], truth: Sequence[torch.Tensor] = (), **more
) -> dict[str, DisplayRecord]:
    truths = Truths(lambda number: truth[number] if truth else image(0), 0.0, 10.0, len(times_s))
    viewers = more.pop("viewers", ())
    return watch(runs, truths, np.array(times_s, np.float64), Measuring(**more), viewers)


def white(seen: DisplayRecord) -> list[int]:
    """Number of white pixels of each image from its error."""
    return [round(e * SIDE * SIDE) for e in seen.column("mse")]


def test_errors_are_of_what_stands_on_the_display() -> None:
    """Not of what has been sampled by then: the sample times lie 0.2 s earlier."""
    runs = {"a": recorded([-0.1, 0.2, 0.5]), "b": stream([-0.3, 0.3], 5), "c": stream([0.0, 0.1], 9)}
    found = look([0.0, 0.1, 0.2, 0.3, 0.4, 0.5], runs)
    assert list(found) == ["a", "b", "c"]
    assert white(found["a"]) == [0, 0, 1, 1, 1, 2]
    assert white(found["b"]) == [5, 5, 5, 6, 6, 6]
    assert white(found["c"]) == [9, 10, 10, 10, 10, 10]
    assert found["a"].column("mse") == pytest.approx([0, 0, 1 / 16, 1 / 16, 1 / 16, 2 / 16], abs=1e-7)
    assert found["a"].column("log_mse")[-1] == pytest.approx(2 / 16 * math.log(2) ** 2)
    assert found["a"].column("time_s").tolist() == [0.0, 0.1, 0.2, 0.3, 0.4, 0.5]


def test_every_time_has_its_own_reference() -> None:
    runs = {"a": [(good_record(), ShownImage(0.0, 0.0, image(3)))], "b": stream([0.0])}
    found = look([0.0, 1.0, 2.0], runs, [image(i) for i in (3, 5, 1)])
    assert white(found["a"]) == [0, 2, 2] and white(found["b"]) == [3, 5, 1]


times = st.lists(st.integers(1, 40), min_size=1, max_size=12, unique=True).map(sorted)


@settings(max_examples=15)
@given(times, times)
def test_holding_agrees_with_a_search(shown: list[int], also: list[int]) -> None:
    ask = [0.5 * k for k in range(40)]
    found = look(ask, {"a": recorded([0, *shown]), "b": stream([-1, *also])})
    assert white(found["a"]) == [sum(s <= t for s in shown) for t in ask]
    assert white(found["b"]) == [sum(s <= t for s in also) for t in ask]
    assert found["b"].refresh_s == [-1, *(s for s in also if s <= ask[-1])]
    assert found["b"].images == len(found["b"].refresh_s)


def test_viewers_see_all_displays() -> None:
    views: list[DisplayedImages] = []
    records = recorded([0.0, 0.1])
    look([0.0, 0.1], {"a": records, "b": stream([0.0, 0.1], 7), "c": stream([0.0], 3)}, viewers=[views.append])
    assert [view.number for view in views] == [0, 1]
    for number, view in enumerate(views):
        assert view.time_s == [0.0, 0.1][number] and torch.equal(view.reference, image(0))
        assert torch.equal(view.shown["b"][1].image, image(7 + number)) and list(view.shown) == ["a", "b", "c"]
        assert view.shown["a"] is records[number]
        assert view.mse["c"] == pytest.approx(3 / 16)


def test_nothing_shown_at_the_start_is_an_error() -> None:
    with pytest.raises(ValueError, match="warmup_cycles"):
        look([0.0], {"a": recorded([0.0]), "b": stream([0.01])})


def test_nonfinite_values_count_once_an_image_however_long_it_is_shown() -> None:
    bad = image(2)
    bad[3, 3] = torch.tensor([math.nan, math.inf, 0.0])
    shown = [(None, ShownImage(0.0, 0.0, bad)), (None, ShownImage(0.9, 0.9, image(2)))]
    found = look((np.arange(10) / 10).tolist(), {"a": recorded([0.0]), "b": shown})
    assert {name: seen.nonfinite for name, seen in found.items()} == {"a": 0, "b": 2}
    assert white(found["b"]) == [2] * 10


def test_metrics_are_taken_every_stride() -> None:
    found = look([0.1 * k for k in range(5)], {"a": stream([0.0], 4)}, metrics=("constant",), stride=2)["a"]
    assert np.isfinite(found.column("constant")).tolist() == [True, False, True, False, True]
    assert found.rows[0]["constant"] == pytest.approx(0.25)


@pytest.fixture(autouse=True)
def constant(monkeypatch: pytest.MonkeyPatch) -> None:
    """A metric of one's own."""
    from analysis.metrics import METRICS, Metric

    monkeypatch.setitem(METRICS._entries, "constant", Metric("lower", image=lambda a, b: float((a - b).abs().mean())))


def test_images_of_a_span_are_kept_encoded() -> None:
    found = look([0.1 * k for k in range(5)], {"a": stream([0.0], 4)}, kept=(1, 3))["a"]
    shown, reference = found.frames
    assert len(shown) == len(reference) == 2 and shown[0].dtype == np.uint8
    assert shown[0].reshape(-1, 3)[:5, 0].tolist() == [255, 255, 255, 255, 0] and not reference[0].any()


def test_ages_are_of_the_image_on_the_display() -> None:
    maps = [SampleMap(torch.full((2, 2), t, dtype=torch.float64), torch.zeros(2, 2, dtype=torch.int64)) for t in (3, 4)]
    shown = [(good_record(i), ShownImage(i * 0.2, 0.0, image(i), maps[i])) for i in range(2)]
    views: list[DisplayedImages] = []
    look([0.1, 0.3], {"a": shown, "b": stream([0.0])}, viewers=[views.append])
    assert [view.shown["a"][1].sample_map is maps[i] for i, view in enumerate(views)] == [True, True]


def test_all_streams_are_read_side_by_side() -> None:
    """No run is played to its end before the other begins: only two images of each are held."""
    taken: list[str] = []

    def noted(name: str, shown: list) -> Iterator:
        for item in shown:
            taken.append(name)
            yield item

    shown = [0.1 * i for i in range(12)]
    look(shown, {"a": noted("a", recorded(shown)), "b": noted("b", stream(shown))})
    lead = np.cumsum([1 if name == "a" else -1 for name in taken])
    assert len(taken) == 24 and np.abs(lead).max() <= 2
