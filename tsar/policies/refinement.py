"""Refinement of one picture from coarse to fine: the remaining error, and the pixels to sample next.

A quadtree covers the pixels. A cell is known once a sample lies in it. Its contrast is the mean squared difference of
its encoded colour from that of the known cells beside it. The picture is refined by sampling the empty children of
known cells, those of greatest contrast times area first. Where all four children are known they are refined in turn,
down to the pixel, which takes further samples.

Source: Painter and Sloan 1989 (adaptive refinement), here by levels of a quadtree.
"""

from __future__ import annotations

from dataclasses import dataclass

import torch
import torch.nn.functional as F
from jaxtyping import Bool, Float, Int64
from torch import Tensor

from tsar.morton import total
from tsar.roots import encoded

WITHIN_PIXEL = 0.5
"""Squared error of a pixel's only sample, as a share of the pixel's contrast with its neighbours."""
LEAST_CONTRAST = 1e-5
"""Contrast added to every cell, so that plain cells are refined last but are refined."""
PIXEL_FLOPS = 130
"""Operations per pixel of :func:`levels`, :func:`remaining` and :func:`worthiest`: sums up the tree 16; per cell (4/3
of them per pixel) mean and encoding 12, contrast 30, error 6, score 10, and a share of the sort: 2 comparisons for each
of at most 20 levels, whose coarser half is never reached, 30 in all."""


@dataclass(frozen=True)
class Level:
    """One level of the tree, raster order.

    Attributes:
        contrast: contrast of its cells, squared encoded colour; 0 where the cell or all cells beside it are empty.
        count: number of samples in its cells.
    """

    contrast: Float[Tensor, "side side"]
    count: Float[Tensor, "side side"]

    @property
    def known(self) -> Bool[Tensor, "side side"]:
        return self.count > 0


def levels(color: Float[Tensor, "3 side side"], count: Float[Tensor, "side side"]) -> list[Level]:
    """The tree of a picture, from 2 x 2 cells to the pixels, given the sum of colours and the number of samples of each
    pixel."""
    found: list[Level] = []
    while count.shape[0] > 1:
        mean = encoded(color / count.clamp(min=1.0))
        found.append(Level(_contrast(mean, (count > 0).to(torch.float32)), count))
        color, count = (4.0 * F.avg_pool2d(plane[None], 2)[0] for plane in (color, count[None]))
        count = count[0]
    return found[::-1]


def remaining(tree: list[Level], calibration: float) -> Float[Tensor, "side side"]:
    """Expected squared error of each pixel: for an empty one, ``calibration`` times the contrast of the finest known
    cell around it; for one with ``n`` samples, ``WITHIN_PIXEL / n`` of its own contrast."""
    error = torch.zeros(1, 1)
    for level in tree:
        error = torch.where(level.known, level.contrast, _doubled(error))
    last = tree[-1]
    own = WITHIN_PIXEL * last.contrast / last.count.clamp(min=1.0)
    return torch.where(last.known, own, calibration * error)


def worthiest(tree: list[Level], count: int, random: torch.Generator) -> Int64[Tensor, " pixels"]:
    """Raster indices of the ``count`` pixels to sample next; in an empty cell, a random pixel.

    The error that a sample removes is estimated as a quarter of the contrast times the area of the refined cell, and
    for a pixel with ``n`` samples as ``WITHIN_PIXEL / (n (n + 1))`` of its contrast.
    """
    side = tree[-1].count.shape[0]
    cells = [level.count.numel() for level in tree]
    score, cost = zip(*map(_offer, tree, [*tree[1:], None]), strict=True)
    worth = torch.cat([part.reshape(-1) for part in score])
    order = torch.argsort(worth, descending=True, stable=True)
    order = order[worth[order] > 0.0]
    spent = torch.cat([part.reshape(-1) for part in cost])[order].cumsum(0)
    order = order[: int((spent < count).sum()) + 1]
    pixels, first = [], 0
    for level, finer, size in zip(tree, [*tree[1:], None], cells, strict=True):
        cell = order[(order >= first) & (order < first + size)] - first
        pixels.append(cell if finer is None else _empty_children(cell, level, finer, side, random))
        first += size
    found = torch.cat(pixels)[:count]
    spare = torch.randint(side * side, (count - found.numel(),), generator=random)
    return torch.cat((found, spare))


