"""Derivatives in closed form against differences of what they are derivatives of."""

from __future__ import annotations

import torch

from tests.tsar.response.problems import random_problem
from tsar.filtering.densities import best
from tsar.response.local import area_change

STEP = 1e-6


def test_the_extremum_is_where_the_change_of_area_has_none() -> None:
    """``d/dk Area(a + k m) = a_s m_t + a_t m_s + 2 k m_s m_t``, and it is 0 at the bound that an element may reach."""
    found = 0
    for seed in range(8):
        local = random_problem(seed)
        a_s, a_t, m_s, m_t = local.a_s, local.a_t, local.m_s, local.m_t

        def area(k: torch.Tensor, a_s=a_s, a_t=a_t, m_s=m_s, m_t=m_t) -> torch.Tensor:
            return area_change(a_s, a_t, m_s, m_t, k)

        for share in (0.0, 0.3, 1.0):
            k = share * local.k_max
            closed = a_s * m_t + a_t * m_s + 2.0 * k * m_s * m_t
            difference = (area(k + STEP) - area(k - STEP)) / (2.0 * STEP)
            torch.testing.assert_close(closed, difference, rtol=0.0, atol=1e-9)
        inner = local.active & (local.max_change.abs() > area(local.k_max).abs() + 1e-9)
        product = torch.where(inner, m_s * m_t, -1.0)
        k = -(a_s * m_t + a_t * m_s) / (2.0 * product)
        slope = (area(k + STEP) - area(k - STEP)) / (2.0 * STEP)
        assert float(slope[inner].abs().max() if inner.any() else 0.0) < 1e-9
        found += int((inner & (area(k) - local.max_change).abs().lt(1e-12)).sum())
    assert found > 50, "bounds that are extrema"


def test_the_best_densities_have_equal_gains_in_both_directions() -> None:
    """Inside the bounds the error falls alike with a sample more in space and one more in time, everywhere:
    ``d(a/θ_s + b/θ_t) / d(θ_s θ_t)`` is the same along either axis, by differences."""
    g = torch.Generator().manual_seed(3)
    coarse, stale = (10.0 ** (2.0 * torch.rand(1, 16, 16, generator=g, dtype=torch.float64) - 4.0) for _ in range(2))
    space, time = best(coarse, stale, 0.25)
    (low_s, high_s), (low_t, high_t) = (1 / 64, 4.0), (1 / 128, 1.0)
    inside = (space > low_s * 1.01) & (space < high_s * 0.99) & (time > low_t * 1.01) & (time < high_t * 0.99)

    def error(s: torch.Tensor, t: torch.Tensor) -> torch.Tensor:
        return coarse / s + stale / t

    by_space = (error(space * (1 + STEP), time) - error(space * (1 - STEP), time)) / (2.0 * STEP * space * time)
    by_time = (error(space, time * (1 + STEP)) - error(space, time * (1 - STEP))) / (2.0 * STEP * space * time)
    assert int(inside.sum()) > 30
    gain = torch.stack((by_space[inside], by_time[inside]))
    torch.testing.assert_close(gain, gain.mean().expand_as(gain), rtol=1e-6, atol=0.0)
