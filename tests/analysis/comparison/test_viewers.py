"""What is made of a comparison as it goes by: steps of the page, and frames of the film."""

from __future__ import annotations

import io
from dataclasses import replace

import numpy as np
import pytest
from PIL import Image

from analysis.comparison.viewers import STEP_PX, STEPS_MAX, Filming, Steps
from analysis.page.video import ComparisonFilm, maps, photographs
from tests.analysis.builders import SCALES, Sink, view


@pytest.mark.parametrize(("stride", "expected"), [(1, 7), (2, 4), (3, 3)])
def test_the_film_has_a_frame_every_stride(stride: int, expected: int) -> None:
    sink, film = Sink(), ComparisonFilm(96, SCALES, (0.0, 0.7), ["own", "framed"], "own")
    filming = Filming(film, sink, stride)
    for number in range(7):
        filming(view(number / 10, framed=0.1 * number, number=number))
    assert len(sink.frames) == expected and sink.frames[0].shape == (film.height_px, film.width_px, 3)
    assert not np.array_equal(sink.frames[0], sink.frames[-1])


@pytest.mark.parametrize(("count", "steps"), [(1, 1), (2, 2), (60, 60), (61, 31), (119, 60), (121, 41)])
def test_steps_are_evenly_spaced_over_the_span(count: int, steps: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("analysis.comparison.viewers.STEP_PX", 96)
    found = Steps("own", SCALES, count)
    for number in range(count):
        found(view(number / 10, number=number))
    at = [step.number for step in found.made]
    assert len(at) == steps <= STEPS_MAX and at == list(range(0, count, at[1] if steps > 1 else 1))


def decoded(picture: bytes | None) -> np.ndarray:
    assert picture is not None
    return np.asarray(Image.open(io.BytesIO(picture)).convert("RGB")).astype(int)


def test_steps_hold_what_is_shown_then() -> None:
    """Maps to the last bit, images nearly; what a run does not say is missing."""
    found = Steps("own", SCALES, 5)
    views = [view(number / 10, reference=0.1 * number, framed=0.2 * number, number=number) for number in range(5)]
    silent = {**views[4].shown, "own": (None, replace(views[4].shown["own"][1], sample_map=None))}
    views[4] = replace(views[4], shown=silent)
    for one in views:
        found(one)
    for step, one in zip(found.made, views, strict=True):
        plain, drawn = photographs(one, STEP_PX), maps(one, "own", SCALES, STEP_PX)
        assert list(step.pictures) == [*plain, *drawn]
        for label, pixels in plain.items():
            assert np.abs(decoded(step.pictures[label]) - pixels).mean() <= 1.0, label
        for label, pixels in drawn.items():
            if pixels is None:
                assert step.pictures[label] is None and step.number == 4
            else:
                assert np.array_equal(decoded(step.pictures[label]), pixels), label
