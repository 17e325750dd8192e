"""What the player of a page is given: places in the plot, texts and pictures of every step."""

from __future__ import annotations

import math
import re
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from analysis.page.player import Curve, Player, Step, data, markup, source

TIMES_S = np.arange(5) / 10.0
PNG, WEBP = b"\x89PNG and more", b"RIFF....WEBP and more"


def player(*series: list[float], steps: int = 5, times_s: np.ndarray = TIMES_S, **more) -> Player:
    curves = [Curve(f"curve {number}", f"#00000{number}", values) for number, values in enumerate(series)]
    return Player(times_s, [Step(number, {"a": PNG, "b": None}) for number in range(steps)], curves, **more)


def labelled(text: str, pattern: str, place: str) -> list[tuple[float, float]]:
    """Number and place, along one axis, of labels in the plot."""
    found = re.findall(rf"<text x='([\d.]+)' y='([\d.]+)' {pattern}>([^<]+)</text>", text)
    return [(float(label.removesuffix(" s")), float(x if place == "x" else y)) for x, y, label in found]


def values_axis(text: str) -> list[tuple[float, float]]:
    return labelled(text, r"text-anchor='end' dy='.35em'", "y")


def test_source_names_the_kind() -> None:
    assert source(PNG).startswith("data:image/png;base64,") and source(WEBP).startswith("data:image/webp;base64,")


def test_steps_carry_the_values_of_their_time() -> None:
    first, second = [1e-3, 2e-3, 3e-3, 4e-3, 5e-3], [0.1, 0.0, math.inf, 0.2, 0.3]
    made = replace(
        player(first, second, readings={"more": list("vwxyz")}), steps=[Step(k, {"a": WEBP}) for k in (0, 1, 2, 4)]
    )
    steps = data(made)["steps"]
    assert [step["time"] for step in steps] == ["0.000 s", "0.100 s", "0.200 s", "0.400 s"]
    assert [step["values"] for step in steps] == [
        ["1.00e-03", "1.00e-01", "v"],
        ["2.00e-03", "0.00e+00", "w"],
        ["3.00e-03", "inf", "x"],
        ["5.00e-03", "3.00e-01", "z"],
    ]
    assert [step["y"][1] is None for step in steps] == [False, True, True, False]
    assert all(step["pictures"] == [source(WEBP)] for step in steps)


def test_a_picture_that_is_not_there_is_null_and_marked() -> None:
    made = player([1.0] * 5)
    assert data(made)["labels"] == ["a", "b"] and data(made)["steps"][3]["pictures"] == [source(PNG), None]
    made = replace(made, steps=[made.steps[0], Step(1, {})])
    assert data(made)["steps"][1]["pictures"] == [None, None]
    assert markup(made).count("class='frame lost'") == markup(made).count("<img") == 1


@given(st.lists(st.floats(1e-12, 1e12), min_size=5, max_size=5))
def test_curves_agree_with_the_labels_of_their_axis(values: list[float]) -> None:
    """Where two values are labelled, every point lies on the logarithmic scale through them."""
    made = player(values)
    text, ys = markup(made), [step["y"][0] for step in data(made)["steps"]]
    assert all(8.0 <= y <= 200.0 for y in ys)
    labels = values_axis(text)
    path = re.search(r"<path [^>]* d='M([^']+)'", text)
    assert path is not None
    assert [float(point.split()[1]) for point in path[1].split("L")] == pytest.approx(ys, abs=0.06)
    if len(labels) < 2:
        return
    (low, low_y), (high, high_y) = labels[0], labels[-1]
    for value, y in zip(values, ys, strict=True):
        share = math.log(value / low) / math.log(high / low)
        assert y == pytest.approx(low_y + share * (high_y - low_y), abs=0.1 + 0.1 * abs(share))


@pytest.mark.parametrize("span_s", [0.05, 0.5, 1.0, 2.0, 7.0, 60.0])
@pytest.mark.parametrize("start_s", [0.0, -0.3, 12.25])
def test_times_agree_with_the_labels_of_their_axis(start_s: float, span_s: float) -> None:
    times_s = start_s + np.arange(5) / 4 * span_s
    made = player([1.0] * 5, times_s=times_s)
    labels = labelled(markup(made), r"text-anchor='middle' dy='1em'", "x")
    xs = [step["x"] for step in data(made)["steps"]]
    assert 4 <= len(labels) <= 11 and np.all(np.diff(xs) > 0)
    numbers, places = np.array(labels).T
    slope, offset = np.polyfit(numbers, places, 1)
    assert xs == pytest.approx((offset + slope * times_s).tolist(), abs=0.3 + 1e-3 * slope * abs(start_s))


def test_what_cannot_be_drawn_leaves_a_gap() -> None:
    path = re.search(r"<path [^>]* d='([^']*)'", markup(player([1.0, 0.0, 2.0, 3.0, math.nan])))
    assert path is not None and re.sub(r"[\d. ]", "", path[1]) == "MML"
    assert "d=''" in markup(player([0.0] * 5)), "nothing at all"


def test_lines_mark_the_times_within_the_span() -> None:
    text = markup(player([1.0] * 5, marks_s=[-0.1, 0.0, 0.2, 0.41]))
    xs = [float(x) for x in re.findall(r"class='mark' x1='([\d.]+)'", text)]
    assert xs == pytest.approx([step["x"] for step in data(player())["steps"]][:3:2], abs=0.06)


def test_one_time_is_enough() -> None:
    made = player([0.5], steps=1, times_s=np.array([3.0]))
    assert data(made)["steps"][0]["values"] == ["5.00e-01"] and "max='0'" in markup(made)


def test_what_does_not_fit_is_refused() -> None:
    with pytest.raises(ValueError, match="at least one step"):
        player(steps=0)
    with pytest.raises(ValueError, match=r"curve 0: expected 5 values, got 2"):
        player([1.0, 2.0])
    with pytest.raises(ValueError, match=r"more: expected 5 values, got 1"):
        player(readings={"more": ["x"]})
