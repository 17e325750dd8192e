"""Point sets and warps at the extremes of their random numbers."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
import warp as wp
from scipy.stats._qmc import van_der_corput

from renderer.compute.device import initialise
from renderer.kernels.randomness import unit_interval
from renderer.sampling import POINT_SETS
from renderer.sampling.plan import SamplePlan, gaussian_warp, pixel_shift
from renderer.sampling.point_sets import BELOW_ONE, packing_distance, point_set, toroidal_distance

LAST = 2**32 - 1


def inverse(index: int, base: int) -> Fraction:
    """The radical inverse, digit by digit."""
    found, weight = Fraction(0), Fraction(1, base)
    while index:
        index, digit = divmod(index, base)
        found, weight = found + digit * weight, weight / base
    return found


@pytest.mark.parametrize("index", [0, 1, 2**31, LAST - 1, LAST])
def test_radical_inverses_up_to_the_last_word(index: int) -> None:
    for base in (2, 3):
        found = float(van_der_corput(1, base, start_index=index, scramble=False)[0])
        assert found == pytest.approx(float(inverse(index, base)), rel=1e-14, abs=0.0) and found < 1.0


def test_points_below_one_whatever_is_made() -> None:
    """The last word and the last random number add up to 1 when they are rounded; a set cuts that off."""
    assert (float(LAST) + BELOW_ONE) * 2.0**-32 == 1.0
    with POINT_SETS.lent(last=lambda count, rng: (np.full((count, 3), float(LAST)) + BELOW_ONE) * 2.0**-32):
        points = point_set("last", 8)
    assert (points == BELOW_ONE).all()


@wp.kernel
def units(words: wp.array(dtype=wp.uint32), found: wp.array(dtype=wp.float32)):
    """Words as numbers."""
    found[wp.tid()] = unit_interval(words[wp.tid()])


def test_words_of_kernels_as_numbers() -> None:
    initialise()
    words = np.array([0, 1, 255, 256, 2**31, LAST], np.uint32)
    found = wp.zeros(len(words), dtype=wp.float32, device="cpu")
    wp.launch(units, len(words), [wp.array(words, dtype=wp.uint32, device="cpu")], [found], device="cpu")
    np.testing.assert_array_equal(found.numpy(), (words >> 8) * 2.0**-24)
    assert found.numpy().max() < 1.0


def test_box_and_muller_at_their_ends() -> None:
    """At 0 the centre; just below 1 the farthest, ``sqrt(2 ln 2^53)`` deviations away; never NaN."""
    farthest = np.sqrt(2.0 * 53.0 * np.log(2.0))
    x, y = gaussian_warp(np.array([0.0, 5e-324, BELOW_ONE]), np.zeros(3), 1.0)
    np.testing.assert_allclose(x, [0.0, np.sqrt(2.0 * 5e-324), farthest], rtol=1e-12)
    assert (y == 0.0).all()
    ends = np.array([0.0, 0.25, 0.5, 0.75, BELOW_ONE])
    x, y = gaussian_warp(np.full(5, BELOW_ONE), ends, 1.0)
    np.testing.assert_allclose(np.hypot(x, y), farthest, rtol=1e-12)


@pytest.mark.parametrize("shift", ["white", "blue"])
def test_a_picture_of_points_at_the_ends(shift) -> None:
    """Whatever pixels shift them by: positions and times are numbers, and times within the shutter's."""
    ends = np.array([[a, b, c] for a in (0.0, BELOW_ONE) for b in (0.0, BELOW_ONE) for c in (0.0, BELOW_ONE)])
    with POINT_SETS.lent(ends=lambda count, rng: ends):
        plan = SamplePlan(8, "ends", space_filter="gaussian", time_filter="triangle", shift=shift)
        pixels = np.arange(2048)
        position, time_s = plan.samples(pixels % 64, pixels // 64, 64, 32, 0.0, (0.0, 1.0))
    assert np.isfinite(position).all() and (time_s >= 0.0).all() and (time_s <= 1.0).all()


def test_shifts_of_the_last_pixels() -> None:
    far = np.array([0, 1, 2**31 - 1, 2**53, 2**63 - 1])
    shift = pixel_shift(2**63 - 1, far, far[::-1], frame=2**31)
    assert (shift >= 0.0).all() and (shift < 1.0).all() and len(np.unique(shift)) == shift.size


@pytest.mark.parametrize("count", [1, 2, 4, 32, 108, 256])
def test_darts_where_the_densest_packing_fits_the_cube(count: int) -> None:
    """4, 32, 108 and 256 points can be packed as densely as space allows: darts end all the same, near their limit."""
    points = point_set("poisson", count, seed=1)
    apart = toroidal_distance(points[:, None], points[None])[~np.eye(count, dtype=bool)]
    # of one and two the torus is too small for the distance of a packing of all space
    assert apart.min(initial=1.0) >= 0.6 * packing_distance(count)
