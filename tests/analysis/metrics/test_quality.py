"""Quality pipeline against closed forms."""

from __future__ import annotations

import math

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from analysis.command.cli import InputError
from analysis.metrics import quality
from tsar.types import ShownImage


def shown(*times: float) -> list[tuple[int, ShownImage]]:
    return [(i, ShownImage(t, t - 0.1, torch.full((2, 2, 3), float(i)))) for i, t in enumerate(times)]


def test_reference_times() -> None:
    assert quality.reference_times(0.0, 0.3, 60.0).size == 18
    assert np.allclose(quality.reference_times(1.0, 1.1, 20.0), [1.0, 1.05])
    with pytest.raises(ValueError, match="end_s"):
        quality.reference_times(1.0, 1.0, 60.0)


def test_hold_shows_the_last_image_without_interpolation() -> None:
    hold = quality.Hold(shown(0.0, 0.25, 0.5, 2.0))
    assert [hold.at(t)[0] for t in (0.0, 0.1, 0.2499, 0.25, 0.7, 1.9, 2.0, 9.0)] == [0, 0, 0, 1, 2, 2, 3, 3]
    assert hold.refresh_s == [0.0, 0.25, 0.5, 2.0]


def test_hold_reads_one_image_ahead_only() -> None:
    taken = []

    def stream():
        for item in shown(0.0, 1.0, 2.0, 3.0):
            taken.append(item[0])
            yield item

    hold = quality.Hold(stream())
    hold.at(0.5)
    assert taken == [0, 1]


def test_hold_before_the_first_image() -> None:
    with pytest.raises(InputError, match="warmup_cycles: expected enough"):
        quality.Hold(shown(1.0)).at(0.5)


def test_mse_of_constants() -> None:
    one, zero = torch.ones(4, 4, 3), torch.zeros(4, 4, 3)
    errors, _ = quality.pixel_errors(one, zero)
    assert errors.mse == pytest.approx(1.0, abs=1e-6)
    assert errors.log_mse == pytest.approx(math.log(2.0) ** 2, rel=1e-5)
    # beyond white the display shows no difference, but the log-compressed error does
    assert quality.pixel_errors(7 * one, 3 * one)[0].mse == 0.0
    assert quality.pixel_errors(7 * one, 3 * one)[0].log_mse == pytest.approx(math.log(2.0) ** 2, rel=1e-5)
    with pytest.raises(ValueError, match="shapes"):
        quality.pixel_errors(one, torch.zeros(2, 2, 3))


def test_encoding_is_srgb() -> None:
    grey = quality.encode(torch.full((1, 1, 3), 0.21404114))
    assert torch.allclose(grey, torch.full((1, 1, 3), 0.5), atol=1e-4)


def test_nonfinite_is_counted() -> None:
    image = torch.zeros(2, 2, 3)
    image[0, 0, 0], image[1, 1, 1] = float("nan"), float("inf")
    errors, _ = quality.pixel_errors(image, torch.zeros(2, 2, 3))
    assert (errors.nonfinite, errors.mse) == (2, 0.0)


def test_ratio_rules() -> None:
    assert quality.ratio([0.0, 1.0, 0.0, 1.0], [0.0, 0.0, 2.0, 4.0]).tolist() == [1.0, math.inf, 0.0, 0.25]


@pytest.mark.parametrize(
    ("ratios", "expected"),
    [
        ([0.5, 0.9, 1.0], 100.0),
        ([1.1, 2.0], 0.0),
        ([0.0, 2.0], 50.0),
        ([1.0, math.inf], 0.0),
        ([0.5, 1.0, math.inf], 50.0),
        ([0.5, 0.5, 0.5, 0.5, 1.5], 87.5),
        ([3.0], 0.0),
        ([1.0], 100.0),
        ([math.inf, math.inf], 0.0),
    ],
)
def test_suitable_percentile(ratios: list[float], expected: float) -> None:
    assert quality.suitable_percentile(np.array(ratios)) == pytest.approx(expected)


@given(st.lists(st.floats(0.0, 4.0), min_size=2, max_size=40))
def test_suitable_percentile_agrees_with_numpy(values: list[float]) -> None:
    p = quality.suitable_percentile(np.array(values))
    assert p == 0.0 or np.percentile(values, p) <= 1.0 + 1e-9
    assert p == 100.0 or np.percentile(values, min(100.0, p + 0.01)) >= 1.0 - 1e-9


def test_statistics() -> None:
    framed = np.ones(9)
    adaptive = np.array([1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 100.0]) / 4.0
    s = quality.ratio_statistics(adaptive, framed)
    assert (s.median, s.quartile_low, s.quartile_high) == (1.25, 0.75, 1.75)
    assert (s.whisker_low, s.whisker_high, s.outliers) == (0.25, 2.0, 1)
    assert s.share_suitable == pytest.approx(4 / 9)
    assert s.suitable_percentile == 37.5


def test_whiskers_end_within_one_and_a_half_boxes() -> None:
    """The box reaches from 11.5 to 16.5, so whiskers from 4 to 24: values there count, just beyond they do not."""
    inner = np.arange(9.0) + 10.0
    for beyond, (low, high), outliers in (
        (np.array([4.0, 24.0]), (4.0, 24.0), 0),
        (np.array([3.99, 24.01]), (10.0, 18.0), 2),
        (np.array([3.99, 24.0]), (10.0, 24.0), 1),
    ):
        s = quality.ratio_statistics(np.concatenate([inner, beyond]), np.ones(11))
        assert (s.quartile_low, s.quartile_high) == (11.5, 16.5)
        assert (s.whisker_low, s.whisker_high, s.outliers) == (low, high, outliers)


def test_statistics_with_infinite_ratios() -> None:
    s = quality.ratio_statistics(np.ones(5), np.array([1.0, 1.0, 0.0, 0.0, 0.0]))
    assert (s.median, s.infinite, s.quartile_low) == (math.inf, 3, 1.0)
    assert s.suitable_percentile == 25.0
    s = quality.ratio_statistics(np.ones(3), np.zeros(3))
    assert (s.infinite, s.outliers, s.suitable_percentile) == (3, 0, 0.0)


def test_nan_is_refused() -> None:
    with pytest.raises(ValueError, match="NaN"):
        quality.suitable_percentile(np.array([1.0, math.nan]))
