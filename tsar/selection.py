"""Selection of the tiles to render next, and the positions of their samples.

Source: Stephens 2011, sec. 3.4.4.1.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import torch
from jaxtyping import Float, Float64, Int64
from torch import Tensor

from tsar.config import TsarConfig
from tsar.morton import deinterleave, tile_mean
from tsar.tiling import require_densities, tile_of_element
from tsar.types import FrameletBatch, Tiling


@dataclass(frozen=True)
class Request:
    """The tiles to render next.

    Attributes:
        selected: indices of the tiles in the tiling.
        history: remaining credit of the field's elements.
        level, index, position: as in :class:`tsar.types.FrameletBatch`.
    """

    selected: Int64[Tensor, " b"]
    history: Float64[Tensor, " e"]
    level: Int64[Tensor, " b"]
    index: Int64[Tensor, " b"]
    position: Float[Tensor, "b samples 2"]

    def at(self, time_s: float, cycle: int, config: TsarConfig) -> FrameletBatch:
        """The batch for the renderer: all its samples have one animation time."""
        return FrameletBatch(self.level, self.index, self.position, time_s, cycle=cycle, seed=config.seed)


def initial_history(config: TsarConfig) -> Float64[Tensor, " e"]:
    """Credit of every element before the first cycle: a seeded permutation in [0, 1), so that the order in which tiles
    of equal temporal density fall due depends on the seed alone."""
    generator = torch.Generator().manual_seed(config.seed)
    count = config.sdf_side**2
    return torch.randperm(count, generator=generator).to(torch.float64) / count


def select(
    tiling: Tiling, temporal_density: Float64[Tensor, " e"], history: Float64[Tensor, " e"], config: TsarConfig
) -> tuple[Int64[Tensor, " b"], Float64[Tensor, " e"]]:
    """The ``batch_size`` most overdue tiles.

    Each element accumulates its temporal density as credit every cycle. The priority of a tile is the mean credit of
    its elements, and rendering it subtracts one refresh; the remaining credit is clamped to [-1, 1]. Credit belongs to
    the field, so it survives re-tiling. Fractional rates are then met on average. Where more or fewer tiles fall due
    than a batch holds, all rates shrink or grow in proportion. Every density is positive, so every tile is rendered
    eventually.

    Returns:
        Indices into the tiling in Morton order, and the history for the next cycle. Ties go to the earlier tile.

    Raises:
        ValueError: the field holds negative or non-finite values, or the tiling has fewer tiles than a batch.
    """
    require_densities(temporal_density, "selection.select")
    require_full(tiling.tile_count, config.batch_size)
    credit = history + temporal_density
    overdue = tile_mean(credit, tiling.level, tiling.index, config.field_level)
    order = torch.sort(overdue, descending=True, stable=True).indices
    selected = torch.sort(order[: config.batch_size]).values
    left = torch.full_like(overdue, torch.nan)
    left[selected] = (overdue[selected] - 1.0).clamp(-1.0, 1.0)
    left = left[tile_of_element(tiling, config.field_level)]
    return selected, torch.where(torch.isnan(left), credit, left)


def require_full(tile_count: int, batch_size: int) -> None:
    """Rejects a tiling that cannot fill a batch.

    Raises:
        ValueError: the tiling has fewer tiles than a batch.
    """
    if tile_count < batch_size:
        raise ValueError(f"selection: expected at least {batch_size} tiles, a full batch, got {tile_count}")


@lru_cache(maxsize=8)
def cell_centres(side: int) -> Float[Tensor, "samples 2"]:
    """Sample offsets within a tile, in tile widths, Morton order."""
    x, y = deinterleave(torch.arange(side * side))
    return (torch.stack((x, y), dim=1).to(torch.float32) + 0.5) / side


def sample_positions(level: Int64[Tensor, " n"], index: Int64[Tensor, " n"], side: int) -> Float[Tensor, "n samples 2"]:
    """Positions of each tile's samples on the image plane, in ``[0, 1)``: the centres of a regular grid, fixed for each
    tile, so that a static picture gives identical samples and no temporal error.

    Every coordinate is a multiple of ``1 / 65536`` and exact in float32. Source: Stephens 2011, sec. 3.4.4.2.
    """
    corner = torch.stack(deinterleave(index), dim=1).to(torch.float32)
    width = torch.exp2(-level.to(torch.float32))
    return (corner[:, None, :] + cell_centres(side)) * width[:, None, None]


def request(
    tiling: Tiling, temporal_density: Float64[Tensor, " e"], history: Float64[Tensor, " e"], config: TsarConfig
) -> Request:
    """The most overdue tiles by :func:`select`, and the positions of their samples."""
    selected, credit = select(tiling, temporal_density, history, config)
    level, index = tiling.level[selected], tiling.index[selected]
    return Request(selected, credit, level, index, sample_positions(level, index, config.framelet_side))
