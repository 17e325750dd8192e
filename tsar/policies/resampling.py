"""Images interpolated at positions between their pixels. All operations gather or act element by element, so they give
the same bits for any number of threads.

Positions are in pixels: the centre of column ``x`` of row ``y`` is ``(x, y)``. Beyond the border, the border pixels are
repeated.
"""

from __future__ import annotations

from itertools import product

import torch
import torch.nn.functional as F
from jaxtyping import Float, Float64, Int64, Shaped
from torch import Tensor

BILINEAR_FLOPS = 38.0
"""Operations of :func:`bilinear` per position and three channels: 8 for the fractions, 6 for their products, 24 for the
sum."""
CUBIC_FLOPS = 160.0
"""Operations of :func:`cubic` per position and three channels: 4 for the fractions, 2 x 22 for the weights, 16 for
their products, 96 for the sum."""


def nearest(plane: Shaped[Tensor, "h w *c"], position: Float64[Tensor, "*n 2"]) -> Shaped[Tensor, "*m"]:
    """The value of the pixel in which each position lies."""
    x, y = _columns(position)
    return plane[_within(y.add(0.5).floor(), plane.shape[0]), _within(x.add(0.5).floor(), plane.shape[1])]


def bilinear(image: Float[Tensor, "h w c"], position: Float64[Tensor, "*n 2"]) -> Float[Tensor, "*n c"]:
    """Weighted mean of the four nearest pixels."""
    return _weighted(image, position, lambda share: [1.0 - share, share], 0)


def cubic(image: Float[Tensor, "h w c"], position: Float64[Tensor, "*n 2"]) -> Float[Tensor, "*n c"]:
    """Weighted mean of the sixteen nearest pixels by the cubic spline of Catmull and Rom. Applied repeatedly, it blurs
    far less than bilinear weights do. It may overshoot.

    Source: Catmull and Rom 1974; Keys 1981, a = -1/2.
    """

    def weights(s: Float[Tensor, "*n"]) -> list[Float[Tensor, "*n"]]:
        squared, cubed = s * s, s * s * s
        return [
            squared - 0.5 * (cubed + s),
            1.5 * cubed - 2.5 * squared + 1.0,
            2.0 * squared - 1.5 * cubed + 0.5 * s,
            0.5 * (cubed - squared),
        ]

    return _weighted(image, position, weights, -1)


def _weighted(image: Tensor, position: Tensor, weights, first: int) -> Tensor:
    """Sum over a square of pixels, weighted by the products of the weights along both axes."""
    x, y = _columns(position)
    left, top = x.floor(), y.floor()
    across, down = (weights((at - low).to(image.dtype)) for at, low in ((x, left), (y, top)))
    height, width = image.shape[:2]
    columns = [_within(left + (first + k), width) for k in range(len(across))]
    rows = [_within(top + (first + k), height) for k in range(len(down))]
    flat, total = image.reshape(height * width, -1), torch.zeros((*x.shape, image.shape[2]), dtype=image.dtype)
    for row, column in product(range(len(rows)), range(len(columns))):
        share = (down[row] * across[column])[..., None]
        total = total + share * flat[rows[row] * width + columns[column]]
    return total


def _columns(position: Float64[Tensor, "*n 2"]) -> tuple[Float64[Tensor, "*n"], Float64[Tensor, "*n"]]:
    """The two coordinates of positions; non-finite ones are replaced by 0."""
    x, y = position.nan_to_num(nan=0.0, posinf=0.0, neginf=0.0).unbind(-1)
    return x.contiguous(), y.contiguous()


def _within(at: Float64[Tensor, "*n"], count: int) -> Int64[Tensor, "*n"]:
    return at.clamp(0.0, count - 1.0).to(torch.int64)


def averaged(image: Float[Tensor, "h w c"], height: int, width: int) -> Float[Tensor, "h2 w2 c"]:
    """A smaller image, each pixel of which is the mean of the area that it covers; pixels covered in part count in
    proportion."""
    for axis, count in ((0, height), (1, width)):
        old = image.shape[axis]
        edge = torch.arange(count + 1, dtype=torch.float64) * old / count
        first, last = edge[:-1].floor().to(torch.int64), edge[1:]
        total = torch.zeros(*image.shape[:axis], count, *image.shape[axis + 1 :], dtype=image.dtype)
        for k in range(-(-old // count) + 1):
            cell = first + k
            share = (torch.minimum(cell + 1.0, last) - torch.maximum(cell.to(torch.float64), edge[:-1])).clamp(min=0.0)
            weight = (share * count / old).to(image.dtype).reshape(-1, *[1] * (image.ndim - axis - 1))
            total = total + weight * image.index_select(axis, cell.clamp(max=old - 1))
        image = total
    return image


def double_width(plane: Float[Tensor, "c h w"]) -> Float[Tensor, "c h w2"]:
    """Twice as many columns, as :func:`widened` has them."""
    return widened(plane, 2)


def widened(plane: Float[Tensor, "c h w"], factor: int) -> Float[Tensor, "c h w2"]:
    """``factor`` times as many columns by bilinear interpolation, with the border repeated. ``F.interpolate`` is not
    used, because with one thread it takes another path with different rounding."""
    padded = F.pad(plane, (1, 1), mode="replicate")
    parts = []
    for column in range(factor):
        # centre of the new column, in columns from the centre of the old one
        offset = (column + 0.5) / factor - 0.5
        nearer = padded[..., 2:] if offset > 0 else padded[..., :-2]
        parts.append((1.0 - abs(offset)) * plane + abs(offset) * nearer)
    return torch.stack(parts, dim=-1).flatten(-2)
