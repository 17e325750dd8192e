"""Temporal accumulation: jittered frames are averaged along the motion of their surfaces.

The first hit of a pixel gives the position of its surface in the previous frame. The accumulated image is read there,
clipped to the range of the colours around the pixel, and averaged with the new sample. A pixel without history begins
anew.

Source: Karis 2014, High-quality temporal supersampling (jitter, the nearest surface's motion, a history read by a cubic
filter); Salvi 2016, An excursion in temporal supersampling (the box of mean and standard deviation).
"""

from __future__ import annotations

from dataclasses import dataclass

import torch
import torch.nn.functional as F
from jaxtyping import Float, Float64
from torch import Tensor

from tsar.policies.resampling import CUBIC_FLOPS, cubic, nearest
from tsar.policies.surfaces import PROJECT_FLOPS, Surfaces, centres, seen, within
from tsar.roots import square_root
from tsar.types import Viewpoint

BRIGHTEST = 1e4
"""Samples are clipped to this radiance before they are accumulated: the square of a much brighter one overflows
float32, and in a sum of nine colours the others are lost to rounding."""


@dataclass(frozen=True)
class Accumulation:
    """Constants of the accumulation.

    Attributes:
        count_most: maximum number of samples in the average of a pixel; the newest has a share of at least
            ``1 / count_most``.
        deviations: half the side of the box to which the history is clipped, in standard deviations of the nine colours
            around the pixel.
    """

    count_most: float = 8.0
    deviations: float = 2.0


@dataclass(frozen=True)
class History:
    """The accumulated image.

    Attributes:
        color: mean colour of each pixel, linear RGB.
        count: number of samples in it.
    """

    color: Float[Tensor, "h w 3"]
    count: Float[Tensor, "h w"]


ACCUMULATE_FLOPS = 2 * PROJECT_FLOPS + 8.0 + 6.0 + CUBIC_FLOPS + 21.0 + 9.0 * 9.0 + 21.0 + 30.0 + 22.0
"""Operations of :func:`accumulated` per pixel: projection of its surface now and before; the nearest of nine depths;
motion and position; interpolation; luminance and chroma of both; sums of nine colours and squares; mean and deviation;
clipping; averaging."""


def accumulated(
    color: Float[Tensor, "h w 3"],
    surfaces: Surfaces,
    now: Viewpoint,
    before: Viewpoint | None,
    history: History | None,
    constants: Accumulation,
) -> History:
    """The history after a frame.

    Args:
        color: samples of the frame, one per pixel.
        surfaces: their first hits.
        now: poses of the frame.
        before: poses of the previous frame; None for the first.
        history: after the previous frame; None for the first.
        constants: constants of the accumulation.
    """
    color = color.clamp(-BRIGHTEST, BRIGHTEST)
    if history is None or before is None:
        return History(color, torch.ones(color.shape[:2]))
    place = centres(*color.shape[:2]) + _motion(surfaces, now, before)
    inside = within(place)
    found = _clipped(cubic(history.color, place).clamp(min=0.0), color, constants.deviations)
    count = torch.where(inside, nearest(history.count, place), 0.0)
    count = (count + 1.0).clamp(max=constants.count_most)
    share = (1.0 / count)[..., None]
    return History(torch.where(inside[..., None], found + share * (color - found), color), count)


def _motion(surfaces: Surfaces, now: Viewpoint, before: Viewpoint) -> Float64[Tensor, "h w 2"]:
    """Displacement from each pixel's centre to the previous position of its surface, pixels: that of the nearest of
    nine pixels, so that edges move with the surface in front."""
    _, depth = seen(surfaces, now)
    place, _ = seen(surfaces, before)
    height, width = depth.shape
    moved = place - centres(height, width)
    motion = F.pad(moved, (0, 0, 1, 1, 1, 1), value=torch.nan)
    depths = F.pad(depth, (1, 1, 1, 1), value=torch.inf)
    nearest_depth, found = depth, moved
    for row in range(3):
        for column in range(3):
            there = depths[row : row + height, column : column + width]
            nearer = (there < nearest_depth) & (there > 0)
            nearest_depth = torch.where(nearer, there, nearest_depth)
            found = torch.where(nearer[..., None], motion[row : row + height, column : column + width], found)
    return found


def _clipped(found: Float[Tensor, "h w 3"], color: Float[Tensor, "h w 3"], deviations: float) -> Float[Tensor, "h w 3"]:
    """The history, moved towards the mean of the nine colours around each pixel until it lies in their box."""
    planes = _luma_chroma(color).permute(2, 0, 1)[None]
    padded = F.pad(planes, (1, 1, 1, 1), mode="replicate")
    mean = F.avg_pool2d(padded, 3, 1)
    variance = (F.avg_pool2d(padded * padded, 3, 1) - mean * mean).clamp(min=0.0)
    half = (deviations * square_root(variance))[0].permute(1, 2, 0)
    middle = mean[0].permute(1, 2, 0)
    offset = _luma_chroma(found) - middle
    outside = (offset.abs() / half.clamp(min=1e-6)).amax(-1, keepdim=True).clamp(min=1.0)
    return _rgb(middle + offset / outside).clamp(min=0.0)


def _luma_chroma(color: Float[Tensor, "*n 3"]) -> Float[Tensor, "*n 3"]:
    """Luma and two colour differences, YCoCg."""
    red, green, blue = color.unbind(-1)
    half = 0.5 * (red + blue)
    return torch.stack([0.5 * (green + half), 0.5 * (red - blue), 0.5 * (green - half)], dim=-1)


def _rgb(color: Float[Tensor, "*n 3"]) -> Float[Tensor, "*n 3"]:
    """The inverse of :func:`_luma_chroma`."""
    luma, orange, green = color.unbind(-1)
    rest = luma - green
    return torch.stack([rest + orange, luma + green, rest - orange], dim=-1)
