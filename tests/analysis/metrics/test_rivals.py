"""The best rival of made-up traces."""

from __future__ import annotations

import numpy as np
import pytest

from analysis.metrics.rivals import Standing, best_of, best_shares, standing

A, B = np.array([1.0, 4.0, np.nan, np.nan]), np.array([2.0, 3.0, 5.0, np.nan])


def test_the_best_is_taken_moment_by_moment() -> None:
    assert best_of([A, B]).tolist()[:3] == [1.0, 3.0, 5.0] and np.isnan(best_of([A, B])[3])
    assert best_of([A, B], 1).tolist()[:3] == [2.0, 4.0, 5.0]
    assert best_of([A]).tolist()[:2] == [1.0, 4.0]
    with pytest.raises(ValueError, match="at least one trace"):
        best_of([])


def test_shares_of_the_best() -> None:
    assert best_shares({"a": A, "b": B}) == {"a": 1 / 3, "b": 2 / 3}
    tied = np.array([1.0, 1.0])
    assert best_shares({"a": tied, "b": tied}) == {"a": 1.0, "b": 1.0}


def test_standing_leaves_out_what_was_not_measured() -> None:
    assert standing(A, B) == Standing(2, 0.5, 1.0)
    assert standing(B, A, 1) == Standing(2, 0.5, 1.0)
    assert standing(np.array([1.0, 1.0, 4.0]), np.array([1.0, 2.0, 2.0])) == Standing(3, 2 / 3, 0.5)


def test_standing_beside_zero_and_nothing() -> None:
    zero, nothing = np.zeros(2), np.full(2, np.nan)
    assert standing(zero, zero) == Standing(2, 1.0, 1.0)
    assert standing(np.ones(2), zero) == Standing(2, 0.0, np.inf)
    found = standing(zero, nothing)
    assert found.times == 0 and np.isnan(found.share) and np.isnan(found.ratio)
