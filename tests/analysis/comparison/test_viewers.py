"""Steps of the page and frames of the film, made while a comparison runs."""

from __future__ import annotations

import io
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from analysis.comparison.rivalry import Panels
from analysis.comparison.viewers import STEPS_MAX, Filming, Steps
from analysis.page.pictures import enlarge
from analysis.page.video import REFERENCE, images, maps, photographs, to_pixels
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
        mapped = {label: replace(m, scale=filming.map_scales[label]) for label, m in maps(one, "own", SCALES).items()}
        shown = photographs(one, 96) | {label: enlarge(m.pixels(), 96) for label, m in mapped.items()}
        so_far = {name: values[:until] for name, values in errors.items()}
        times = [k / 10 for k in range(until)]
        assert np.array_equal(frame, film.frame(one.time_s, panels.arranged(shown), times, so_far))


def test_the_best_framed_rival_is_seen_and_the_others_are_not(tmp_path: Path) -> None:
    """By the median, whatever the mean is; every run that is not framed has a panel, and the run's own is last."""
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
def test_steps_are_evenly_spaced_over_the_span(count: int, steps: int) -> None:
    found = Steps("own", SCALES, count)
    for number in range(count):
        found(view(number / 10, number=number))
    at = [round(10 * step.time_s) for step in found.made]
    assert len(at) == steps <= STEPS_MAX and at == list(range(0, count, at[1] if steps > 1 else 1))


def decoded(picture: bytes | None) -> np.ndarray:
    assert picture is not None
    return np.asarray(Image.open(io.BytesIO(picture)).convert("RGB")).astype(int)


@pytest.mark.parametrize("exact", [False, True])
def test_steps_hold_what_is_shown_then(exact: bool) -> None:
    """Maps to the last bit, pictures pixel for pixel, nearly or to the last bit; what a run does not say is missing."""
    found = Steps("own", SCALES, 5, exact=exact)
    views = [view(number / 10, reference=0.1 * number, framed=0.2 * number, number=number) for number in range(5)]
    silent = {**views[4].shown, "own": (None, replace(views[4].shown["own"][1], sample_map=None))}
    views[4] = replace(views[4], shown=silent)
    for one in views:
        found(one)
    assert not maps(views[4], "own", SCALES) and maps(views[3], "own", SCALES)
    for step, one in zip(found.made, views, strict=True):
        plain, drawn = images(one), maps(one, "own", SCALES)
        assert list(step.pictures) == [*plain, *drawn] and step.time_s == one.time_s
        for label, image in plain.items():
            assert np.abs(decoded(step.pictures[label]) - to_pixels(image)).max() <= (0 if exact else 3), label
        for label, kept in drawn.items():
            assert np.array_equal(decoded(step.pictures[label])[..., 0], kept.places), label
    panels = found.panels(["own", "framed"])
    assert [(one.label, one.truth) for one in panels[:3]] == [
        (REFERENCE, ""),
        ("own", REFERENCE),
        ("framed", REFERENCE),
    ]
    ages = next(one.scale for one in panels if one.label == "age of samples")
    assert ages is not None and ages.shown[0] <= 125.0 <= ages.shown[1] <= 200.0, "all samples are 125 ms old"


def test_what_stands_on_a_display_is_encoded_once(monkeypatch: pytest.MonkeyPatch) -> None:
    made = []
    monkeypatch.setattr("analysis.comparison.viewers.picture_bytes", lambda pixels, exact: made.append(1) or b"x")
    found, one = Steps("own", SCALES, 3), view()
    for number in range(3):
        found(replace(one, number=number))
    assert len(made) == len(images(one)) + 3 * len(maps(one, "own", SCALES))
