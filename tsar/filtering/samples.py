"""A batch gathered by pixels, and the update of the estimates by it."""

from __future__ import annotations

from dataclasses import dataclass

import torch
import torch.nn.functional as F
from jaxtyping import Bool, Float, Float64, Int64
from torch import Tensor

from tsar.filtering.options import FilterOptions
from tsar.filtering.records import TILE_SIDE, VARIANCE_MAX, Estimates, Surfels
from tsar.morton import morton_to_raster, raster_to_morton
from tsar.projection import project
from tsar.roots import square_root
from tsar.types import Hits, Viewpoint

ROUGHNESS_MIN = 1e-6
COUNT_LEAST = 1e-9  # avoids division by 0
MOVES_PX = 0.02
"""Difference of displacements, pixels per cycle, above which one surface moves against another."""
SHARE_MOVING = 1.0 / 17.0
"""Least share of new samples in the estimate of a surfel that moves."""
COLOR_MAX = 1.5
"""Samples are clipped here before they are averaged: a brighter glint would spread over its neighbours."""


@dataclass(frozen=True)
class PixelBatch:
    """A batch by pixels.

    Attributes:
        color, time_s: means of each pixel's samples.
        count: number of each pixel's samples.
        newest: number of the pixel's last sample in the batch, -1 where there is none.
        roughness: as in :class:`tsar.filtering.records.Estimates`, updated by the batch.
    """

    color: Float[Tensor, "3 h w"]
    time_s: Float64[Tensor, "1 h w"]
    count: Float[Tensor, "1 h w"]
    newest: Int64[Tensor, " pixels"]
    roughness: Float[Tensor, "1 h w"]

    @property
    def hit(self) -> Bool[Tensor, "1 h w"]:
        return self.count > 0.0


def pixels_of(
    position: Float[Tensor, "samples 2"], side: int, picture: tuple[int, int] | None = None
) -> Int64[Tensor, " samples"]:
    """Raster index of the pixel at each position, in pixels; ``side²`` outside the image, or outside the part of it
    with the height and width ``picture``."""
    end = side if picture is None else position.new_tensor(picture[::-1])
    inside = (position >= 0.0).all(1) & (position < end).all(1)
    cell = torch.where(inside[:, None], position, 0.0).floor().to(torch.int64)
    return torch.where(inside, cell[:, 1] * side + cell[:, 0], side * side)


def gathered(
    color: Float[Tensor, "n samples 3"],
    time_s: Float64[Tensor, "n samples"],
    spacing: Float[Tensor, " n"],
    pixel: Int64[Tensor, " flat"],
    now_s: float,
    roughness: Float[Tensor, "1 h w"],
    semivariance: Float[Tensor, "n samples"],
) -> PixelBatch:
    """Gathers the samples of a batch by pixels.

    The roughness is the semivariance of samples per pixel of distance between them. The samples of a coarse tile only
    bound it: a semivariance ``v`` at ``h`` pixels implies a roughness between ``v / sqrt(h)`` and ``v``, for surfaces
    between smooth and random ones. The mean over 3 x 3 pixels is averaged with the roughness before the batch.
    """
    side = roughness.shape[-1]

    def summed(values: Tensor) -> Tensor:
        return values.new_zeros(side * side + 1).index_add_(0, pixel, values)[:-1].reshape(1, side, side)

    flat = color.reshape(-1, 3)
    count = summed(torch.ones_like(flat[:, 0]))
    many = count.clamp(min=1.0)
    newest = torch.full((side * side + 1,), -1).scatter_reduce(0, pixel, torch.arange(pixel.numel()), "amax")[:-1]
    wide = spacing.clamp(min=1.0)[:, None]
    least = summed((semivariance / (spacing[:, None] / wide) / square_root(wide)).reshape(-1))
    most = summed((semivariance / (spacing[:, None] / wide)).reshape(-1))
    near = _box(count)
    bounded = torch.minimum(
        torch.maximum(roughness, _box(least) / near.clamp(min=COUNT_LEAST)), _box(most) / near.clamp(min=COUNT_LEAST)
    )
    mixed = torch.where(near > 0.0, 0.5 * (roughness + bounded), roughness).clamp(min=ROUGHNESS_MIN)
    return PixelBatch(
        color=torch.cat([summed(flat[:, channel].contiguous()) for channel in range(3)]) / many,
        time_s=summed(time_s.reshape(-1) - now_s) / many.to(torch.float64) + now_s,
        count=count,
        newest=newest,
        roughness=mixed,
    )


