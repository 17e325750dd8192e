"""Surfels as points, splatted over the pixels around them.

In :mod:`tsar.filtering.motion` a surfel may serve several pixels. As a point it occupies one pixel, and the display
fills the gaps between points.
"""

from __future__ import annotations

from math import inf

import torch
import torch.nn.functional as F
from jaxtyping import Float, Float64, Shaped
from torch import Tensor

from tsar.filtering.display import smoothed
from tsar.filtering.motion import NEARER, moved, projected
from tsar.filtering.records import NOTHING_KNOWN, VARIANCE_MAX, Estimates, Surfels, centres
from tsar.filtering.samples import MOVES_PX
from tsar.types import Viewpoint


def advanced(
    estimates: Estimates, surfels: Surfels, rate: Float[Tensor, "1 e e"], seconds: float, view: Viewpoint
) -> tuple[Estimates, Surfels]:
    """Like :func:`tsar.filtering.motion.advanced`, with each surfel as a point."""
    return moved(estimates.later(rate, seconds), surfels, view, points=True)


def depths(surfels: Surfels, view: Viewpoint) -> Float64[Tensor, "1 h w"]:
    """Depths of the surfels of all pixels; ``inf`` where there is none."""
    _, depth = projected(surfels, view, surfels.step.shape[-1])
    return torch.where(depth > 0.0, depth, inf).reshape(surfels.instance.shape)


def drawn(
    estimates: Estimates, surfels: Surfels, depth: Float64[Tensor, "1 h w"]
) -> tuple[Float[Tensor, "3 h w"], Float[Tensor, "1 h w"]]:
    """Picture and variance of its errors: in every pixel the mean of the surfels within a pixel of its centre, by
    bilinear weights over their variances.

    Only surfels within 1/16 of the depth of the pixel's own surfel count; in a hole, those within 1/16 of the farthest.
    A static surfel gathers samples from its whole pixel, so it is drawn in the centre. Uncertain pixels are blended
    with their surroundings, as in :mod:`tsar.filtering.display`; a hole without surfels takes the colour of its
    surroundings alone.

    Args:
        estimates, surfels: estimates and surfels of all pixels.
        depth: depth of the surfels, scene units.
    """
    side = depth.shape[-1]
    seen = depth.isfinite() | estimates.known
    weight = torch.where(estimates.variance < VARIANCE_MAX, 1.0 / estimates.variance, 0.0)
    moves = surfels.step.abs().amax(0, keepdim=True) > MOVES_PX
    place = torch.where(moves, surfels.position - centres(side), 0.0)
    near = _around(torch.cat((estimates.color, place, weight)))
    there = _around(torch.where(seen, depth, 0.0))[0]
    away = (near[3:5] + (centres(3) - 1.5).reshape(2, 9, 1, 1)).abs()
    share = (1.0 - away[0]).clamp(min=0.0) * (1.0 - away[1]).clamp(min=0.0)
    wanted = torch.where(seen, depth, torch.where(share > 0.0, there, 0.0).amax(0))
    alike = (there == wanted) | ((there < wanted * NEARER) & (there * NEARER > wanted))
    share = torch.where(alike, share, 0.0)
    heavy = share * near[5]
    area, total, color = share[0][None], heavy[0][None], heavy[0] * near[:3, 0]
    for number in range(1, len(share)):  # in this order for any number of threads
        area, total = area + share[number], total + heavy[number]
        color = color + heavy[number] * near[:3, number]
    found = total > 0.0
    color = torch.where(found, color / torch.where(found, total, 1.0), estimates.color)
    variance = torch.where(found, area / torch.where(found, total, 1.0), NOTHING_KNOWN)
    return smoothed(color, variance, estimates.roughness)


def _around(planes: Shaped[Tensor, "c h w"]) -> Shaped[Tensor, "c 9 h w"]:
    """The 3 x 3 values around each pixel, row by row; 0 outside."""
    return F.unfold(planes[None], 3, padding=1).reshape(len(planes), 9, *planes.shape[1:])
