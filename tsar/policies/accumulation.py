"""Temporal accumulation: jittered frames are averaged where their surfaces were before.

Each pixel finds by its first hit where its surface was in the frame before, reads the accumulated image there, clips
what it finds to the colours around it, and takes in its own sample. Where it has nothing to read it begins anew.

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
"""Samples are clipped here before they are accumulated: of what is much brighter the square does not fit into float32,
and a sum of nine colours loses the others."""


@dataclass(frozen=True)
class Accumulation:
    """Constants of the accumulation.

    Attributes:
        count_most: samples a pixel that count at most; the newest has a share of at least ``1 / count_most``.
        deviations: half the side of the box to which what was accumulated is clipped, standard deviations of the nine
            colours around.
    """

    count_most: float = 8.0
    deviations: float = 2.0


@dataclass(frozen=True)
class History:
    """What has been accumulated.

    Attributes:
        color: mean colour of each pixel, linear RGB.
        count: samples that it is made of.
    """

    color: Float[Tensor, "h w 3"]
    count: Float[Tensor, "h w"]


ACCUMULATE_FLOPS = 2 * PROJECT_FLOPS + 8.0 + 6.0 + CUBIC_FLOPS + 21.0 + 9.0 * 9.0 + 21.0 + 30.0 + 22.0
"""Of :func:`accumulated` for a pixel: its surface now and before; the nearest of nine depths; motion and place; the
reading; luminance and chroma of both; sums of nine colours and squares; mean and deviation; clipping; averaging."""


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
        color: samples of the frame, one a pixel.
        surfaces: their first hits.
        now: the poses of the frame.
        before: those of the frame before; None where there is none.
        history: after that frame.
        constants: of the accumulation.
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
    """From each pixel's centre to where what it shows was before, pixels; the motion of the nearest of nine pixels, so
    that edges move with what is in front."""
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
    """What was found, moved towards the mean of the nine colours around until it is in their box."""
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
    """Luminance and two differences of colour, YCoCg."""
    red, green, blue = color.unbind(-1)
    half = 0.5 * (red + blue)
    return torch.stack([0.5 * (green + half), 0.5 * (red - blue), 0.5 * (green - half)], dim=-1)


def _rgb(color: Float[Tensor, "*n 3"]) -> Float[Tensor, "*n 3"]:
    """The inverse of :func:`_luma_chroma`."""
    luma, orange, green = color.unbind(-1)
    rest = luma - green
    return torch.stack([rest + orange, luma + green, rest - orange], dim=-1)
