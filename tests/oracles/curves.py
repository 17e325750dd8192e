"""What the thesis derives from Morton indices and the pipeline does without: other ways to the same tiles and sums."""

from __future__ import annotations

import torch
from jaxtyping import Float, Int64
from torch import Tensor

from tsar.morton import floor_log2, tile_interval


def kd_min_child(k: Int64[Tensor, "*n"], depth: int) -> Int64[Tensor, "*n"]:
    """First descendant of kd tile ``k`` at ``depth``, or its ancestor there when ``k`` is deeper.

    ``MinChild_4(5) = 20``. Source: Stephens 2011, eq. 4.6.
    """
    shift = depth - floor_log2(k)
    return torch.where(shift >= 0, k << shift.clamp(min=0), k >> (-shift).clamp(min=0))


def kd_overlap(k: Int64[Tensor, "*n"], depth: int) -> Int64[Tensor, "*n"]:
    """How many tiles at ``depth`` kd tile ``k`` covers; 0 when it is deeper.

    Source: Stephens 2011, eq. 4.7.

    Deviation: eq. 4.7 takes the difference to the first descendant of ``k + 1``, which for the last tile of a depth is
    counted from another depth, so that the difference comes out negative. The number depends on the depths only.
    """
    shift = depth - floor_log2(k)
    return (shift >= 0).to(k.dtype) << shift.clamp(min=0)


def depth_first(k: Int64[Tensor, "*n"], depth_max: int) -> Int64[Tensor, "*n"]:
    """Position of kd tile ``k`` in the depth-first order of the complete binary tree of depth ``depth_max``, from 1.

    Walks the bits of ``k`` from the root: a step to the left child costs one, a step to the right child also the size
    of the left sibling's subtree, ``2^(m - depth + 1) - 1``.

    Source: Stephens 2011, eq. 4.12–4.13.
    """
    own_depth = floor_log2(k)
    position = torch.ones_like(k)
    for depth in range(1, depth_max + 1):
        on_path = depth <= own_depth
        is_right = ((k >> (own_depth - depth).clamp(min=0)) & 1) * on_path
        position = position + on_path + is_right * (2 ** (depth_max - depth + 1) - 1)
    return position


def prefix_sum(field: Float[Tensor, " e"]) -> Float[Tensor, " e1"]:
    """Exclusive prefix sum along the curve in float64, one entry longer than the field.

    In float32 a tile of small values after large ones would be lost: the sum of ``128^2`` values needs more digits than
    float32 has. Source: Stephens 2011, sec. 4.1.5.
    """
    total = torch.cumsum(field.to(torch.float64), 0)
    return torch.cat((total.new_zeros(1), total))


def tile_integral(
    prefix: Float[Tensor, " e1"], level: Int64[Tensor, " n"], index: Int64[Tensor, " n"], field_level: int
) -> Float[Tensor, " n"]:
    """Sum of the field over each tile from its prefix sum: two look-ups a tile, whatever its size."""
    first, last = tile_interval(level, index, field_level)
    return prefix[last] - prefix[first]
