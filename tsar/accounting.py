"""Sums over the field for the record of a cycle: the density that is handed out, the spread of the ages that are shown,
and the number of values that are not finite."""

from __future__ import annotations

from dataclasses import dataclass

import torch
from jaxtyping import Float64
from torch import Tensor

from tsar.config import TsarConfig
from tsar.morton import raster_to_morton, total
from tsar.types import Densities, Errors

_AT_BOUND = 1e-6  # of a bound, relative

FAST_REFRESH = 0.5
"""Elements refreshed at least this often per cycle count as moving when the spread of ages is measured."""


@dataclass(frozen=True)
class Account:
    """Sums over the field after a cycle.

    Attributes:
        combined: Σ θ_s θ_t, samples per cycle.
        age_spread_s: newest minus oldest sample shown among the elements that are refreshed fast, seconds; 0 if there
            are none.
        nonfinite: densities and errors that are not finite.
    """

    combined: float
    age_spread_s: float
    nonfinite: int


def account(
    densities: Densities, errors: Errors, newest_s: Float64[Tensor, "side side"], config: TsarConfig
) -> Account:
    """Sums densities and errors, and the ages of the newest samples that are shown, in raster order."""
    fields = densities.spatial, densities.temporal, errors.spatial, errors.temporal
    nonfinite = sum(int((~torch.isfinite(field)).sum()) for field in fields)
    return Account(total(densities.combined()), _age_spread(newest_s, densities, config), nonfinite)


def _age_spread(newest_s: Float64[Tensor, "side side"], densities: Densities, config: TsarConfig) -> float:
    side, repeat = config.sdf_side, config.sdf_side // newest_s.shape[0]
    field = newest_s.repeat_interleave(repeat, 0).repeat_interleave(repeat, 1).reshape(-1)
    fast = densities.temporal[raster_to_morton(side)] >= FAST_REFRESH
    shown = field[fast & torch.isfinite(field)]
    return float(shown.max() - shown.min()) if shown.numel() else 0.0


@dataclass(frozen=True)
class Movement:
    """What a decision did to the elements of the field.

    Attributes:
        elements: whose densities changed.
        saturated: that came to lie at a bound of a density at which they did not lie before: one decision drove them as
            far as they can go.
    """

    elements: int
    saturated: int


def movement(before: Densities, after: Densities, config: TsarConfig) -> Movement:
    """How many elements a decision moved, and how many of them it drove to a bound."""
    moved = torch.zeros_like(before.spatial, dtype=torch.bool)
    struck = torch.zeros_like(moved)
    bounds = config.spatial_bounds, config.temporal_bounds
    pairs = (before.spatial, after.spatial), (before.temporal, after.temporal)
    for (low, high), (old, new) in zip(bounds, pairs, strict=True):
        changed = old != new
        at_bound = (new <= low * (1 + _AT_BOUND)) | (new >= high * (1 - _AT_BOUND))
        moved |= changed
        struck |= changed & at_bound & (old > low * (1 + _AT_BOUND)) & (old < high * (1 - _AT_BOUND))
    return Movement(int(moved.sum()), int(struck.sum()))
