"""Layout of curves in a plot: positions agree with the labels of the axes, and labels of lines do not overlap."""

from __future__ import annotations

import math
import re

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from analysis.page.curves import LEFT, WIDTH, Curve, Plot, drawing
from analysis.page.figures import DASHES, INKS, spread

TIMES_S = (np.arange(5) / 10.0).tolist()
SPAN_S = (0.0, 0.4)


def plot(*series: list[float], **more) -> Plot:
    return Plot("a", "", [Curve(f"curve {n}", TIMES_S, values, n) for n, values in enumerate(series)], **more)


def points(path: str) -> list[tuple[float, float]]:
    return [(float(x), float(y)) for x, y in re.findall(r"[ML]([\d.]+) ([\d.]+)", path)]


@given(st.lists(st.floats(1e-12, 1e12), min_size=5, max_size=5))
def test_values_agree_with_the_labels_of_their_axis(values: list[float]) -> None:
    """Where two values are labelled, every point lies on the logarithmic scale through them."""
    made = drawing(plot(values), SPAN_S)
    ys = [y for _, y in points(made.lines[0].path)]
    assert len(ys) == 5 and all(made.top - 0.1 <= y <= made.bottom + 0.1 for y in ys)
    labels = [(float(one.text), one.y) for one in made.upward]
    if len(labels) < 2:
        return
    (low, low_y), (high, high_y) = labels[0], labels[-1]
    for value, y in zip(values, ys, strict=True):
        share = math.log(value / low) / math.log(high / low)
        assert y == pytest.approx(low_y + share * (high_y - low_y), abs=0.15 + 0.15 * abs(share))


@pytest.mark.parametrize("span_s", [0.05, 0.5, 1.0, 2.0, 7.0, 60.0])
@pytest.mark.parametrize("start_s", [0.0, -0.3, 12.25])
def test_times_agree_with_the_labels_of_their_axis(start_s: float, span_s: float) -> None:
    times = (start_s + np.arange(5) / 4 * span_s).tolist()
    made = drawing(Plot("a", "", [Curve("b", times, [1.0] * 5, 0)]), (times[0], times[-1]))
    xs = [x for x, _ in points(made.lines[0].path)]
    assert xs[0] == LEFT and xs[-1] == pytest.approx(made.right, abs=0.06) and 2 <= len(made.across) <= 8
    labels = [(float(one.text), one.x) for one in made.across]
    for time_s, x in labels:
        assert x == pytest.approx(np.interp(time_s, times, xs), abs=0.3)


def test_what_cannot_be_drawn_leaves_a_gap() -> None:
    path = drawing(plot([1.0, 0.0, 2.0, 3.0, math.nan]), SPAN_S).lines[0].path
    assert re.sub(r"[\d. ]", "", path) == "MML"
    linear = drawing(plot([1.0, 0.0, 2.0, 3.0, math.nan], logarithmic=False), SPAN_S).lines[0].path
    assert re.sub(r"[\d. ]", "", linear) == "MLLL"
    assert drawing(plot([0.0] * 5), SPAN_S).lines[0].path == "", "nothing at all"


def test_what_lies_outside_the_span_is_left_out() -> None:
    made = drawing(plot([1.0] * 5, marks_s=[-0.1, 0.0, 0.2, 0.41]), (0.1, 0.3))
    assert len(points(made.lines[0].path)) == 3 and made.marks == [pytest.approx((LEFT + made.right) / 2, abs=0.06)]


@given(st.lists(st.one_of(st.floats(0, 100), st.just(math.nan)), max_size=12))
def test_labels_stand_apart_in_their_order(wanted: list[float]) -> None:
    found = spread(wanted, 8.0, 0.0, 100.0)
    assert all(b - a >= 7.9 for a, b in zip(sorted(found), sorted(found)[1:], strict=False))
    assert all(-0.1 <= y <= 100.1 for y in found)
    known = [(w, y) for w, y in zip(wanted, found, strict=True) if not math.isnan(w)]
    assert all(a[1] < b[1] for a in known for b in known if a[0] < b[0])


def test_any_number_of_curves_has_a_label_each() -> None:
    made = drawing(plot(*([float(n + 1)] * 5 for n in range(23))), SPAN_S)
    ys = [line.label.y for line in made.lines]
    assert len({line.label.text for line in made.lines}) == 23 and min(np.diff(sorted(ys))) >= 18.9
    assert max(ys) <= made.bottom


def test_long_labels_take_the_room_they_need_and_no_more() -> None:
    short, long, endless = (
        drawing(Plot("a", "", [Curve(n * "m", TIMES_S, [1.0] * 5, 0)]), SPAN_S) for n in (3, 20, 90)
    )
    assert short.right > long.right > endless.right > WIDTH / 4
    assert endless.lines[0].label.text == 27 * "m" + "…"


def test_inks_can_be_told_apart_in_grey() -> None:
    """Every ink goes with dashes of its own, and none is too pale for white."""
    assert len(set(DASHES)) == len(set(INKS)) == len(INKS) == len(DASHES)
    for ink in INKS:
        red, green, blue = (int(ink[i : i + 2], 16) / 255 for i in (1, 3, 5))
        assert 0.3 * red + 0.6 * green + 0.1 * blue < 0.75


def test_what_does_not_fit_is_refused() -> None:
    with pytest.raises(ValueError, match="curve a: expected 2 values, got 1"):
        Curve("a", [0.0, 1.0], [1.0], 0)
    with pytest.raises(ValueError, match="plot t: expected at least one curve"):
        Plot("t", "", [])
