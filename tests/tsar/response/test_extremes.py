"""Every solver at the ends: conserved, within bounds, and finite, whatever the fields are."""

from __future__ import annotations

from itertools import cycle, product

import pytest
import torch

from tests.tsar.response import extremes
from tsar.choices import SOLVERS
from tsar.config import ResponseConfig, TilingConfig, TsarConfig
from tsar.response import respond
from tsar.response.local import Box, constrain
from tsar.response.mixture import mix
from tsar.response.transport import fill
from tsar.types import Densities, Errors

ROUNDING = 1e-12
"""Tolerance of sums over a few hundred elements: a hundred times the float64 rounding of each."""
RESPONSES = [
    ResponseConfig(gain=gain, bias=bias, surplus_max=surplus, temporal_min=floor)
    for gain, bias, surplus, floor in (
        (1.0, 0.0, 1.0, 1 / 16),
        (1e6, 0.0, 1.0, 1e-6),
        (1e-6, 0.0, 0.0, 1.0),
        (1.0, 8.0, 1.0, 1e-6),
        (1.0, -8.0, 0.0, 1e-6),
        (1e6, -8.0, 1.0, 1.0),
        (1e6, 8.0, 0.0, 1 / 16),
    )
]
"""Gain, bias, surplus and floor at either end."""


def configured(solver: str, response: ResponseConfig, side: int = 16) -> TsarConfig:
    return TsarConfig(
        sdf_side=side,
        resolution_px=128,
        batch_size=16,
        tiling=TilingConfig(level_min=1, level_max=4),
        response=ResponseConfig(
            solver=solver, **{name: value for name, value in vars(response).items() if name != "solver"}
        ),
    )


def assert_kept(before: Densities, after: Densities, config: TsarConfig) -> None:
    """Conserved and in bounds, surplus included."""
    (low_s, high_s), (low_t, high_t) = config.spatial_bounds, config.temporal_bounds
    whole = [float(one.combined().sum()) + one.surplus for one in (before, after)]
    assert abs(whole[1] - whole[0]) <= ROUNDING * max(whole[0], config.budget)
    assert low_s * (1 - ROUNDING) <= float(after.spatial.min()) <= float(after.spatial.max()) <= high_s * (1 + ROUNDING)
    assert low_t * (1 - ROUNDING) <= float(after.temporal.min())
    assert float(after.temporal.max()) <= high_t * (1 + ROUNDING)
    most = max(config.response.surplus_max * config.budget, before.surplus)
    assert 0.0 <= after.surplus <= most + ROUNDING * config.budget


@pytest.mark.parametrize(
    ("solver", "response"),
    [
        pytest.param(
            solver, one, id=f"{solver} {one.gain:g} {one.bias:g} {one.surplus_max:g}",
            marks=[] if solver == "waterfill" or number < 3 else [pytest.mark.slow],
        )
        for solver in SOLVERS
        for number, one in enumerate(RESPONSES)
    ],
)  # fmt: skip
def test_decisions_at_the_ends_conserve_and_stay_in_bounds(solver: str, response: ResponseConfig) -> None:
    config = configured(solver, response)
    count = config.sdf_side**2
    starts = extremes.densities(count, *config.spatial_bounds, *config.temporal_bounds)
    surplus = cycle((0.0, response.surplus_max * config.budget))
    for (spatial, temporal), phi in product(starts.values(), extremes.errors(count).values()):
        before = Densities(spatial, temporal, next(surplus))
        assert_kept(before, respond(before, Errors(phi[0], phi[1]), config), config)


WIDE = Box(1e-12, 1e-12)
"""Densities from 1e-6 to 1e6 on either axis."""


@pytest.mark.parametrize("solver", SOLVERS)
def test_twelve_decades_on_either_axis(solver: str) -> None:
    starts = extremes.densities(64, WIDE.spatial_min, 1.0, WIDE.temporal_min, 1.0)
    gains = cycle((1e-6, 1.0, 1e6))
    for (a_s, a_t), phi in product(starts.values(), extremes.errors(64).values()):
        local = constrain(a_s, a_t, Errors(phi[0], phi[1]), WIDE, next(gains))
        for surplus, most in ((0.0, 0.0), (3.0, 3.0), (1e-12, 1e12)):
            change = SOLVERS[solver](local.desired_change, local.max_change, surplus, most)
            scale = float(change.abs().sum()) + surplus
            assert bool((change * local.desired_change >= 0).all())
            assert bool((change.abs() <= local.max_change.abs() * (1 + ROUNDING) + 1e-300).all())
            assert -ROUNDING * scale <= surplus - float(change.sum()) <= most + ROUNDING * scale
            for bias in (-8.0, 0.0, 8.0) if solver == "waterfill" and surplus == 3.0 else ():
                b_s, b_t = mix(local, change, WIDE, bias)
                after = a_s * a_t + change
                assert abs(float((b_s * b_t - after).sum())) <= ROUNDING * (float((a_s * a_t).sum()) + scale)
                for one in (b_s, b_t):
                    assert 1e-12 * (1 - ROUNDING) <= float(one.min()) and float(one.max()) <= 1 + ROUNDING


def test_water_among_weights_many_decades_apart() -> None:
    """What the light ones hold is in no difference of sums of the heavy ones."""
    weight = torch.tensor([1e-39] * 5 + [1.0] * 3 + [1e-20] * 2, dtype=torch.float64)
    vessel = torch.tensor([0.3] * 5 + [0.25] * 3 + [0.5] * 2, dtype=torch.float64)
    whole = float(vessel.sum())
    for share in (0.1, 0.3, 0.5, 0.75, 0.9, 1.0):
        poured = fill(weight, vessel, share * whole)
        assert float(poured.sum()) == pytest.approx(share * whole, rel=1e-14)
        assert bool((poured <= vessel).all())
    light = torch.full((5,), 0.3e-39 / 3.0, dtype=torch.float64)
    torch.testing.assert_close(fill(weight, vessel, 0.3)[:5], light, rtol=1e-14, atol=0.0)


@pytest.mark.slow
@pytest.mark.parametrize("solver", SOLVERS)
def test_a_million_elements(solver: str) -> None:
    count = 1 << 20
    starts = extremes.densities(count, WIDE.spatial_min, 1.0, WIDE.temporal_min, 1.0)
    for name in ("decades", "least space, greatest time, but one"):
        for phi in extremes.errors(count).values():
            local = constrain(*starts[name], Errors(phi[0], phi[1]), WIDE, 1.0)
            change = SOLVERS[solver](local.desired_change, local.max_change, 0.0, 3.0)
            scale = float(change.abs().sum())
            assert bool((change * local.desired_change >= 0).all())
            assert bool((change.abs() <= local.max_change.abs() * (1 + ROUNDING) + 1e-300).all())
            # float64 rounds by 2^-53 for each of a million elements
            assert -(count * 2.0**-53) * scale <= -float(change.sum()) <= 3.0 + count * 2.0**-53 * scale
