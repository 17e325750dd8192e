"""Reconstruction of an image from cached framelets of many ages and sizes.

Source: Stephens 2011, sec. 4.2.

Deviation: framelets finer than the pixel grid are box-filtered to pixels before they are accumulated (a bilinear kernel
as narrow as their sample spacing would skip samples); the age field of a tile covers its own extent, not that enlarged
by half a sample, so that across a border the older neighbour still passes and the two blend.

Deviation: the ages are smoothed over 9 pixels by default. Table 7.1 has 128, which makes nearly every pixel as old as
the oldest tile around it and so blends moving objects with outdated framelets.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import torch
import torch.nn.functional as F
from jaxtyping import Float, Int64
from torch import Tensor

from tsar.cache import FrameletCache
from tsar.choices import RECONSTRUCTIONS
from tsar.config import TsarConfig
from tsar.morton import deinterleave, morton_to_raster, raster_to_morton
from tsar.types import SampleMap

SHIFT_CYCLES = 0.5
"""Offset in cycles: the temporal weight of a framelet is this plus the cycles by which it is newer than the age
field."""
AGE_STEPS = 2.0**16
"""Steps per cycle to which ages are rounded before they are smoothed."""
AGE_MOST = 1.0e6
"""Greatest age, cycles."""


@dataclass(frozen=True)
class Reconstruction:
    """Result of one reconstruction.

    Attributes:
        image: ``(resolution, resolution, 3)`` float32 linear RGB, finite everywhere.
        sample_map: age and density of the newest samples over each tile of the finest level.
        overdraw: total area of the accumulated framelets, in units of the image area.
    """

    image: Float[Tensor, "h w 3"]
    sample_map: SampleMap
    overdraw: float

    @property
    def counters(self) -> dict[str, int]:
        """Counts of the work done, by name."""
        return {"framelet_pixels": round(self.overdraw * self.image.shape[0] * self.image.shape[1])}


def reconstruct(cache: FrameletCache, config: TsarConfig, cycle_s: float) -> Reconstruction:
    """Reconstructs the image of a cache by the method of the configuration; arguments are those of :func:`blend`."""
    return RECONSTRUCTIONS[config.reconstruction.method](cache, config, cycle_s)


def blend(cache: FrameletCache, config: TsarConfig, cycle_s: float) -> Reconstruction:
    """Accumulates every cached sample that is not older than the smoothed age field.

    Framelets that are older everywhere are marked as dead in the cache.

    Args:
        cache: cached framelets; only its ``dead`` flags are changed, in place.
        config: resolution and smoothing width.
        cycle_s: length of a cycle, the unit of the temporal weight, seconds.

    Returns:
        The image, with the same bits for the same cache.
    """
    sample_map = newest_samples(cache, config)
    newest = sample_map.newest_s
    reference = newest[torch.isfinite(newest)].max() if bool(torch.isfinite(newest).any()) else newest.new_zeros(())
    # Relative to the newest sample, in cycles: small numbers that float32 holds well.
    age = ((newest - reference) / cycle_s).clamp(min=-AGE_MOST).to(torch.float32)
    threshold = smooth_age(age, config.resolution_px, config.reconstruction.age_support_px)
    total = _Accumulator(config, threshold, cache, ((cache.time_s - reference) / cycle_s).to(torch.float32))
    for level in range(config.level_min, config.level_max + 1):
        total.add_level(level)
    image = total.normalised()
    return Reconstruction(image, sample_map, total.pairs / config.resolution_px**2)


def newest_samples(cache: FrameletCache, config: TsarConfig) -> SampleMap:
    """Newest sample time over each tile of the finest level, and the level of its framelet; of two equally new ones the
    finer level."""
    newest = torch.full((4**config.level_min,), -torch.inf, dtype=torch.float64)
    source = torch.full((4**config.level_min,), config.level_min)
    for level in range(config.level_min, config.level_max + 1):
        slot = (cache.level == level).nonzero().squeeze(1)
        here = torch.full_like(newest, -torch.inf).scatter_reduce(0, cache.index[slot], cache.time_s[slot], "amax")
        source = torch.where((here >= newest) & torch.isfinite(here), level, source)
        newest = torch.maximum(newest, here)
        if level < config.level_max:
            newest, source = newest.repeat_interleave(4), source.repeat_interleave(4)
    side = 2**config.level_max
    order = raster_to_morton(side)
    return SampleMap(newest[order].reshape(side, side), source[order].reshape(side, side))


def smooth_age(newest: Float[Tensor, "side side"], resolution: int, support_px: int) -> Float[Tensor, "h w"]:
    """The age field at output pixels after one-sided smoothing: it may only become older, never newer.

    A box filter of ``support_px`` over pixels, borders repeated. The field is constant over each finest tile, so the
    filter is a product with one small matrix on either side. It sums integers, pixels times units of ``1 / 65536``
    cycle, which float64 holds exactly; so the order of the additions, which depends on the number of threads, has no
    effect.

    Source: Stephens 2011, sec. 4.2.3 and fig. 4.6.
    """
    repeat = resolution // newest.shape[0]
    pixels = newest.repeat_interleave(repeat, 0).repeat_interleave(repeat, 1)
    if support_px == 1:
        return pixels
    box = _box_matrix(resolution, newest.shape[0], support_px)
    steps = (newest.to(torch.float64) * AGE_STEPS).round()
    return torch.minimum(pixels, (box @ steps @ box.T).to(torch.float32) / (AGE_STEPS * support_px**2))


@lru_cache(maxsize=8)
def _box_matrix(resolution: int, side: int, support_px: int) -> Float[Tensor, "h side"]:
    """Number of pixels of each of ``side`` cells within the box around each pixel along one axis, float64."""
    half = support_px // 2
    reach = torch.arange(resolution)[:, None] + torch.arange(-half, half + 1)
    cell = reach.clamp(0, resolution - 1) // (resolution // side)
    return F.one_hot(cell, side).sum(1).to(torch.float64)


@lru_cache(maxsize=32)
def spatial_weights(side: int, width_px: int) -> tuple[Float[Tensor, "p side"], int]:
    """Weights of a tile's samples at output pixels along one axis, and the width of the margin on either side, pixels.

    The weights are bilinear about each sample and reach half a sample spacing beyond the tile. Rows at the edge hold
    only their share of the interpolation; the neighbouring tile, whose margin covers them, adds the rest. Valid for
    tiles whose samples are at least a pixel apart.
    """
    spacing = width_px / side
    margin = max(0, int(torch.tensor(spacing / 2 + 0.5).ceil()) - 1)
    pixel = torch.arange(-margin, width_px + margin, dtype=torch.float64) + 0.5
    sample = (torch.arange(side, dtype=torch.float64) + 0.5) * spacing
    distance = (pixel[:, None] - sample[None, :]).abs()
    weight = (1.0 - distance / spacing).clamp(min=0.0)
    return weight.to(torch.float32), margin


def round_bits(value: Float[Tensor, "*n"], bits: int) -> Float[Tensor, "*n"]:
    """Float32 values rounded to ``bits`` significant bits.

    The product of such a value with a bilinear weight, a multiple of ``1 / (2 spacing)``, is exact, and the sum of the
    two products at a pixel is rounded once, in any order, fused or not. So a matrix product that interpolates gives the
    same bits for any number of threads, which libraries do not guarantee otherwise.
    """
    dropped = 24 - bits
    return ((value.view(torch.int32) + (1 << dropped - 1)) & -(1 << dropped)).view(torch.float32)


class _Accumulator:
    """Sums of weighted colour and weight over the output image.

    It has two layouts, which are added at the end. Tiles whose samples are at most a pixel apart cover only their own
    pixels, so they accumulate in Morton order, where a tile is contiguous and no sample is moved. Coarser tiles overlap
    their neighbours by half a sample and accumulate in raster order, with a margin around the image.
    """

    def __init__(
        self, config: TsarConfig, threshold: Float[Tensor, "h w"], cache: FrameletCache, time: Float[Tensor, " slots"]
    ) -> None:
        self.config, self.cache, self.time = config, cache, time
        resolution = config.resolution_px
        self.margin = spatial_weights(config.framelet_side, resolution >> config.level_min)[1]
        self.stride = resolution + 2 * self.margin
        self.threshold = F.pad(threshold[None], (self.margin,) * 4, mode="replicate")[0]
        self.threshold_morton = threshold.reshape(-1).index_select(0, morton_to_raster(resolution))
        self.coarse = [torch.zeros(self.stride**2) for _ in range(4)]
        self.fine = torch.zeros(resolution**2, 4)
        self.pairs = 0

    def add_level(self, level: int) -> None:
        """Splats all framelets of one level that are not older than the age field everywhere."""
        width = self.config.resolution_px >> level
        slot = (self.cache.level == level).nonzero().squeeze(1)
        if slot.numel() == 0:
            return
        add = self._add_fine if width <= self.config.framelet_side else self._add_coarse
        add(level, width, slot)

    def _passing(self, slot: Int64[Tensor, " n"], least: Float[Tensor, " n"]) -> Int64[Tensor, " m"]:
        """Slots not older than the least threshold in their extent; the others are marked dead."""
        passes = self.time[slot] >= least
        self.cache.dead[slot[~passes]] = True
        return slot[passes]

    def _add_fine(self, level: int, width: int, slot: Int64[Tensor, " n"]) -> None:
        threshold = self.threshold_morton.reshape(-1, width**2)
        slot = self._passing(slot, threshold.amin(1)[self.cache.index[slot]])
        tile = self.cache.index[slot]
        weight = self._temporal_weight(slot, threshold.index_select(0, tile))
        # Each pixel of a tile is a run of its samples, as both are in Morton order.
        per_pixel = self.config.samples // width**2
        color = self.cache.color.index_select(0, slot)
        color = color if per_pixel == 1 else color.unflatten(1, (width**2, per_pixel)).mean(2)
        value = torch.cat((color * weight[..., None], weight[..., None]), dim=2)
        self.fine.reshape(-1, width**2 * 4).index_add_(0, tile, value.flatten(1))
        self.pairs += weight.numel()

    def _add_coarse(self, level: int, width: int, slot: Int64[Tensor, " n"]) -> None:
        side = self.config.framelet_side
        weights, margin = spatial_weights(side, width)
        # The least threshold over a tile and its margin decides whether a framelet can contribute at all.
        inset = self.margin - margin
        field = self.threshold[inset : self.stride - inset, inset : self.stride - inset]
        least = -F.max_pool2d(-field[None, None], width + 2 * margin, stride=width)[0, 0]
        x, y = deinterleave(self.cache.index[slot])
        slot = self._passing(slot, least[y, x])
        x, y = deinterleave(self.cache.index[slot])
        corner = (y * width + inset) * self.stride + x * width + inset
        pixel = corner[:, None] + _block_offsets(weights.shape[0], self.stride)
        threshold = self.threshold.reshape(-1).index_select(0, pixel.reshape(-1)).reshape(pixel.shape)
        weight = self._temporal_weight(slot, threshold)
        weight = weight * (weights.sum(1)[:, None] * weights.sum(1)[None, :]).reshape(-1)
        planes = self.cache.color.index_select(0, slot).transpose(1, 2).reshape(-1, side**2)
        samples = planes.index_select(1, raster_to_morton(side)).reshape(-1, 3, side, side)
        # Rows of the margin sum to less than one; the colour there is the weighted mean of the samples in reach.
        unit = weights / weights.sum(1, keepdim=True)
        bits = 24 - (width // side).bit_length()
        color = (round_bits(unit @ round_bits(samples, bits), bits) @ unit.T).flatten(2)
        flat = pixel.reshape(-1)
        for channel in range(3):
            self.coarse[channel].index_add_(0, flat, (color[:, channel] * weight).reshape(-1))
        self.coarse[3].index_add_(0, flat, weight.reshape(-1))
        self.pairs += flat.numel()

    def _temporal_weight(self, slot: Int64[Tensor, " n"], threshold: Float[Tensor, "n p"]) -> Float[Tensor, "n p"]:
        """Cycles by which a framelet is newer than the age field, plus half a cycle; 0 where it is older."""
        newer = self.time[slot][:, None] - threshold
        return torch.where(newer >= 0, newer + SHIFT_CYCLES, 0.0)

    def normalised(self) -> Float[Tensor, "h w 3"]:
        """The image: sums divided by weights, with holes filled from their surroundings."""
        resolution = self.config.resolution_px
        inner = slice(self.margin, self.margin + resolution)
        total = self.fine.index_select(0, raster_to_morton(resolution)).reshape(resolution, resolution, 4)
        for channel, plane in enumerate(self.coarse):
            total[..., channel] += plane.reshape(self.stride, self.stride)[inner, inner]
        hole = total[..., 3:] <= 0
        if bool(hole.any()):
            filled = _fill_from_coarser(total.permute(2, 0, 1)).permute(1, 2, 0)
            total = torch.where(hole, filled, total)
        return total[..., :3] / total[..., 3:]


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