def updated(
    estimates: Estimates,
    seen: PixelBatch,
    rate: Float[Tensor, "1 h w"],
    now_s: float,
    replaced: Bool[Tensor, "1 h w"],
    least_share: Float[Tensor, "1 h w"],
    options: FilterOptions,
) -> tuple[Estimates, Float[Tensor, "1 h w"]]:
    """Estimates updated by a batch, and the share of the new samples in each pixel.

    A pixel with ``k`` new samples of mean ``c`` takes the share ``K = P / (P + g / 2k)``, as the Kalman filter does:
    ``m <- m + K (c - m)``. In its variance ``P = a + g i / 2`` the part from change becomes ``a <- (1 - K)² a`` and the
    reciprocal of the samples ``i <- (1 - K)² i + K² / k``, which holds for any ``K``. The first samples of a pixel have
    ``K = 1``, as have those that replace its estimate.

    Deviation: the Kalman filter keeps ``P`` alone. Here a later estimate of the roughness corrects the weight of
    earlier samples.

    Args:
        estimates: aged to the start of the cycle, ``now_s``.
        seen: the batch.
        rate: variance per second that they gain until the time of the samples.
        now_s: start of the cycle, seconds.
        replaced: pixels whose estimates are discarded.
        least_share: the least ``K`` of each pixel.
        options: options of the filter.
    """
    hit, known = seen.hit, estimates.known
    elapsed_s = (seen.time_s - now_s).to(torch.float32)
    many = seen.count.clamp(min=1.0)
    aged = estimates.aged + rate * elapsed_s
    variance = (aged + 0.5 * seen.roughness * estimates.inverse).clamp(max=VARIANCE_MAX)
    share = torch.maximum(variance / (variance + 0.5 * seen.roughness / many), least_share)
    if not options.accumulation:
        share = torch.ones_like(share)
    share = torch.where(known & ~replaced, share, 1.0)
    kept = (1.0 - share) * (1.0 - share)
    return Estimates(
        color=torch.where(hit, estimates.color + share * (seen.color - estimates.color), estimates.color),
        aged=torch.where(hit, (kept * aged).clamp(max=VARIANCE_MAX), estimates.aged),
        inverse=torch.where(hit, kept * estimates.inverse + share * share / many, estimates.inverse),
        time_s=torch.where(hit, seen.time_s, estimates.time_s),
        roughness=seen.roughness,
    ), share


@dataclass(frozen=True)
class Met:
    """Surfels of the newest samples of a batch, and their relation to the surfels before it.

    Attributes:
        surfels: surfels of the newest samples.
        same: pixels in which both surfels belong to one instance.
        replaced: pixels in which another surface is seen that moves against the one before.
        least_share: the least share of new samples.
    """

    surfels: Surfels
    same: Bool[Tensor, "1 h w"]
    replaced: Bool[Tensor, "1 h w"]
    least_share: Float[Tensor, "1 h w"]


def met(hits: Hits, seen: PixelBatch, before: Surfels, view: Viewpoint, earlier: Viewpoint | None) -> Met:
    """The surfels of a batch at the poses of a view; their displacement is that since the poses of the cycle before."""
    side = before.step.shape[-1]
    pixel = (seen.newest >= 0).nonzero().squeeze(1)
    newest = seen.newest[pixel]
    instance = hits.instance.reshape(-1)[newest].to(torch.int64)
    point = hits.point.reshape(-1, 3)[newest]
    position = _image(view, instance, point, side)
    step = torch.zeros_like(position)
    if earlier is not None:
        step = position - _image(earlier, instance, point, side)

    def spread(values: Tensor) -> Tensor:
        plane = values.new_zeros(values.shape[0], side * side)
        plane[:, pixel] = values
        return plane.reshape(-1, side, side)

    found = Surfels(spread(instance[None]), spread(point.T), spread(position), spread(step))
    same = seen.hit & (found.instance == before.instance)
    moves = (found.step - before.step).abs().amax(0, keepdim=True) > MOVES_PX
    fast = before.step.abs().amax(0, keepdim=True) > MOVES_PX
    share = torch.where(fast, SHARE_MOVING, 0.0)
    return Met(found, same, seen.hit & ~same & moves, share)


def joined(before: Surfels, found: Met, hit: Bool[Tensor, "1 h w"], share: Float[Tensor, "1 h w"]) -> Surfels:
    """Surfels after a batch: at the mean position of the samples where the instance is the same, else at the newest
    sample."""
    new = found.surfels
    weight = torch.where(found.same, share, 1.0)
    other = hit & ~found.same

    def mean(old: Tensor, fresh: Tensor) -> Tensor:
        return torch.where(hit, old + weight * (fresh - old), old)

    return Surfels(
        instance=torch.where(other, new.instance, before.instance),
        point=mean(before.point, new.point),
        position=mean(before.position, new.position),
        step=torch.where(other, new.step, before.step),
    )


def _image(
    view: Viewpoint, instance: Int64[Tensor, " hit"], point: Float[Tensor, "hit 3"], side: int
) -> Float[Tensor, "2 hit"]:
    position, _ = project(view, instance, point)
    return (position * side).nan_to_num(0.0).to(torch.float32).T.contiguous()


def semivariance_of(color: Float[Tensor, "n samples 3"]) -> Float[Tensor, "n samples"]:
    """Half the mean squared difference of each sample from its four neighbours in the tile. Colours are encoded,
    samples in Morton order."""
    plane = color[:, raster_to_morton(TILE_SIDE)].reshape(-1, TILE_SIDE, TILE_SIDE, 3)
    across, down = (
        0.5 * ((square[..., 0] + square[..., 1] + square[..., 2]) / 3.0)
        for square in ((plane[:, :, 1:] - plane[:, :, :-1]).square(), (plane[:, 1:] - plane[:, :-1]).square())
    )
    total = F.pad(across, (1, 0)) + F.pad(across, (0, 1)) + F.pad(down, (0, 0, 1, 0)) + F.pad(down, (0, 0, 0, 1))
    row = torch.full((TILE_SIDE,), 2.0)
    row[0] = row[-1] = 1.0
    return (total / (row + row[:, None])).reshape(len(color), -1)[:, morton_to_raster(TILE_SIDE)]


def _box(plane: Float[Tensor, "1 h w"]) -> Float[Tensor, "1 h w"]:
    return F.avg_pool2d(F.pad(plane[None], (1, 1, 1, 1), mode="replicate"), 3, 1)[0]
