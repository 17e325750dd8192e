"""Ratios of errors at the ends: nothing over nothing, something over nothing, and twelve orders of magnitude."""

from __future__ import annotations

import math

import numpy as np
import pytest

from analysis.metrics import quality
from analysis.metrics.rivals import standing

DECADES = 10.0 ** np.linspace(-6.0, 6.0, 25)


def test_nothing_over_nothing_is_even_and_something_over_nothing_is_endless() -> None:
    assert quality.ratio([0.0, 1e-300, 0.0], [0.0, 0.0, 1e-300]).tolist() == [1.0, math.inf, 0.0]
    assert standing([0.0, 0.0], [0.0, 0.0]).ratio == 1.0
    assert standing([1e-300, 1.0], [0.0, 0.0]).ratio == math.inf
    assert standing([0.0, 0.0], [1e-300, 1.0]).ratio == 0.0


def test_the_ratio_of_nan_is_nan() -> None:
    """A moment that was not measured must not count as one at which the framed renderer was perfect."""
    assert np.isnan(quality.ratio([1.0, np.nan, 0.0], [np.nan, 1.0, np.nan])).all()
    with pytest.raises(ValueError, match="no NaN, got 2 with 1"):
        quality.ratio_statistics([1.0, 1.0], [np.nan, 1.0])


def test_twelve_orders() -> None:
    ratios = quality.ratio(DECADES, DECADES[::-1])
    np.testing.assert_allclose(ratios, DECADES**2, rtol=1e-14)
    found = quality.ratio_statistics(DECADES, DECADES[::-1])
    assert found.share_suitable == 13 / 25 and found.suitable_percentile == pytest.approx(50.0, abs=1e-9)
    assert found.infinite == 0
    endless = quality.ratio_statistics(DECADES, np.where(DECADES < 1e5, DECADES, 0.0))
    assert endless.infinite == int((DECADES >= 1e5).sum()) and math.isfinite(endless.median)