def spread(side: int, count: int, random: torch.Generator) -> tuple[Int64[Tensor, " pixels"], int]:
    """``count`` pixels spread over an empty picture, and how many of the first of them form a regular grid.

    At most half of the samples, a power of four, lie one each in the cells of a level; the others lie in random empty
    cells of the next level. Each is at a random pixel of its cell.
    """
    level = min(side.bit_length() - 1, max((count // 2).bit_length() - 1, 0) // 2)
    cells = 2**level
    regular = _pixel_within(torch.arange(cells * cells), cells, side, random)
    finer = min(2 * cells, side)
    width = side // finer
    empty = torch.ones(finer * finer, dtype=torch.bool)
    empty[regular // side // width * finer + regular % side // width] = False
    free = empty.nonzero().squeeze(1)
    some = free[torch.randperm(free.numel(), generator=random)[: count - regular.numel()]]
    found = torch.cat((regular, _pixel_within(some, finer, side, random)))
    more = torch.randint(side * side, (count - found.numel(),), generator=random)
    return torch.cat((found, more)), regular.numel()


def mean(values: Float[Tensor, "*n"]) -> float:
    """Mean of all values, with the same bits for any number of threads."""
    return total(values.reshape(-1).to(torch.float64)) / max(values.numel(), 1)


def _contrast(color: Float[Tensor, "3 side side"], known: Float[Tensor, "side side"]) -> Float[Tensor, "side side"]:
    difference, pairs = torch.zeros_like(known), torch.zeros_like(known)
    for axis in (0, 1):
        before, after = (slice(None, -1), slice(1, None))
        if axis == 1:
            before, after = (slice(None), before), (slice(None), after)
        red, green, blue = (color[k][after] - color[k][before] for k in range(3))
        both = known[before] * known[after]
        squared = (red * red + green * green + blue * blue) / 3.0 * both
        for part in (before, after):
            difference[part] += squared
            pairs[part] += both
    return difference / pairs.clamp(min=1.0)


def _offer(level: Level, finer: Level | None) -> tuple[Float[Tensor, "side side"], Int64[Tensor, "side side"]]:
    """Error that a sample in each cell of a level removes, times its share of the picture's area, and the number of
    samples that its refinement takes. The former is 0 where the cell cannot be refined at this level."""
    area = 1.0 / level.count.numel()
    if finer is None:
        own = WITHIN_PIXEL * (level.contrast + 0.01 * LEAST_CONTRAST) * area / (level.count * (level.count + 1.0))
        return torch.where(level.known, own, 0.0), torch.ones_like(level.count, dtype=torch.int64)
    empty = 4 - (4.0 * F.avg_pool2d(finer.known[None].to(torch.float32), 2)[0]).to(torch.int64)
    own = 0.25 * (level.contrast + LEAST_CONTRAST) * area
    return torch.where(level.known & (empty > 0), own, 0.0), empty


def _empty_children(
    cell: Int64[Tensor, " cells"], level: Level, finer: Level, side: int, random: torch.Generator
) -> Int64[Tensor, " pixels"]:
    """A random pixel of each empty child of the given cells of a level."""
    across = level.count.shape[0]
    column = (2 * (cell % across)[:, None] + torch.tensor([0, 1, 0, 1])).reshape(-1)
    row = (2 * (cell // across)[:, None] + torch.tensor([0, 0, 1, 1])).reshape(-1)
    child = row * 2 * across + column
    return _pixel_within(child[~finer.known.reshape(-1)[child]], 2 * across, side, random)


def _pixel_within(
    cell: Int64[Tensor, " cells"], across: int, side: int, random: torch.Generator
) -> Int64[Tensor, " cells"]:
    """A random pixel of each given cell, of which ``across`` lie along the side of the picture."""
    width = side // across
    within = torch.randint(width * width, cell.shape, generator=random)
    return (cell // across * width + within // width) * side + cell % across * width + within % width


def _doubled(plane: Float[Tensor, "side side"]) -> Float[Tensor, "twice twice"]:
    return plane.repeat_interleave(2, 0).repeat_interleave(2, 1)
