"""Extremes of radiance, for every policy and both sets of stages: non-finite values are never shown, and the value of
one pixel stays there."""

from __future__ import annotations

from math import inf, nan

import pytest
import torch

from tests.oracles.screens import Layer, Screen
from tests.tsar.policies.every import CASES, away_from, made, places, share_of_a_batch, spoiled
from tests.tsar.policies.test_behaviour import CYCLE_S, grey
from tsar.clock import fixed_clock
from tsar.config import StagesName
from tsar.policies.filter import Filter
from tsar.policy import run
from tsar.types import Trace

GREY = 0.4
NOWHERE = {(5, 5): nan, (50, 9): inf, (30, 33): -inf, (12, 52): 1.001e30, (57, 57): torch.finfo(torch.float32).max}
"""Non-finite values, by pixel."""
FEATURES = {(20, 44): 1e30, (44, 20): -1.0, (36, 60): 0.0}
"""Finite values that are extreme, by pixel."""
REACH_PX = 6
"""Pixels from a single-pixel feature beyond which it has no effect once the picture has been sampled: 4 were measured,
because unknown pixels are filled in from their surroundings."""


@pytest.fixture(autouse=True)
def short_warmup(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Filter, "warmup_cycles", 40)


def shown(policy: str, kind: StagesName, trace: Trace, end_s: float = 0.05) -> torch.Tensor:
    """Pictures on the display from time zero on."""
    found = made(policy, kind, SCREEN, trace)
    clock = fixed_clock(CYCLE_S * share_of_a_batch(found))
    return torch.stack([one.image for _, one in run(found, trace, clock, 0.0, end_s) if one.sample_time_s >= 0.0])


SCREEN = Screen((Layer(grey(GREY)),))


@pytest.mark.parametrize(("policy", "kind"), CASES)
def test_single_pixels_stay_where_they_are_and_nonfinite_values_are_never_shown(policy: str, kind: StagesName) -> None:
    pictures = shown(policy, kind, spoiled(SCREEN, places(NOWHERE | FEATURES)))
    assert bool(pictures.isfinite().all()) and float(pictures.max()) < 1.0001e30
    beside = away_from(list(FEATURES), REACH_PX)
    assert float((pictures[-1, beside] - GREY).abs().max()) < 1e-3


@pytest.mark.parametrize(("policy", "kind"), CASES)
def test_a_region_of_nan_is_dark_at_worst(policy: str, kind: StagesName) -> None:
    """Half of the picture is NaN, so whole tiles are."""

    def spoil(color: torch.Tensor, x: torch.Tensor, y: torch.Tensor) -> torch.Tensor:
        color[x < 32] = nan
        return color

    pictures = shown(policy, kind, spoiled(SCREEN, spoil), 0.02)
    assert bool(pictures.isfinite().all()) and float(pictures.min()) >= 0.0 and float(pictures.max()) <= GREY + 2e-3
    assert float((pictures[-1, :, 48:] - GREY).abs().mean()) < 0.2


@pytest.mark.parametrize("value", [pytest.param(0.0, marks=pytest.mark.slow), 1e-30, 1e30])
@pytest.mark.parametrize(("policy", "kind"), CASES)
def test_constant_frames(policy: str, kind: StagesName, value: float) -> None:
    """Black stays black, a tiny value stays tiny, and a value brighter than any display is white."""
    screen = Screen((Layer(grey(value)),))
    pictures = shown(policy, kind, screen.trace, 0.02)[-1]
    assert bool(pictures.isfinite().all())
    if value <= 1.0:
        assert float(pictures.min()) >= 0.0 and float(pictures.max()) <= value * (1 + 1e-5)
    else:
        assert float(pictures.min()) >= 1.0
