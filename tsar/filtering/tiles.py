"""Selection of the tiles to sample: the disjoint nodes of the quadtree with the greatest gain."""

from __future__ import annotations

from functools import lru_cache
from math import sqrt

import torch
import torch.nn.functional as F
from jaxtyping import Bool, Float, Float64, Int64, Shaped
from torch import Tensor

from tsar.filtering.options import FilterOptions
from tsar.filtering.records import ELEMENT_PX, SPACINGS, TILE_SIDE, UNSEEN, VARIANCE_MAX, Surfels, by_pixels
from tsar.morton import morton_to_raster

BISECTIONS = 30
PRICE_LEAST = 2.0**-46  # as a share of the greatest gain
PRICE_ABOVE = 1e-12  # added to the greatest gain: no tile is worth that price
SPEED_LEAST = 1e-9  # pixels per second; avoids division by 0
EDGE_GROWTH = 0.35  # growth of the distance from a pixel without a sample to the nearest one, per pixel of spacing


def spacings(side: int) -> tuple[float, ...]:
    """The spacings of :data:`tsar.filtering.records.SPACINGS` whose tiles fit into the image."""
    return tuple(spacing for spacing in SPACINGS if side >= TILE_SIDE * spacing)


def gains(
    variance: Float[Tensor, "1 h w"],
    roughness: Float[Tensor, "1 h w"],
    rate: Float[Tensor, "1 h w"],
    speed: Float[Tensor, "1 h w"],
    cycle_s: float,
    options: FilterOptions,
) -> list[Float64[Tensor, "_ _"]]:
    """Gain from sampling a tile, for the tiles of every spacing: the sum over its pixels of the variance removed times
    the duration of that improvement.

    With ``P = min(V + q cycle, 0.1)`` a pixel gains ``P² / (P + g h²/2)`` at a spacing of ``h <= 1``, and beyond that
    ``P² (c / (P + g/2) + (1 - c) P / ((P + g (0.5 + 0.35 (h - 1))) (P + g h/2)))`` with ``c = 1/h²``, the share of
    pixels that receive a sample. The improvement lasts ``gain / q``, at least ``life_min_s``, at most ``life_max_s``,
    and at most until the surface has crossed the share ``reach`` of the image.

    Args:
        variance: variance ``V`` of the last picture shown.
        roughness: semivariance ``g`` per pixel of distance.
        rate: rate of change ``q``, variance per second.
        speed: speed of surfaces over the image, pixels per second.
        cycle_s: length of a cycle, seconds.
        options: options of the filter.
    """
    p = (variance + rate * cycle_s).clamp(max=VARIANCE_MAX)
    crossed_s = options.reach * variance.shape[-1] / speed.clamp(min=SPEED_LEAST)
    longest_s = crossed_s.clamp(options.life_min_s, options.life_max_s)
    found = []
    for spacing in spacings(variance.shape[-1]):
        if spacing <= 1.0:
            gain = p * p / (p + 0.5 * spacing**2 * roughness)
        else:
            hit = 1.0 / spacing**2
            beside = (p + (0.5 + EDGE_GROWTH * (spacing - 1.0)) * roughness) * (p + 0.5 * spacing * roughness)
            gain = p * p * (hit / (p + 0.5 * roughness) + (1.0 - hit) * p / beside)
        gain = gain * torch.minimum((gain / rate).clamp(min=options.life_min_s), longest_s)
        while gain.shape[-1] * TILE_SIDE * spacing > variance.shape[-1]:
            gain = 4.0 * F.avg_pool2d(gain[None], 2)[0]
        found.append(gain[0].to(torch.float64))
    return found


def chosen(
    variance: Float[Tensor, "1 h w"],
    roughness: Float[Tensor, "1 h w"],
    rate: Float[Tensor, "1 e e"],
    surfels: Surfels | None,
    cycle_s: float,
    count: int,
    options: FilterOptions,
    picture: tuple[int, int] | None = None,
) -> list[Bool[Tensor, "_ _"]]:
    """The ``count`` tiles of greatest gain, as a mask for every spacing; fewer where no more are free. Tiles that do
    not fit into ``picture``, the height and width of a picture that is not the whole plane, have no gain.

    Arguments are those of :func:`gains`, except for the rate, which is given per element, and the surfels, which are
    None where nothing moves. A pixel without a surfel counts as infinitely fast: it lies where much moves, and its
    samples are not useful for long.
    """
    speed = torch.zeros_like(variance)
    if surfels is not None:
        speed = torch.where(surfels.instance == UNSEEN, torch.inf, surfels.step.abs().amax(0, keepdim=True) / cycle_s)
    gain = gains(variance, roughness, by_pixels(rate), speed, cycle_s, options)
    if picture is not None:
        for level, spacing in zip(gain, spacings(variance.shape[-1]), strict=True):
            if TILE_SIDE * spacing > min(picture):
                level.zero_()
    return filled_up(best(gain, count), gain, spacings(variance.shape[-1]).index(1.0), count)


