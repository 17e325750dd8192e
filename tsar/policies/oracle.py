"""An oracle controller, which knows the true picture: a bound on what allocation could gain at the same cost.

Every cycle it traces a framelet of every tile of every level without being charged, compares each with the true picture
at the time of display, and keeps the ``batch_size`` non-overlapping tiles that lower the error of the display most.
Cache, reconstruction, latency and cost are those of the adaptive pipeline.

It is greedy: a cycle is optimised for its own display, not for later ones. So its gain is a lower bound, and a policy
that plans ahead could in principle do better.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import torch
import torch.nn.functional as F
from jaxtyping import Float, Int64
from torch import Tensor

from tsar.cache import FrameletCache
from tsar.clock import StageTimer
from tsar.config import TsarConfig
from tsar.error import replace_nonfinite
from tsar.estimators import state_size
from tsar.morton import morton_to_raster, raster_to_morton
from tsar.policies.resampling import double_width
from tsar.policies.thesis import Thesis
from tsar.policy import Moment, Picture, Policy, Setting, require_square
from tsar.reconstruction import reconstruct
from tsar.selection import sample_positions
from tsar.tiling import uniform
from tsar.types import FrameletBatch, SampleBatch, Trace

_BISECTIONS = 40


@dataclass(frozen=True)
class Foresight:
    """The cache, which changes in place, and whether the requested batch is useful."""

    cache: FrameletCache
    useful: bool = True


class Oracle(Policy[Foresight]):
    """The adaptive pipeline's cache, display, latency and cost under a controller that knows the truth."""

    latency_cycles = Thesis.latency_cycles

    def __init__(self, setting: Setting) -> None:
        """Sets the truth and the renderer that is not charged.

        Raises:
            ValueError: the setting has no truth or no such renderer.
        """
        super().__init__(setting)
        require_square(self.config, "oracle")
        if setting.truth is None or setting.trace is None:
            raise ValueError("oracle: expected a setting with the truth and a renderer that is not charged, got none")
        self._truth, self._trace = setting.truth, setting.trace

    @property
    def warmup_cycles(self) -> int:
        """At most 16, because its first cycles already sample where the error is."""
        return min(16, self.config.warmup_cycles)

    def probe(self, trace: Trace, time_s: float) -> tuple[Mapping[str, int], float]:
        """Cost of a batch of samples spread over the picture; the truth is not used."""
        return trace(self._spread(self.config.batch_size, Moment(time_s, 0, 1.0))).counters, 1.0

    def start(self) -> Foresight:
        return Foresight(FrameletCache(self.config))

    def request(self, state: Foresight, moment: Moment) -> tuple[Foresight, FrameletBatch]:
        """The disjoint tiles that lower the error of the display most."""
        config = self.config
        shown = _shown(reconstruct(state.cache, config, moment.cycle_s).image)
        wanted = _shown(self._truth(moment.time_s + self.latency_cycles * moment.cycle_s))
        levels = range(config.level_min, config.level_max + 1)
        benefit = [_benefit(self._traced(level, moment), level, shown, wanted, config) for level in levels]
        index = choose(benefit, config.batch_size)
        level = torch.cat([torch.full_like(found, of) for of, found in zip(levels, index, strict=True)])
        if level.numel() == 0:
            return Foresight(state.cache, useful=False), self._spread(1, moment)
        return Foresight(state.cache), self._batch(level, torch.cat(index), moment)

    def observe(
        self, state: Foresight, batch: FrameletBatch, samples: SampleBatch, moment: Moment, timer: StageTimer
    ) -> Foresight:
        if not state.useful:
            return state
        color = replace_nonfinite(samples.color, self.config.framelet_side)[0]
        with timer("cache"):
            for level in range(self.config.level_min, self.config.level_max + 1):
                at = (batch.level == level).nonzero().squeeze(1)
                part = FrameletBatch(batch.level[at], batch.index[at], batch.position[at], batch.time_s, moment.cycle)
                state.cache.insert(
                    part, color[at], torch.zeros(at.numel(), state_size(self.config.samples, self.config.error))
                )
        return state

    def image(self, state: Foresight, moment: Moment) -> Picture:
        made = reconstruct(state.cache, self.config, moment.cycle_s)
        return Picture(made.image, made.sample_map, made.counters)

    def _spread(self, count: int, moment: Moment) -> FrameletBatch:
        """At most ``count`` tiles of the finest level, evenly spread."""
        level = self.config.level_max
        count = min(count, 4**level)
        index = torch.arange(count) * (4**level // count)
        return self._batch(torch.full_like(index, level), index, moment)

    def _batch(self, level: Int64[Tensor, " n"], index: Int64[Tensor, " n"], moment: Moment) -> FrameletBatch:
        position = sample_positions(level, index, self.config.framelet_side)
        return FrameletBatch(level, index, position, moment.time_s, cycle=moment.cycle, seed=self.config.seed)

    def _traced(self, level: int, moment: Moment) -> Float[Tensor, "n samples 3"]:
        """Colours of every tile of a level at one time."""
        tiling = uniform(level)
        batch = self._batch(tiling.level, tiling.index, moment)
        return replace_nonfinite(self._trace(batch).color, self.config.framelet_side)[0]


def _shown(image: Float[Tensor, "h w 3"]) -> Float[Tensor, "h w 3"]:
    """Linear radiance on a scale on which equal differences look about equal: ``clip(c, 0, 1)^(1 / 2.2)``."""
    return image.clamp(0.0, 1.0).pow(1.0 / 2.2)


def _benefit(
    color: Float[Tensor, "n samples 3"],
    level: int,
    shown: Float[Tensor, "h w 3"],
    wanted: Float[Tensor, "h w 3"],
    config: TsarConfig,
) -> Float[Tensor, " n"]:
    """Squared error that showing each tile of a level would remove, Morton order; negative where it would add error."""
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
    """At most ``count`` disjoint nodes of a quadtree with the greatest total benefit.

    Args:
        benefit: per level, coarse to fine, each four times as long as the one before, Morton order.
        count: maximum number of nodes to take.

    Returns:
        Indices of the nodes taken, per level.

    With a price on every node the best set is found from the leaves to the root. The price is bisected until the set is
    as large as allowed. Sets between two prices are not found: the set is optimal for its own size.
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
