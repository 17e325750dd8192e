"""From cached framelets of many ages and sizes to an image.

Source: Stephens 2011, sec. 4.2.

Deviation: framelets finer than the pixel grid are box-filtered to pixels before they are accumulated (a bilinear kernel
as narrow as their sample spacing would skip samples); the age field is taken over each tile's own extent, not the
extent enlarged by half a sample, so that across a border the older neighbour still passes and the two blend.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import kornia
import torch
import torch.nn.functional as F
from jaxtyping import Float, Int64
from torch import Tensor

from tsar.cache import FrameletCache
from tsar.config import TsarConfig
from tsar.morton import deinterleave, raster_to_morton

_SHIFT_CYCLES = 0.5


@dataclass(frozen=True)
class Reconstruction:
    """Result of one reconstruction.

    Attributes:
        image: ``(resolution, resolution, 3)`` float32 linear RGB, finite everywhere.
        newest_s: animation time of the newest sample over each tile of the finest level, raster order; ``-inf`` where
            nothing has been sampled yet.
        overdraw: framelets that were accumulated, in units of the image area.
    """

    image: Float[Tensor, "h w 3"]
    newest_s: Float[Tensor, "side side"]
    overdraw: float


def reconstruct(cache: FrameletCache, config: TsarConfig, cycle_s: float) -> Reconstruction:
    """Accumulate every cached sample that is not older than the smoothed age field.

    Marks the framelets that did not pass anywhere as dead in the cache.

    Args:
        cache: framelets; changed in place only by its ``dead`` flags.
        config: resolution and smoothing width.
        cycle_s: length of a cycle, the unit of the temporal weight, seconds.

    Returns:
        The image. The same cache gives the same bits.
    """
    newest = newest_times(cache, config)
    reference = newest[torch.isfinite(newest)].max() if bool(torch.isfinite(newest).any()) else newest.new_zeros(())
    # Relative to the newest sample, in cycles: small numbers that float32 holds well.
    age = ((newest - reference) / cycle_s).clamp(min=-1e6).to(torch.float32)
    threshold = smooth_age(_to_pixels(age, config.resolution_px), config.reconstruction.age_support_px)
    total = _Accumulator(config, threshold, cache, ((cache.time_s - reference) / cycle_s).to(torch.float32))
    for level in range(config.level_min, config.level_max + 1):
        total.add_level(level)
    image = total.normalised()
    return Reconstruction(image, newest, total.pairs / config.resolution_px**2)


def newest_times(cache: FrameletCache, config: TsarConfig) -> Float[Tensor, "side side"]:
    """Newest timestamp over each tile of the finest level, raster order."""
    newest = torch.full((4**config.level_min,), -torch.inf, dtype=torch.float64)
    for level in range(config.level_min, config.level_max + 1):
        slot = (cache.level == level).nonzero().squeeze(1)
        newest = newest.scatter_reduce(0, cache.index[slot], cache.time_s[slot], "amax")
        if level < config.level_max:
            newest = newest.repeat_interleave(4)
    side = 2**config.level_max
    return newest[raster_to_morton(side)].reshape(side, side)


def _to_pixels(grid: Float[Tensor, "side side"], resolution: int) -> Float[Tensor, "h w"]:
    repeat = resolution // grid.shape[0]
    return grid.repeat_interleave(repeat, 0).repeat_interleave(repeat, 1)


def smooth_age(newest: Float[Tensor, "h w"], support_px: int) -> Float[Tensor, "h w"]:
    """One-sided smoothing: the field may only become older, never newer (sec. 4.2.3, fig. 4.6)."""
    if support_px == 1:
        return newest
    blurred = kornia.filters.box_blur(newest[None, None], (support_px, support_px), "replicate", separable=True)
    return torch.minimum(newest, blurred[0, 0])


@lru_cache(maxsize=32)
def spatial_weights(side: int, width_px: int) -> tuple[Float[Tensor, "p side"], int]:
    """Weights of a tile's samples at output pixels along one axis, and the pixels of margin on either side.

    Bilinear about each sample where samples are at least a pixel apart, reaching half a sample spacing beyond the tile;
    the pixel's box where they are closer. Rows sum to one inside the tile and to less in the margin.
    """
    spacing = width_px / side
    margin = max(0, int(torch.tensor(spacing / 2 + 0.5).ceil()) - 1)
    pixel = torch.arange(-margin, width_px + margin, dtype=torch.float64) + 0.5
    sample = (torch.arange(side, dtype=torch.float64) + 0.5) * spacing
    distance = (pixel[:, None] - sample[None, :]).abs()
    if spacing >= 1.0:
        weight = (1.0 - distance / spacing).clamp(min=0.0)
        # Edge pixels have one neighbour only: the tile's own sample stands for the missing one outside the overlap.
    else:
        weight = (distance < 0.5).to(torch.float64) * spacing
    return weight.to(torch.float32), margin


class _Accumulator:
    """Colour and weight sums over the output image, with a margin around it that is cut off at the end."""

    def __init__(self, config: TsarConfig, threshold: Tensor, cache: FrameletCache, time: Tensor) -> None:
        self.config, self.cache, self.time = config, cache, time
        self.margin = spatial_weights(config.framelet_side, config.resolution_px >> config.level_min)[1]
        self.stride = config.resolution_px + 2 * self.margin
        self.threshold = F.pad(threshold[None], (self.margin,) * 4, mode="replicate")[0]
        self.sums = [torch.zeros(self.stride**2) for _ in range(4)]
        self.pairs = 0

    def add_level(self, level: int) -> None:
        """Splat all framelets of one level that are not older than the age field everywhere."""
        cache, side, width = self.cache, self.config.framelet_side, self.config.resolution_px >> level
        slot = (cache.level == level).nonzero().squeeze(1)
        if slot.numel() == 0:
            return
        weights, margin = spatial_weights(side, width)
        # Least threshold over each tile with its margin decides whether a framelet can contribute at all.
        inset = self.margin - margin
        field = self.threshold[inset : self.stride - inset, inset : self.stride - inset]
        least = -F.max_pool2d(-field[None, None], width + 2 * margin, stride=width)[0, 0]
        x, y = deinterleave(cache.index[slot])
        passes = self.time[slot] >= least[y, x]
        cache.dead[slot[~passes]] = True
        slot, x, y = slot[passes], x[passes], y[passes]
        corner = (y * width + inset) * self.stride + x * width + inset
        pixel = corner[:, None] + _block_offsets(weights.shape[0], self.stride)
        weight = self._temporal_weight(slot, pixel) * (weights.sum(1)[:, None] * weights.sum(1)[None, :]).reshape(-1)
        samples = cache.color[slot][:, raster_to_morton(side)].transpose(1, 2).reshape(-1, 3, side, side)
        # Rows of the margin sum to less than one; the colour there is the weighted mean of the samples in reach.
        unit = weights / weights.sum(1, keepdim=True).clamp(min=1e-12)
        color = (unit @ samples @ unit.T).flatten(2)
        flat = pixel.reshape(-1)
        for channel in range(3):
            self.sums[channel].index_add_(0, flat, (color[:, channel] * weight).reshape(-1))
        self.sums[3].index_add_(0, flat, weight.reshape(-1))
        self.pairs += flat.numel()

    def _temporal_weight(self, slot: Int64[Tensor, " n"], pixel: Int64[Tensor, "n p"]) -> Float[Tensor, "n p"]:
        """Cycles by which a framelet is newer than the age field, plus half a cycle; 0 where it is older."""
        newer = self.time[slot][:, None] - self.threshold.reshape(-1)[pixel]
        return torch.where(newer >= 0, newer + _SHIFT_CYCLES, 0.0)

    def normalised(self) -> Float[Tensor, "h w 3"]:
        """Divide by the weight; where nothing passed, fill from the surroundings."""
        stacked = torch.stack(self.sums).reshape(4, self.stride, self.stride)
        inner = slice(self.margin, self.margin + self.config.resolution_px)
        stacked = stacked[:, inner, inner]
        hole = stacked[3] <= 0
        if bool(hole.any()):
            stacked = torch.where(hole, _fill_from_coarser(stacked), stacked)
        return (stacked[:3] / stacked[3]).permute(1, 2, 0).contiguous()


@lru_cache(maxsize=32)
def _block_offsets(width: int, stride: int) -> Int64[Tensor, " p"]:
    step = torch.arange(width)
    return (step[:, None] * stride + step[None, :]).reshape(-1)


def _fill_from_coarser(sums: Float[Tensor, "4 h w"]) -> Float[Tensor, "4 h w"]:
    """Sums for holes from the nearest coarser level of an image pyramid that has any weight; black if none has."""
    if sums.shape[1] == 1:
        return torch.where(sums[3:] > 0, sums, torch.tensor([0.0, 0.0, 0.0, 1.0]).reshape(4, 1, 1))
    coarse = F.avg_pool2d(sums[None], 2)[0]
    filled = torch.where(coarse[3:] > 0, coarse, _fill_from_coarser(coarse))
    return filled.repeat_interleave(2, 1).repeat_interleave(2, 2)