def best(gain: list[Float64[Tensor, "_ _"]], count: int) -> list[Bool[Tensor, "_ _"]]:
    """At most ``count`` disjoint tiles with the greatest sum of gains.

    Every tile has the same price. A tile is taken if its gain exceeds the price and its profit exceeds that of the best
    tiles within it. The least price at which at most ``count`` tiles are taken is found by bisection.
    """
    high = max(float(level.max()) for level in gain) + PRICE_ABOVE
    low = high * PRICE_LEAST
    for _ in range(BISECTIONS):
        price = sqrt(low * high)
        if sum(int(level.sum()) for level in _worth(gain, price)) > count:
            low = price
        else:
            high = price
    return _worth(gain, high)


def filled_up(
    chosen: list[Bool[Tensor, "_ _"]], gain: list[Float64[Tensor, "_ _"]], spacing: int, count: int
) -> list[Bool[Tensor, "_ _"]]:
    """Adds the best tiles of one spacing, given by its number, that overlap no chosen tile, until there are
    ``count``."""
    missing = count - sum(int(level.sum()) for level in chosen)
    above = torch.zeros_like(chosen[0])
    for level in chosen[:spacing]:
        above = doubled(above | level)
    below = torch.zeros_like(chosen[-1])
    for level in reversed(chosen[spacing + 1 :]):
        below = F.max_pool2d((below | level).to(torch.float32)[None], 2)[0] > 0.0
    free = ~(above | below | chosen[spacing])
    value = torch.where(free, gain[spacing], -1.0).reshape(-1)
    order = torch.argsort(value, descending=True, stable=True)[: max(missing, 0)]
    more = chosen[spacing].reshape(-1).clone()
    more[order[value[order] >= 0.0]] = True
    return [more.reshape(level.shape) if number == spacing else level for number, level in enumerate(chosen)]


def covered(
    x: Float64[Tensor, " n"], y: Float64[Tensor, " n"], spacing: Float64[Tensor, " n"], side: int
) -> Int64[Tensor, "1 e e"]:
    """Number of tiles on each element, at most one per spacing; ``x`` and ``y`` are the left and upper edges,
    pixels."""
    total = torch.zeros(1, 1, 1, dtype=torch.int64)
    for kind in spacings(side):
        width = int(TILE_SIDE * kind)
        of = (spacing == kind).nonzero().squeeze(1)
        tile = torch.zeros(1, side // width, side // width, dtype=torch.int64)
        tile[0, (y[of] / width).to(torch.int64), (x[of] / width).to(torch.int64)] = 1
        total = _enlarged(total, side // width) + tile
    return _enlarged(total, side // ELEMENT_PX)


def in_turn(side: int, sampled: Bool[Tensor, " tiles"], first: int, count: int) -> list[Bool[Tensor, "_ _"]]:
    """The next ``count`` tiles of one sample per pixel in Morton order, as a mask for every spacing.

    Args:
        side: pixels along the plane's side.
        sampled: mask of the tiles of :func:`places` that may be sampled.
        first: number of tiles before them.
        count: number of tiles.
    """
    kinds = spacings(side)
    chosen = [torch.zeros(2 * (int(side / (TILE_SIDE * kind)),), dtype=torch.bool) for kind in kinds]
    fine = chosen[kinds.index(1.0)]
    curve = morton_to_raster(fine.shape[0])
    curve = curve[sampled[places(side)[:, 2] == 1.0][curve]]
    turn = (torch.arange(count) + first) % curve.numel()
    fine.reshape(-1)[curve[turn]] = True
    return chosen


@lru_cache(maxsize=8)
def places(side: int) -> Float64[Tensor, "n 3"]:
    """Upper edge, left edge and spacing of all tiles, pixels; one spacing after the other, each row by row."""
    found = []
    for kind in spacings(side):
        tile = torch.ones(int(side / (TILE_SIDE * kind)), int(side / (TILE_SIDE * kind))).nonzero()
        found.append(torch.cat((tile * TILE_SIDE * kind, torch.full((len(tile), 1), kind)), dim=1))
    return torch.cat(found).to(torch.float64)


def _enlarged(plane: Int64[Tensor, "1 e e"], across: int) -> Int64[Tensor, "1 a a"]:
    """The plane enlarged: each value is repeated over the cells that it covers."""
    side, times = plane.shape[-1], across // plane.shape[-1]
    return plane[0, :, None, :, None].expand(side, times, side, times).reshape(1, across, across)


def _worth(gain: list[Float64[Tensor, "_ _"]], price: float) -> list[Bool[Tensor, "_ _"]]:
    value = (gain[-1] - price).clamp(min=0.0)
    taken = [gain[-1] > price]
    for level in reversed(gain[:-1]):
        within = 4.0 * F.avg_pool2d(value[None, None], 2)[0, 0]
        own = level - price
        take = (own > within) & (own > 0.0)
        taken.append(take)
        value = torch.where(take, own, within)
    free, found = torch.ones_like(taken[-1]), []
    for number, level in enumerate(reversed(taken)):
        if number:
            free = doubled(free)
        found.append(level & free)
        free = free & ~level
    return found


def doubled(tiles: Shaped[Tensor, "rows columns"]) -> Shaped[Tensor, "rows2 columns2"]:
    """The value of each tile, repeated in the four tiles within it."""
    return tiles.repeat_interleave(2, 0).repeat_interleave(2, 1)
