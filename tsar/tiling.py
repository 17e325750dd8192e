"""Construction of a non-overlapping tiling from a density field.

Source: Stephens 2011, sec. 4.1.6.

Deviation: the thesis walks intervals of the curve with a token stack per thread and restarts the kernel until the
tiling is full. Here every node of the quadtree decides at once: a node splits when the samples requested within it
exceed the threshold. A parent's integral is never below its child's, so the split nodes are closed under ancestors and
the tiling is the set of nodes that do not split under a parent that does. A bound on the number of tiles is then a
bound on the number of splits, met by raising the threshold to the right order statistic: no stack, no restart, no loop
over tiles.
"""

from __future__ import annotations

from functools import lru_cache

import torch
from jaxtyping import Float, Int64
from torch import Tensor

from tsar.config import TsarConfig, tiles_at_least, tiles_at_most
from tsar.morton import tile_interval
from tsar.types import Tiling


def uniform(level: int) -> Tiling:
    """All ``4^level`` tiles of one level."""
    index = torch.arange(4**level)
    return Tiling(level=torch.full_like(index, level), index=index)


def build(spatial_density: Float[Tensor, " e"], config: TsarConfig) -> Tiling:
    """A tiling whose tiles hold about ``threshold_samples`` of the requested samples each.

    Args:
        spatial_density: θ_s, samples per element, Morton order, non-negative and finite.
        config: level bounds, threshold and the least and greatest number of tiles.

    Returns:
        Between ``batch_size`` and ``tile_count_max`` tiles in Morton order, covering the image exactly once.

    Raises:
        ValueError: the field holds negative or non-finite values.
    """
    require_densities(spatial_density, "tiling.build")
    low, high = config.level_min, config.level_max
    integrals = node_integrals(spatial_density, config.field_level, low, high)
    split = _choose_splits(torch.cat(integrals[:-1]), integrals, config) if high > low else []
    levels, indices = [], []
    exists = torch.ones(4**low, dtype=torch.bool)
    for level in range(low, high + 1):
        leaf = exists & ~split[level - low] if level < high else exists
        index = leaf.nonzero().squeeze(1)
        levels.append(torch.full_like(index, level))
        indices.append(index)
        if level < high:
            exists = (exists & split[level - low]).repeat_interleave(4)
    level, index = torch.cat(levels), torch.cat(indices)
    order = torch.argsort(tile_interval(level, index, config.field_level)[0])
    return Tiling(level=level[order], index=index[order])


def require_densities(field: Float[Tensor, " e"], where: str) -> None:
    """Rejects a field that holds negative or non-finite values.

    Raises:
        ValueError: the field holds such values.
    """
    if not bool(torch.isfinite(field).all()) or bool((field < 0).any()):
        raise ValueError(f"{where}: expected finite, non-negative densities")


def node_integrals(
    field: Float[Tensor, " e"], field_level: int, level_low: int, level_high: int
) -> list[Float[Tensor, " nodes"]]:
    """Sums of the field over every quadtree node, for levels ``level_low`` to ``level_high``, in float64.

    Each sum is that of its four children: unlike a difference of prefix sums, a parent can then never be less than its
    child through rounding, whatever the range of the field.
    """
    sums = [field.to(torch.float64)]
    for _ in range(field_level - level_low):
        sums.append(sums[-1].reshape(-1, 4).sum(1))
    sums.reverse()
    return sums[: level_high - level_low + 1]


def split_bounds(config: TsarConfig) -> tuple[int, int]:
    """Least and greatest number of splits: enough tiles for a batch, no more than ``tile_count_max``."""
    coarse = 4**config.level_min
    bounds = tiles_at_least(config.batch_size, config.level_min), tiles_at_most(config.tile_count_max, config.level_min)
    least, most = ((count - coarse) // 3 for count in bounds)
    return least, most


def _choose_splits(candidates: Float[Tensor, " nodes"], integrals: list[Tensor], config: TsarConfig) -> list[Tensor]:
    """The nodes that split, one boolean tensor for each level above the finest."""
    least, most = split_bounds(config)
    wanted = int((candidates > config.threshold_samples).sum())
    count = min(max(wanted, least), most, candidates.numel())
    ranks = tie_order(config.level_min, config.level_max)
    order = ranks[torch.sort(candidates[ranks], descending=True, stable=True).indices]
    chosen = torch.zeros(candidates.numel(), dtype=torch.bool)
    chosen[order[:count]] = True
    return list(chosen.split([level.numel() for level in integrals[:-1]]))


@lru_cache(maxsize=16)
def tie_order(level_low: int, level_high: int) -> Int64[Tensor, " nodes"]:
    """Order in which equal nodes split: by level, coarse before fine, and within a level by bit-reversed index.

    A parent then comes before its child. Where the bound on the tiles lets only some of many equal nodes split, these
    are spread over the whole image; in the order of their indices they would fill it from one corner.
    """
    order, first = [], 0
    for level in range(level_low, level_high):
        index = torch.arange(4**level)
        reverse = torch.zeros_like(index)
        for bit in range(2 * level):
            reverse |= ((index >> bit) & 1) << (2 * level - 1 - bit)
        order.append(first + torch.argsort(reverse))
        first += 4**level
    return torch.cat(order)


def tile_of_element(tiling: Tiling, field_level: int) -> Int64[Tensor, " e"]:
    """For each field element, the tile that covers it; the tiling must be in Morton order and cover everything."""
    first, last = tile_interval(tiling.level, tiling.index, field_level)
    return torch.repeat_interleave(torch.arange(tiling.tile_count), last - first)
