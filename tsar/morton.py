"""Morton curves, kd- and quadtree indices, and means over tiles.

All functions are element-wise over int64 tensors of any shape. ``x`` takes the even bits of a Morton index and ``y``
the odd ones. A *kd index* encodes the depth too: ``2^depth + Morton index``, in a tree that halves one axis per level.

Source: Stephens 2011, sec. 4.1.
"""

from __future__ import annotations

from functools import lru_cache

import torch
from jaxtyping import Float, Int64
from torch import Tensor

_SPREAD = ((8, 0x00FF00FF00FF00FF), (4, 0x0F0F0F0F0F0F0F0F), (2, 0x3333333333333333), (1, 0x5555555555555555))
_GATHER = ((1, 0x3333333333333333), (2, 0x0F0F0F0F0F0F0F0F), (4, 0x00FF00FF00FF00FF), (8, 0x0000FFFF0000FFFF))


def interleave(x: Int64[Tensor, "*n"], y: Int64[Tensor, "*n"]) -> Int64[Tensor, "*n"]:
    """Morton index of cell ``(x, y)``, coordinates in ``[0, 2^16)``; ``interleave(3, 2) = 13``.

    Source: Stephens 2011, sec. 4.1.2.
    """
    for shift, mask in _SPREAD:
        x = (x | (x << shift)) & mask
        y = (y | (y << shift)) & mask
    return x | (y << 1)


def deinterleave(index: Int64[Tensor, "*n"]) -> tuple[Int64[Tensor, "*n"], Int64[Tensor, "*n"]]:
    """Cell ``(x, y)`` of a Morton index below ``4^16``: the inverse of :func:`interleave`."""
    pair = torch.stack((index, index >> 1)) & 0x5555555555555555
    for shift, mask in _GATHER:
        pair = (pair | (pair >> shift)) & mask
    return pair[0], pair[1]


def first_node(level):
    """Number of the first node of a level, ``(4^level - 1) / 3``: nodes are numbered level by level, coarsest first.

    ``level`` is an int or an int64 tensor, and so is the result.
    """
    return (4**level - 1) // 3


def node_number(level, index):
    """Number of the node that has the Morton index ``index`` within ``level``."""
    return first_node(level) + index


def floor_log2(k: Int64[Tensor, "*n"]) -> Int64[Tensor, "*n"]:
    """``floor(log2 k)`` for ``1 <= k < 2^53``, exact: float64 holds such integers without rounding."""
    return torch.frexp(k.to(torch.float64)).exponent.to(torch.int64) - 1


def tile_interval(
    level: Int64[Tensor, " n"], index: Int64[Tensor, " n"], field_level: int
) -> tuple[Int64[Tensor, " n"], Int64[Tensor, " n"]]:
    """Half-open interval of field elements that each tile covers; tiles must not be finer than the field.

    Source: Stephens 2011, sec. 4.1.5.
    """
    shift = 2 * (field_level - level)
    return index << shift, (index + 1) << shift


def tile_mean(
    field: Float[Tensor, " e"], level: Int64[Tensor, " n"], index: Int64[Tensor, " n"], field_level: int
) -> Float[Tensor, " n"]:
    """Mean of the field over each tile, from the means of all nodes of the quadtree, one pass per level.

    Deviation: sec. 4.1.5 uses a prefix sum. Here tiles of equal elements have equal means, which differences of a
    prefix sum do not give, and the sums of several nodes can be computed in parallel.
    """
    found = torch.empty(level.shape, dtype=field.dtype)
    for node_level in range(field_level, -1, -1):
        rows = level == node_level
        found[rows] = field[index[rows]]
        four = field.reshape(-1, 4) if node_level else field.expand(1, 4)
        field = ((four[:, 0] + four[:, 1]) + (four[:, 2] + four[:, 3])) * 0.25
    return found


def total(field: Float[Tensor, " e"]) -> float:
    """Sum of a field, with the same bits for any number of threads: a scan adds in a fixed order, a parallel sum does
    not."""
    return float(torch.cumsum(field, 0)[-1]) if field.numel() else 0.0


@lru_cache(maxsize=32)
def raster_to_morton(side: int) -> Int64[Tensor, " cells"]:
    """For each cell in raster order (row by row), its Morton index: ``field[raster_to_morton(s)]`` is in raster
    order."""
    row = torch.arange(side)
    return interleave(row[None, :].expand(side, side).reshape(-1), row[:, None].expand(side, side).reshape(-1))


@lru_cache(maxsize=8)
def curve(height: int, width: int) -> Int64[Tensor, " cells"]:
    """Raster indices ``y * width + x`` of the cells of a rectangle, in the order of the Morton curve over the enclosing
    square. For a square whose side is a power of two it equals :func:`morton_to_raster`."""
    row, column = torch.arange(height)[:, None], torch.arange(width)[None, :]
    return torch.argsort(interleave(column.expand(height, width).reshape(-1), row.expand(height, width).reshape(-1)))


@lru_cache(maxsize=32)
def morton_to_raster(side: int) -> Int64[Tensor, " cells"]:
    """For each cell in Morton order, its raster index ``y * side + x``."""
    x, y = deinterleave(torch.arange(side * side))
    return y * side + x
