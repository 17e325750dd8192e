"""A controller that may look at the answer: what an allocation could gain at the same cost.

Every cycle it traces, without being charged, a framelet of every tile of every level, compares each with the picture
that will be true when the cycle is displayed, and keeps the ``batch_size`` non-overlapping tiles that lower the error
of the display most. Cache, reconstruction, latency and cost are those of the adaptive pipeline.

It is greedy: a cycle is chosen for its own display, not for those after it. So it bounds from below what could be
gained, and a policy that plans ahead could in principle do better.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator

import torch
import torch.nn.functional as F
from jaxtyping import Float, Int64
from torch import Tensor

from tsar.baselines.scatter import double_width
from tsar.cache import FrameletCache
from tsar.clock import CycleSeconds, checked
from tsar.config import TsarConfig
from tsar.error import replace_nonfinite
from tsar.haar import state_size
from tsar.morton import morton_to_raster, raster_to_morton
from tsar.pipeline import LATENCY_CYCLES
from tsar.reconstruction import reconstruct
from tsar.selection import sample_positions
from tsar.tiling import uniform
from tsar.types import Display, FrameletBatch, Trace

Truth = Callable[[float], Float[Tensor, "h w 3"]]
"""``time_s -> image``: the picture as it should be, linear RGB at output resolution."""

_BISECTIONS = 40


def run(
    config: TsarConfig, trace: Trace, cycle_seconds: CycleSeconds, start_s: float, end_s: float, truth: Truth
) -> Iterator[Display]:
    """Cycles as :func:`tsar.pipeline.run`, chosen by looking at ``truth``; warm-up cycles are yielded too."""
    cache = FrameletCache(config)
    levels = range(config.level_min, config.level_max + 1)
    counters = _counters(config, trace, start_s)
    cycle_s = checked(cycle_seconds, counters, 1.0)
    cycle, time_s = -config.warmup_cycles, start_s - config.warmup_cycles * cycle_s
    while time_s < end_s:
        began = time.perf_counter()
        shown = _shown(reconstruct(cache, config, cycle_s).image)
        wanted = _shown(truth(time_s + LATENCY_CYCLES * cycle_s))
        frames = [_traced(level, config, trace, time_s) for level in levels]
        benefit = [
            _benefit(color, level, shown, wanted, config) for level, (_, color) in zip(levels, frames, strict=True)
        ]
        for (batch, color), index in zip(frames, choose(benefit, config.batch_size), strict=True):
            kept = FrameletBatch(batch.level[index], index, batch.position[index], batch.time_s, cycle)
            cache.insert(kept, color[index], torch.zeros(index.numel(), state_size(config.samples)))
        result = reconstruct(cache, config, cycle_s)
        cycle_s = checked(cycle_seconds, counters, time.perf_counter() - began)
        yield Display(time_s + LATENCY_CYCLES * cycle_s, time_s, result.image, result.samples)
        cycle, time_s = cycle + 1, time_s + cycle_s


def _shown(image: Float[Tensor, "h w 3"]) -> Float[Tensor, "h w 3"]:
    """Linear radiance to a scale on which equal differences look about equal: clipped, power 1 / 2.2."""
    return image.clamp(0.0, 1.0).pow(1.0 / 2.2)


def _counters(config: TsarConfig, trace: Trace, time_s: float) -> dict[str, int]:
    """Rays of a batch's worth of samples spread over the picture: what a ledger that counts is charged for a cycle."""
    level = config.level_max
    count = min(config.batch_size, 4**level)
    index = torch.arange(count) * (4**level // count)
    position = sample_positions(torch.full_like(index, level), index, config.framelet_side)
    return trace(FrameletBatch(torch.full_like(index, level), index, position, time_s)).counters


def _traced(
    level: int, config: TsarConfig, trace: Trace, time_s: float
) -> tuple[FrameletBatch, Float[Tensor, "n samples 3"]]:
    """Every tile of a level at one time, and its colours."""
    tiling = uniform(level)
    position = sample_positions(tiling.level, tiling.index, config.framelet_side)
    batch = FrameletBatch(tiling.level, tiling.index, position, time_s, seed=config.seed)
    return batch, replace_nonfinite(trace(batch).color, config.framelet_side)[0]


def _benefit(
    color: Float[Tensor, "n samples 3"],
    level: int,
    shown: Float[Tensor, "h w 3"],
    wanted: Float[Tensor, "h w 3"],
    config: TsarConfig,
) -> Float[Tensor, " n"]:
    """Squared error that showing each tile of a level would remove, Morton order; negative where it would add some."""
    grid = config.framelet_side << level
    image = color.reshape(-1, 3)[raster_to_morton(grid)].reshape(grid, grid, 3).permute(2, 0, 1)
    if grid > config.resolution_px:
        image = F.avg_pool2d(image[None], grid // config.resolution_px)[0]
    while image.shape[1] < config.resolution_px:
        image = double_width(double_width(image).transpose(1, 2)).transpose(1, 2)
    fresh = _shown(image.permute(1, 2, 0))
    gain = ((shown - wanted).square() - (fresh - wanted).square()).sum(2)
    width = config.resolution_px >> level
    per_tile = F.avg_pool2d(gain[None, None].to(torch.float64), width)[0, 0] * width**2
    return per_tile.reshape(-1)[morton_to_raster(2**level)]


def choose(benefit: list[Float[Tensor, " _"]], count: int) -> list[Int64[Tensor, " _"]]:
    """At most ``count`` disjoint nodes of a quadtree of greatest total benefit.

    Args:
        benefit: per level, coarse to fine, each four times as long as the one before, Morton order.
        count: most nodes to take.

    Returns:
        Indices of the nodes taken, per level.

    With a price on every node the best set is found from the leaves to the root; the price is bisected until the set
    is as large as it may be. Sets between two prices are not found: the set is optimal for its own size.
    """
    low, high = 0.0, max(float(level.max()) for level in benefit) + 1.0
    best = _take(benefit, high)
    if sum(level.numel() for level in _take(benefit, low)) <= count:
        return _take(benefit, low)
    for _ in range(_BISECTIONS):
        price = (low + high) / 2
        taken = _take(benefit, price)
        if sum(level.numel() for level in taken) <= count:
            best, high = taken, price
        else:
            low = price
    return best


def _take(benefit: list[Float[Tensor, " _"]], price: float) -> list[Int64[Tensor, " _"]]:
    worth = torch.zeros_like(benefit[-1]).repeat_interleave(4)
    own: list[Tensor] = []
    for level in reversed(benefit):
        below = worth.reshape(-1, 4).sum(1)
        alone = level - price
        own.append((alone > 0) & (alone >= below))
        worth = torch.where(own[-1], alone, below)
    free = torch.ones_like(own[-1])
    taken = []
    for mask in reversed(own):
        taken.append((mask & free).nonzero().squeeze(1))
        free = (free & ~mask).repeat_interleave(4)
    return taken
