"""Estimates that move with their surfaces: at new poses, every pixel takes the best surfel that reaches it."""

from __future__ import annotations

from math import inf

import torch
import torch.nn.functional as F
from jaxtyping import Bool, Float, Float64, Int64
from torch import Tensor

from tsar.filtering.records import UNSEEN, VARIANCE_MAX, Estimates, Surfels, centres
from tsar.projection import project
from tsar.types import Viewpoint

NEARER = 1.0625  # a surface in front is nearer by this factor
NEARER_COUNT = 6
DEPTH_SHIFT = 18  # bits of a float32 that are dropped: depths in steps of 1/32
DEPTHS = 1 << 13
SCORES = 1 << 14
SCORE_SCALE = 8e4  # scores cover variances up to 0.2
BESIDE = 0.5  # variance per unit of roughness and pixel of distance


def advanced(
    estimates: Estimates,
    surfels: Surfels,
    rate: Float[Tensor, "1 e e"],
    seconds: float,
    view: Viewpoint,
    picture: tuple[int, int] | None = None,
) -> tuple[Estimates, Surfels]:
    """Estimates ``seconds`` later at a given rate of change, :func:`moved` to the poses of that time."""
    return moved(estimates.later(rate, seconds), surfels, view, picture)


def moved(
    estimates: Estimates,
    surfels: Surfels,
    view: Viewpoint,
    picture: tuple[int, int] | None = None,
    points: bool = False,
) -> tuple[Estimates, Surfels]:
    """Estimates and surfels as the poses of a view show them.

    A surfel serves the four pixels whose centres are nearest. A pixel prefers surfels that lie within it, the nearest
    to the camera first, and among those at the same depth the one of least ``P + g d / 2`` at a distance of ``d``
    pixels from its centre; then those beside it, the farthest from the camera first, so that surfaces do not grow.
    Every pixel keeps its surfel's exact position, so repeated moves do not blur. Finally, surfels that show through
    gaps of a surface in front are dropped: those of whose eight neighbours six are nearer to the camera by 6 %.

    Args:
        estimates, surfels: before the move.
        view: new poses.
        picture: height and width of the part of the plane beyond which nothing is kept; None for all of it.
        points: whether a surfel serves only the pixel in which it lies.
    """
    side = estimates.color.shape[-1]
    position, depth = projected(surfels, view, side)
    source = _sources(estimates, surfels, position, depth, points)
    if picture is not None:
        at = torch.arange(side * side)
        source = torch.where((at // side < picture[0]) & (at % side < picture[1]), source, -1)
    found = source >= 0
    kept, here = found & ~_behind(torch.where(found, depth[source.clamp(min=0)], inf)), source.clamp(min=0)
    kept = kept.reshape(1, side, side)

    def taken(values: Tensor, otherwise: Tensor | float) -> Tensor:
        flat = values.reshape(values.shape[0], -1)[:, here].reshape(values.shape)
        return torch.where(kept, flat, otherwise)

    at = taken(position.to(torch.float32).T.reshape(2, side, side), centres(side))
    new = Surfels(
        instance=taken(surfels.instance, UNSEEN),
        point=taken(surfels.point, 0.0),
        position=at,
        step=torch.where(kept, at - taken(surfels.position, 0.0), 0.0),
    )
    return Estimates(
        color=taken(estimates.color, 0.0),
        aged=taken(estimates.aged, VARIANCE_MAX),
        inverse=taken(estimates.inverse, 1.0),
        time_s=taken(estimates.time_s, -inf),
        roughness=taken(estimates.roughness, estimates.roughness),
    ), new


def projected(
    surfels: Surfels, view: Viewpoint, side: int
) -> tuple[Float64[Tensor, "pixels 2"], Float64[Tensor, " pixels"]]:
    """Positions of surfels in a view, pixels, and their depth; depth is NaN or at most 0 where nothing is seen."""
    instance = surfels.instance.reshape(-1)
    position, depth = project(view, instance.clamp(min=-1), surfels.point.reshape(3, -1).T.contiguous())
    return position * side, torch.where(instance > UNSEEN, depth, -1.0)


def _sources(
    estimates: Estimates,
    surfels: Surfels,
    position: Float64[Tensor, "pixels 2"],
    depth: Float64[Tensor, " pixels"],
    points: bool,
) -> Int64[Tensor, " pixels"]:
    """Raster index of the surfel that each pixel takes; -1 where there is none."""
    side, count = estimates.color.shape[-1], depth.numel()
    seen = (depth > 0.0) & (position > -1.0).all(1) & (position < side + 1.0).all(1)
    at = torch.where(seen[:, None], position, -9.0)
    near = depth.to(torch.float32).clamp(min=0.0).contiguous().view(torch.int32).to(torch.int64) >> DEPTH_SHIFT
    first = at.floor() if points else (at - 0.5).floor()
    none = torch.iinfo(torch.int64).max
    least = torch.full((count,), none, dtype=torch.int64)
    number = torch.arange(count)
    variance, roughness = estimates.variance.reshape(-1), estimates.roughness.reshape(-1)
    for down in (0,) if points else (0, 1):
        for right in (0,) if points else (0, 1):
            cell = first + torch.tensor([right, down], dtype=torch.float64)
            away = (cell + 0.5 - at).abs().amax(1).to(torch.float32)
            beside = (away > 0.5).to(torch.int64)
            inside = seen & (cell >= 0.0).all(1) & (cell < side).all(1)
            score = ((variance + BESIDE * roughness * away) * SCORE_SCALE).to(torch.int64).clamp(0, SCORES - 1)
            order = torch.where(beside > 0, DEPTHS - 1 - near, near)
            key = ((beside * DEPTHS + order) * SCORES + score) * count + number
            pixel = torch.where(inside, cell[:, 1] * side + cell[:, 0], 0.0).to(torch.int64)
            least = least.scatter_reduce(0, pixel, torch.where(inside, key, none), "amin")
    return torch.where(least < none, least % count, -1)


def _behind(depth: Float64[Tensor, " pixels"]) -> Bool[Tensor, " pixels"]:
    """Mask of the surfels that lie behind most of their neighbours."""
    side = round(depth.numel() ** 0.5)
    plane = depth.reshape(side, side)
    around = F.pad(plane, (1, 1, 1, 1), value=inf)
    nearer = torch.zeros(side, side, dtype=torch.int32)
    for down in range(3):
        for right in range(3):
            if (down, right) != (1, 1):
                nearer += around[down : down + side, right : right + side] < plane / NEARER
    return ((nearer >= NEARER_COUNT) & (plane > 0.0)).reshape(-1)
