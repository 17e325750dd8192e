"""Fronts of cost and error, their knees and bands."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from analysis.metrics.front import bootstrap, interval, knee, least_error, means, on_front

WHOLE = st.integers(1, 12)
POINTS = st.lists(st.tuples(WHOLE, WHOLE), min_size=1, max_size=12)


def beaten(point: tuple[int, int], points: list[tuple[int, int]]) -> bool:
    return any(x <= point[0] and y <= point[1] and (x, y) != point for x, y in points)


def split(points: list[tuple[int, int]]) -> tuple[np.ndarray, np.ndarray]:
    found = np.array(points, np.float64)
    return found[:, 0], found[:, 1]


@given(POINTS)
def test_the_front_is_what_nothing_beats(points: list[tuple[int, int]]) -> None:
    assert on_front(*split(points)).tolist() == [not beaten(point, points) for point in points]


def test_points_that_are_not_finite_are_not_on_the_front() -> None:
    costs, errors = np.array([1.0, np.nan, 0.5, 2.0]), np.array([np.inf, 0.1, np.nan, 3.0])
    assert on_front(costs, errors).tolist() == [False, False, False, True]
    with pytest.raises(ValueError, match="as many costs as errors"):
        on_front(np.ones(2), np.ones(3))


@given(POINTS, st.floats(0.1, 10.0), st.floats(0.1, 10.0))
def test_the_knee_is_on_the_front_and_knows_no_units(points: list[tuple[int, int]], by: float, other: float) -> None:
    costs, errors = split(points)
    found = knee(costs, errors)
    assert on_front(costs, errors)[found]
    scaled = knee(costs * by, errors * other)

    def below(number: int) -> float:
        front = on_front(costs, errors)
        x, y = (np.log(values) for values in (costs, errors))
        spans = [max(np.ptp(one[front]), 1e-12) for one in (x, y)]
        return 1.0 - (x[number] - x[front].min()) / spans[0] - (y[number] - y[front].min()) / spans[1]

    assert below(scaled) == pytest.approx(below(found), abs=1e-9)  # another one only where they tie


def test_the_only_point_is_the_knee() -> None:
    with np.errstate(all="raise"):
        assert knee(np.array([3.0]), np.array([2.0])) == 0
        assert knee(np.array([3.0, 3.0]), np.array([2.0, 2.0])) == 0


def test_a_corner_is_the_knee() -> None:
    costs, errors = np.array([1.0, 2.0, 4.0, 16.0, 3.0]), np.array([100.0, 10.0, 2.0, 1.0, 50.0])
    assert knee(costs, errors) == 2
    assert knee(np.array([5.0]), np.array([2.0])) == 0
    straight = np.array([1.0, 10.0]), np.array([10.0, 1.0])
    assert knee(*straight) == 0
    with pytest.raises(ValueError, match="a finite point"):
        knee(np.array([np.nan]), np.array([1.0]))
    with pytest.raises(ValueError, match="above 0"):
        knee(np.array([0.0]), np.array([1.0]))


@given(POINTS, WHOLE)
def test_the_least_error_of_a_budget(points: list[tuple[int, int]], budget: int) -> None:
    found = least_error(*split(points), np.array([float(budget)]))[0]
    assert found == min((float(y) for x, y in points if x <= budget), default=math.inf)


def test_means_are_geometric() -> None:
    assert means(np.array([[1.0, 100.0], [3.0, 3.0]])).tolist() == pytest.approx([10.0, 3.0])


@given(st.integers(0, 1000))
def test_runs_that_agree_leave_no_doubt(seed: int) -> None:
    costs, errors = np.array([[1.0] * 3, [2.0] * 3, [3.0] * 3]), np.array([[4.0] * 3, [1.0] * 3, [2.0] * 3])
    bands = bootstrap(costs, errors, np.array([0.5, 1.0, 2.5]), draws=20, seed=seed)
    assert bands.on_front.tolist() == [1.0, 1.0, 0.0] and bands.at_knee.sum() == 1.0
    assert bands.low.tolist() == pytest.approx([math.inf, 4.0, 1.0]) and (bands.low == bands.high).all()


def test_bands_hold_the_front_and_narrow_with_more_runs() -> None:
    drawn = np.random.default_rng(1)
    costs = np.exp(drawn.normal(np.log([[1.0], [2.0], [4.0]]), 0.05, (3, 64)))
    errors = np.exp(drawn.normal(np.log([[4.0], [2.0], [1.0]]), 0.5, (3, 64)))
    budgets = np.array([1.5, 3.0, 6.0])
    wide, narrow = bootstrap(costs[:, :4], errors[:, :4], budgets), bootstrap(costs, errors, budgets)
    mean = least_error(means(costs), means(errors), budgets)
    assert (narrow.low <= mean).all() and (mean <= narrow.high).all()
    assert (np.log(narrow.high / narrow.low) < np.log(wide.high / wide.low)).all()
    low, high = interval(errors[0])
    assert low < means(errors[:1])[0] < high and interval(errors[0]) == (low, high)
