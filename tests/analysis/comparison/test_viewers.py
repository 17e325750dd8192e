"""What is made of a comparison as it goes by: steps of the page, and frames of the film."""

from __future__ import annotations

import io
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from analysis.comparison.rivalry import Panels
from analysis.comparison.viewers import STEP_PX, STEPS_MAX, Filming, Steps
from analysis.page.video import maps, photographs
from tests.analysis.builders import SCALES, Sink, view


@pytest.mark.parametrize(("stride", "expected"), [(1, 7), (2, 4), (3, 3)])
def test_the_film_has_a_frame_every_stride(stride: int, expected: int, tmp_path: Path) -> None:
    sink, filming = Sink(), Filming("own", SCALES, 96, tmp_path, stride)
    views = [view(number / 10, framed=0.1 * number, number=number) for number in range(7)]
    for one in views:
        filming(one)
    panels = Panels.of({"own": np.full(7, 0.1), "framed": np.full(7, 0.2)}, "own")
    film = filming.film(panels, (0.0, 0.7))
    filming.write(panels, film, sink)
    assert len(sink.frames) == filming.frames == expected and list(tmp_path.iterdir()) == []
    errors = {"own": [0.1] * 7, "framed": [0.2] * 7}
    for number, frame in enumerate(sink.frames):
        one, until = views[number * stride], number * stride + 1
        shown = photographs(one, 96) | maps(one, "own", SCALES, 96)
        so_far = {name: values[:until] for name, values in errors.items()}
        times = [k / 10 for k in range(until)]
        assert np.array_equal(frame, film.frame(one.time_s, panels.arranged(shown), times, so_far))


def test_the_best_framed_rival_is_seen_and_the_others_are_not(tmp_path: Path) -> None:
    """By the median, whatever the mean is; all that is not framed has a panel, and the run's own is last."""
    mse = {"own": [1.0] * 3, "framed": [2.0] * 3, "afr": [9.0] * 3, "framed-half": [1.0, 1.0, 99.0], "framing": [8.0]}
    panels = Panels.of({name: np.array(values) for name, values in mse.items()}, "own")
    assert panels.runs == ("framed-half", "afr", "framing", "own") and panels.hidden == ("framed",)
    pictures = {name: name for name in ("reference", "own", "framed", "afr", "framed-half", "framing", "age")}
    assert list(panels.arranged(pictures).items()) == [
        ("reference", "reference"),
        ("framed-half (best framed rival)", "framed-half"),
        ("afr", "afr"),
        ("framing", "framing"),
        ("own", "own"),
        ("age", "age"),
    ]


def test_one_framed_rival_has_its_plain_name_and_none_is_needed() -> None:
    errors = {name: np.ones(2) for name in ("framed", "thesis")}
    assert list(Panels.of(errors, "thesis").arranged(dict.fromkeys(errors, 0))) == ["framed", "thesis"]
    alone = Panels.of({"framed": np.ones(2)}, "framed")
    assert alone.runs == ("framed",) and alone.best_framed is None
    assert Panels.of(errors, "framed").runs == ("thesis", "framed")


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
    assert not maps(views[4], "own", SCALES, STEP_PX) and maps(views[3], "own", SCALES, STEP_PX)
    for step, one in zip(found.made, views, strict=True):
        plain, drawn = photographs(one, STEP_PX), maps(one, "own", SCALES, STEP_PX)
        assert list(step.pictures) == [*plain, *drawn]
        for label, pixels in plain.items():
            assert np.abs(decoded(step.pictures[label]) - pixels).mean() <= 1.0, label
        for label, pixels in drawn.items():
            assert np.array_equal(decoded(step.pictures[label]), pixels), label
