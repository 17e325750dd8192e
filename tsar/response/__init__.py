"""The adaptive response: local constraints, density transport, mixture.

Source: Stephens 2011, chapter 6.
"""

from __future__ import annotations

from dataclasses import replace

import torch

from tsar.choices import SOLVERS
from tsar.config import TsarConfig
from tsar.morton import total
from tsar.response.local import Box, constrain
from tsar.response.mixture import mix
from tsar.types import Densities, Errors


def respond(densities: Densities, errors: Errors, config: TsarConfig) -> Densities:
    """One control decision over the whole field.

    The surplus takes the density that the decision freed or used, computed from the new densities: the sum of combined
    density and surplus stays equal to the budget up to rounding.
    """
    spatial_low, spatial_high = config.spatial_bounds
    temporal_low, temporal_high = config.temporal_bounds
    box = Box(spatial_low / spatial_high, temporal_low / temporal_high)
    unit = spatial_high * temporal_high
    local = constrain(
        densities.spatial / spatial_high, densities.temporal / temporal_high, errors, box, config.response.gain
    )
    surplus_max = config.response.surplus_max * config.budget / unit
    solve = SOLVERS[config.response.solver]
    change = solve(local.desired_change, local.max_change, densities.surplus / unit, surplus_max)
    b_s, b_t = mix(local, change, box, config.response.bias)
    # Elements without an error keep their exact bits: dividing by the maximum and multiplying again would not.
    after = replace(
        densities,
        spatial=torch.where(local.active, b_s * spatial_high, densities.spatial),
        temporal=torch.where(local.active, b_t * temporal_high, densities.temporal),
    )
    freed = total(densities.combined() - after.combined())
    return replace(after, surplus=max(densities.surplus + freed, 0.0))


def initial_densities(config: TsarConfig) -> Densities:
    """A uniform field that spends the whole budget: as many equal tiles as the tiling may hold, all with the same
    refresh rate."""
    elements = config.sdf_side**2
    low, high = config.spatial_bounds
    spatial = min(max(config.tile_count_max * config.samples / elements, low), high)
    temporal = min(max(config.budget / (spatial * elements), config.temporal_bounds[0]), 1.0)
    spatial = config.budget / (temporal * elements)
    field = torch.full((elements,), spatial, dtype=torch.float64)
    return Densities(field, torch.full_like(field, temporal), surplus=0.0)
