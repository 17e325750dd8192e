"""The comparison film: sizes, places, labels and curves of a frame, and a film on disk that reads back."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import av
import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image, ImageDraw

from analysis.metrics.quality import DisplayedImages
from analysis.page.pictures import RATE_MAP, ByteMap, PagePixels, enlarge
from analysis.page.video import OWN, PAPER, RIVALS, ComparisonFilm, draw_errors, inks, maps, photographs, to_pixels
from renderer.film.files import Mp4Writer
from tests.analysis.builders import SCALES, grey, view
from tsar.types import MapShown, SampleMap

SIDE = 96
MAPS = ["tiling by refresh rate", "spatial density", "temporal density", "age of samples"]
LABELS = ["reference", "own", "framed", *MAPS]
FRAMED, ERRORS = RIVALS[0], {"own": [0.1], "framed": [0.2]}


class Film(ComparisonFilm):
    """Of two runs, drawn from what they show."""

    def of(self, view: DisplayedImages, times_s: list[float], errors: dict) -> PagePixels:
        return self.frame(view.time_s, panels(view, self.width_px // 4), times_s, errors)


def film(side: int = SIDE, span: tuple[float, float] = (0.0, 1.0)) -> Film:
    scales = {label: one.scale for label, one in maps(view(), "own", SCALES).items()}
    return Film(side, span, ["own", "framed"], "own", LABELS, 3, scales=scales)


def panels(view: DisplayedImages, side: int = SIDE) -> dict:
    return photographs(view, side) | drawn(maps(view, "own", SCALES), side)


def drawn(found: dict[str, ByteMap], side: int = SIDE) -> dict[str, PagePixels]:
    return {label: enlarge(one.pixels(), side) for label, one in found.items()}


def strip_of(made: ComparisonFilm, side: int = SIDE) -> int:
    """Height of a label and of a scale: both rows hold maps."""
    return (made.height_px - 2 * side) // 4


def of_age(view: DisplayedImages, newest_s: torch.Tensor | None) -> DisplayedImages:
    """The same with other ages of the samples of the first run."""
    record, display = view.shown["own"]
    ages = None if newest_s is None else SampleMap(newest_s, torch.zeros(2, 2, dtype=torch.int64))
    return replace(view, shown={**view.shown, "own": (record, replace(display, sample_map=ages))})


def panel(frame: np.ndarray, slot: int, strip: int) -> np.ndarray:
    """Pixels below the label of one of two times four slots."""
    top, left = slot // 4 * (SIDE + 2 * strip) + strip, slot % 4 * SIDE
    return frame[top : top + SIDE, left : left + SIDE]


def has(pixels: np.ndarray, ink: tuple[int, int, int]) -> np.ndarray:
    return (pixels == np.array(ink)).all(-1)


@settings(max_examples=12)
@given(st.integers(1, 300))
def test_a_frame_has_the_size_it_says_and_that_is_even(side: int) -> None:
    made = film(side)
    assert made.width_px % 2 == 0 and made.height_px % 2 == 0
    assert made.width_px // 4 == max(96, side // 2 * 2)
    frame = made.of(view(), [0.0], ERRORS)
    assert frame.shape == (made.height_px, made.width_px, 3) and frame.dtype == np.uint8


def test_every_picture_has_its_place_and_its_label() -> None:
    """Reference and displays first, then tiling, fields and ages; the last slot holds the errors."""
    made = film()
    strip = strip_of(made)
    frame, shown = made.of(view(), [0.0], ERRORS), panels(view())
    assert list(shown) == LABELS
    for slot, pixels in enumerate(shown.values()):
        assert pixels is not None and np.array_equal(panel(frame, slot, strip), pixels), LABELS[slot]
    for slot, value in enumerate((0, 255, 188)):
        assert (panel(frame, slot, strip) == value).all(), "sRGB of linear 0, 0.5 and 1"
    labels = [frame[s // 4 * (SIDE + 2 * strip) :, s % 4 * SIDE :][:strip, :SIDE] for s in range(8)]
    assert all((~has(label, PAPER)).sum() > 20 for label in labels)
    assert len({label.tobytes() for label in labels}) == 8


def test_ages_are_of_the_time_shown() -> None:
    """The same samples are older later."""
    sampled = of_age(view(), torch.zeros(2, 2, dtype=torch.float64))
    shown = [maps(replace(sampled, time_s=t), "own", SCALES)["age of samples"] for t in (0.01, 0.2, 0.5, 1.0)]
    low, high = shown[0].scale.bounds
    found = [low * (high / low) ** ((int(one.places[0, 0]) - 1) / 254) for one in shown]
    assert found == pytest.approx([10.0, 200.0, 500.0, 1000.0], rel=0.03)


def test_scales_stand_below_the_maps() -> None:
    """Maps have a strip below them, and pictures none."""
    made = film()
    frame, strip = made.of(view(), [0.0], ERRORS), strip_of(made)
    below = frame[-strip:]
    assert all((~has(below[:, s * SIDE : (s + 1) * SIDE], PAPER)).sum() > 40 for s in range(3))
    assert has(below[:, 3 * SIDE :], PAPER).all()


def test_unknown_ages_leave_their_place_empty() -> None:
    lacking, made = of_age(view(), None), film()
    assert "age of samples" not in panels(lacking)
    known, unknown = (made.of(shown, [0.0], ERRORS) for shown in (view(), lacking))
    strip = strip_of(made)
    assert (panel(unknown, 6, strip) == PAPER).all() and not (panel(known, 6, strip) == PAPER).all()
    label = slice(SIDE + 2 * strip, SIDE + 3 * strip), slice(2 * SIDE, 3 * SIDE)
    assert not np.array_equal(known[label], unknown[label]), "the label says so"


@pytest.mark.parametrize("side", [96, 256, 512])
def test_labels_do_not_run_into_the_next_panel(side: int) -> None:
    made = film(side)
    frame, width, strip = made.of(view(), [0.0], ERRORS), made.width_px // 4, strip_of(made, side)
    for slot in range(8):
        top, left = slot // 4 * (side + 2 * strip), slot % 4 * width
        label = frame[top : top + strip, left : left + width]
        assert not has(label, PAPER).all() and has(label[:, -2:], PAPER).all(), slot


def test_the_time_is_shown() -> None:
    early, late = (film().of(view(time), [0.0], ERRORS) for time in (0.1, 0.9))
    changed = np.not_equal(early, late).any(-1).nonzero()
    assert len(changed[0]) and changed[1].min() >= 3 * SIDE and changed[0].min() >= film().height_px // 2


def test_curves_lie_where_their_values_are() -> None:
    """The greater error above the lesser one, both up to the present and no further."""
    side, text = 256, 170  # pixels: of a panel, and how far its legend reaches
    made = film(side)
    top, times = made.height_px - side - strip_of(made, side), np.linspace(0.0, 0.75, 30).tolist()
    box = made.of(view(0.75), times, {"own": [1e-3] * 30, "framed": [1e-1] * 30})[top : top + side, 3 * side :]
    drawn = {ink: has(box, ink)[:, text:] for ink in (OWN, FRAMED)}
    rows = {ink: np.median(mask.nonzero()[0]) for ink, mask in drawn.items()}
    assert rows[FRAMED] < rows[OWN] - side / 4
    ends = [mask.any(0).nonzero()[0].max() + text for mask in drawn.values()]
    size = side // 24
    expected = 4 * size + 0.75 * (side - 5 * size)
    assert all(abs(end - expected) <= 2 for end in ends)


@pytest.mark.parametrize("errors", [[], [0.0], [0.0, 0.0], [1e-9, 2.0], [0.0, 1e-3]])
def test_any_errors_can_be_drawn(errors: list[float]) -> None:
    canvas = Image.new("RGB", (200, 100), PAPER)
    times = [0.1 * i for i in range(len(errors))]
    curves = {"a": (errors, OWN), "b": (errors[::-1], FRAMED)}
    draw_errors(ImageDraw.Draw(canvas), (0, 0, 200, 100), (0.0, 1.0), times, curves)
    assert has(np.asarray(canvas), FRAMED).any() == bool(errors)


def test_to_pixels_is_srgb_and_black_where_not_finite() -> None:
    image = torch.tensor([[[0.0, 1.0, 0.5], [float("nan"), float("inf"), -float("inf")], [-1.0, 7.0, 0.002]]])
    assert to_pixels(image).tolist() == [[[0, 255, 188], [0, 0, 0], [0, 255, 7]]]
    assert torch.isnan(image).sum() == 1, "the image is left as it is"


def test_a_film_reads_back(tmp_path: Path) -> None:
    """Frames, size, rate and colours; the grey of the framed panel grows from frame to frame."""
    made, path = film(), tmp_path / "films" / "comparison.mp4"
    strip, values = strip_of(made), [0.02, 0.1, 0.2, 0.4, 0.6, 0.8, 0.9]
    with Mp4Writer(path, 30.0, made.width_px, made.height_px) as writer:
        for number, value in enumerate(values):
            writer.add(made.of(view(number / 30, framed=value), [0.0], ERRORS))
        assert not path.exists()
    assert writer.frames == len(values) and [p.name for p in path.parent.iterdir()] == ["comparison.mp4"]
    with av.open(str(path)) as container:
        stream = container.streams.video[0]
        assert stream.average_rate == 30
        frames = [frame.to_ndarray(format="rgb24") for frame in container.decode(video=0)]
    assert [frame.shape for frame in frames] == [(made.height_px, made.width_px, 3)] * len(values)
    density = np.asarray(panels(view())["temporal density"], int)
    for value, frame in zip(values, frames, strict=True):
        expected = to_pixels(grey(value))[0, 0].astype(int)
        assert np.abs(panel(frame, 2, strip)[20:-20, 20:-20].astype(int) - expected).max() <= 6
        assert np.abs(panel(frame, 5, strip)[10:50, 10:-10].astype(int) - density[10:50, 10:-10]).max() <= 12


@pytest.mark.parametrize("error", [ValueError, KeyboardInterrupt])
def test_an_exception_leaves_no_film(tmp_path: Path, error: type[BaseException]) -> None:
    made = film()
    with pytest.raises(error), Mp4Writer(tmp_path / "a.mp4", 30.0, made.width_px, made.height_px) as writer:
        writer.add(made.of(view(), [0.0], ERRORS))
        raise error
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(("count", "columns", "rows"), [(1, 4, 2), (2, 4, 2), (3, 4, 3), (4, 5, 2), (9, 6, 3)])
def test_no_run_is_left_out(count: int, columns: int, rows: int) -> None:
    """Photographs stand side by side, four to six a row, and the errors take what the last row leaves."""
    one, names = view(), [f"run {number}" for number in range(count)]
    many = replace(one, shown={name: one.shown["framed"] for name in names}, mse=dict.fromkeys(names, 0.1))
    many = replace(many, shown={**many.shown, "run 0": one.shown["own"]})
    shown = photographs(many, SIDE) | drawn(maps(many, "run 0", SCALES))
    made = ComparisonFilm(SIDE, (0.0, 1.0), names, "run 0", list(shown), 1 + count)
    frame = made.frame(0.0, shown, [0.0], {name: [0.1] for name in names})
    strip = made.height_px // rows - SIDE
    assert (made.width_px, made.height_px) == (columns * SIDE, rows * (SIDE + strip))
    assert 1 <= rows * columns - len(shown) <= columns
    for slot in range(rows * columns):
        top, left = slot // columns * (SIDE + strip) + strip, slot % columns * SIDE
        assert not has(frame[top : top + SIDE, left : left + SIDE], PAPER).all(), slot
    assert len(set(inks(names, "run 0")[:7])) == min(count, 7)


def test_maps_of_a_rival_bear_its_name_and_a_policy_shows_what_it_knows() -> None:
    """Any run that records is shown; the named maps and the ages are those of the run's own policy."""
    one = view()
    (record, display), (_, framed) = one.shown["own"], one.shown["framed"]
    known = MapShown(torch.tensor([[1.0, 2.0], [4.0, 8.0]]), (1.0, 8.0), "volts")
    own = replace(framed, maps={"tension": known}, sample_map=display.sample_map)
    both = replace(one, shown={"own": (None, own), "thesis": (record, replace(display, maps={"heat": known}))})
    found = maps(both, "own", SCALES)
    fields = ["thesis: tiling by refresh rate", "thesis: spatial density", "thesis: temporal density"]
    assert list(found) == ["tension", "age of samples", *fields]
    assert found["tension"].places.tolist() == [[1, 86], [170, 255]], "thirds of the way from 1 to 8"
    assert found["tension"].scale.palette == RATE_MAP and found["tension"].scale.unit == "volts"
    assert np.array_equal(found[fields[1]].places, maps(one, "own", SCALES)["spatial density"].places)
