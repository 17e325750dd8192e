"""Sums over the field for the record of a cycle: the allocated density, the spread of sample ages on the display, and
the number of non-finite values."""

from __future__ import annotations

from dataclasses import dataclass

import torch
from jaxtyping import Float64
from torch import Tensor

from tsar.config import TsarConfig
from tsar.morton import raster_to_morton, total
from tsar.types import Densities, Errors

_AT_BOUND = 1e-6  # relative tolerance of a bound

FAST_REFRESH = 0.5
"""Elements refreshed at least this often per cycle count as moving when the spread of ages is measured."""


@dataclass(frozen=True)
class Account:
    """Sums over the field after a cycle.

    Attributes:
        combined: Σ θ_s θ_t, samples per cycle.
        age_spread_s: newest minus oldest sample time shown in elements of fast refresh, seconds; 0 if there are none.
        nonfinite: number of non-finite densities and errors.
    """

    combined: float
    age_spread_s: float
    nonfinite: int


def account(
    densities: Densities, errors: Errors, newest_s: Float64[Tensor, "side side"], config: TsarConfig
) -> Account:
    """Sums and counts over the field after a cycle.

    Args:
        densities, errors: after the response, Morton order.
        newest_s: time of the newest sample shown in each finest tile, seconds, raster order.
        config: configuration of the run.
    """
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
    """The effect of a decision on the elements of the field.

    Attributes:
        elements: number of elements whose densities changed.
        saturated: number of those elements that the decision drove from inside the bounds of a density to one of them.
    """

    elements: int
    saturated: int


def movement(before: Densities, after: Densities, config: TsarConfig) -> Movement:
    """The number of elements that a decision changed, and how many of them it drove to a bound."""
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
