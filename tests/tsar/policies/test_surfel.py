"""The errors by which surfels are sampled, in made-up estimates."""

from __future__ import annotations

from dataclasses import replace

import pytest
import torch

from tsar.config import TsarConfig
from tsar.policies.surfel import Surfel, SurfelState
from tsar.policy import Moment, Setting

CONFIG = TsarConfig(batch_size=16, resolution_px=64)
NOW = Moment(0.0, 0, 0.0)


def made(spatial: float, temporal: float) -> tuple[Surfel, SurfelState]:
    """A policy and its state with the same variances in every pixel."""
    policy = Surfel(Setting(CONFIG))
    state = policy.start()
    one = torch.ones_like(state.estimates.aged)
    known = replace(
        state.estimates, time_s=0.0 * one.double(), aged=temporal * one, roughness=2.0 * spatial * one, inverse=one
    )
    return policy, replace(state, estimates=known, rate=torch.zeros_like(state.rate))


def relative(signal: float, least: float) -> float:
    return (signal - least) / (signal + least)


def test_a_quiet_picture_tolerates_a_least_variance() -> None:
    """2⁻¹² in space and 2⁻¹¹ in time; elements below them give density back."""
    policy, state = made(2.0**-14, 0.0)
    found = policy._errors(state, NOW)
    assert found.spatial.unique().item() == pytest.approx(relative(2.0**-14, 2.0**-12)) == pytest.approx(-0.6)
    assert found.temporal.unique().item() == -1.0
    policy, state = made(0.0, 2.0**-14)
    found = policy._errors(state, NOW)
    assert found.spatial.unique().item() == -1.0
    assert found.temporal.unique().item() == pytest.approx(relative(2.0**-14, 2.0**-11)) == pytest.approx(-7 / 9)


def test_a_busy_picture_tolerates_its_mean() -> None:
    policy, state = made(0.01, 0.03)
    found = policy._errors(state, NOW)
    assert found.spatial.unique().item() == pytest.approx(relative(0.01, 0.04), rel=1e-5)
    assert found.temporal.unique().item() == pytest.approx(relative(0.03, 0.04), rel=1e-5)


def test_change_since_the_last_cycle_counts_as_time() -> None:
    policy, state = made(0.01, 0.01)
    found = policy._errors(replace(state, rate=torch.full_like(state.rate, 0.2)), Moment(0.0, 0, 0.1))
    assert found.temporal.unique().item() == pytest.approx(relative(0.03, 0.04), rel=1e-5)
    assert found.spatial.unique().item() == pytest.approx(relative(0.01, 0.04), rel=1e-5)


def test_a_pixel_that_is_not_known_has_the_variance_of_one_sample() -> None:
    policy, state = made(0.01, 0.01)
    estimates = state.estimates
    nothing = torch.full_like(estimates.time_s, -float("inf"))
    found = policy._errors(
        replace(state, estimates=replace(estimates, time_s=nothing, inverse=0.0 * estimates.inverse)), NOW
    )
    assert found.spatial.unique().item() == pytest.approx(relative(0.01, 0.02), rel=1e-5)


@pytest.mark.parametrize("wide", [4, 16, 32])
def test_a_plane_is_resampled_to_the_field(wide: int) -> None:
    """Elements in Morton order have the mean of the cells within them, or the value of the cell around them."""
    policy = Surfel(Setting(CONFIG))
    side, plane = CONFIG.sdf_side, torch.rand(1, wide, wide, generator=torch.Generator().manual_seed(0))
    found = policy._field(plane)
    for number in range(side * side):
        x = sum((number >> 2 * bit & 1) << bit for bit in range(8))
        y = sum((number >> 2 * bit + 1 & 1) << bit for bit in range(8))
        first = plane[0, y * wide // side : max((y + 1) * wide // side, y * wide // side + 1)]
        cells = first[:, x * wide // side : max((x + 1) * wide // side, x * wide // side + 1)]
        assert float(found[number]) == pytest.approx(float(cells.mean()), rel=1e-5)


def test_what_is_shown_of_another_picture_is_blended_alike() -> None:
    """A picture of one colour stays that, and the picture of the estimates is what is shown."""
    policy, state = made(0.01, 0.01)
    carried = policy.image(state, NOW).carried
    assert carried is not None
    plain, color = torch.full((64, 64, 3), 0.25), torch.rand(3, 64, 64, generator=torch.Generator().manual_seed(1))
    assert torch.allclose(carried(plain), plain, atol=1e-5)
    drawn = policy._displayed(replace(state, estimates=replace(state.estimates, color=color)), NOW)
    assert torch.equal(carried(color.permute(1, 2, 0)), policy.image(drawn, NOW).image)
