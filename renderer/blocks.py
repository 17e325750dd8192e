"""Order in which a frame's pixels are rendered: square blocks on the Morton curve, so that neighbours stay together."""

from __future__ import annotations

from collections.abc import Iterator

import torch
from torch import Tensor

BLOCK_PX = 16


def _morton_block(side: int) -> tuple[Tensor, Tensor]:
    """Columns and rows of a block's pixels along the Morton curve, x in the even bits."""
    code = torch.arange(side * side)
    x, y = torch.zeros_like(code), torch.zeros_like(code)
    for bit in range(side.bit_length() - 1):
        x |= ((code >> (2 * bit)) & 1) << bit
        y |= ((code >> (2 * bit + 1)) & 1) << bit
    return x, y


def pixel_blocks(
    width_px: int, height_px: int, samples_per_axis: int, limit_px: int
) -> Iterator[tuple[Tensor, Tensor]]:
    """Cuts a frame into chunks of whole blocks.

    Args:
        width_px, height_px: size of the frame.
        samples_per_axis: regular grid of samples within a pixel.
        limit_px: pixels of a chunk at most, but at least one block.

    Yields:
        Row-major indices ``(p,)`` of a chunk's pixels, and sample positions ``(p * samples_per_axis², 2)`` float32 in
        [0, 1) from the top left corner, those of a pixel next to one another.
    """
    inner_x, inner_y = _morton_block(BLOCK_PX)
    columns, rows = -(-width_px // BLOCK_PX), -(-height_px // BLOCK_PX)
    per_chunk = max(1, limit_px // BLOCK_PX**2)
    step = (torch.arange(samples_per_axis, dtype=torch.float64) + 0.5) / samples_per_axis
    for first in range(0, columns * rows, per_chunk):
        block = torch.arange(first, min(first + per_chunk, columns * rows))
        x = ((block % columns) * BLOCK_PX)[:, None] + inner_x
        y = ((block // columns) * BLOCK_PX)[:, None] + inner_y
        inside = (x < width_px) & (y < height_px)
        x, y = x[inside], y[inside]
        sample_x = ((x[:, None, None] + step[None, None, :]) / width_px).expand(-1, samples_per_axis, -1)
        sample_y = ((y[:, None, None] + step[None, :, None]) / height_px).expand(-1, -1, samples_per_axis)
        position = torch.stack([sample_x, sample_y], dim=-1).reshape(-1, 2)
        yield y * width_px + x, position.to(torch.float32)
