"""Whole pictures on regular grids of samples, for kernels that take only lists of samples."""

from __future__ import annotations

from typing import Protocol

import numpy as np
import torch
from torch import Tensor

from tsar.types import FrameletBatch, SampleBatch

_AT_ONCE = 1 << 18


class Traces(Protocol):
    """A renderer of batches of samples."""

    def trace(self, batch: FrameletBatch, aspect: float = 1.0, footprint_px: float | None = None) -> SampleBatch: ...


def grid_frame(renderer: Traces, time_s: float, width_px: int, height_px: int, samples_per_axis: int) -> Tensor:
    """A picture ``(height, width, 3)`` float32 as :meth:`renderer.trace.Renderer.render_frame` gives, some rows of
    pixels at a time; each pixel's samples are one group."""
    step = (torch.arange(samples_per_axis) + 0.5) / samples_per_axis
    columns = (torch.arange(width_px)[:, None] + step) / width_px  # of one row of pixels
    rows_at_once = max(1, _AT_ONCE // (width_px * samples_per_axis**2))
    footprint_px = min(width_px, height_px) * samples_per_axis
    image = torch.empty(height_px, width_px, 3)
    for first in range(0, height_px, rows_at_once):
        rows = (torch.arange(first, min(first + rows_at_once, height_px))[:, None] + step) / height_px
        shape = len(rows), width_px, samples_per_axis, samples_per_axis
        x, y = columns[None, :, None].expand(shape), rows[:, None, :, None].expand(shape)
        position = torch.stack([x, y], dim=-1).reshape(-1, samples_per_axis**2, 2)
        number = torch.zeros(len(position), dtype=torch.int64)
        batch = FrameletBatch(number, number, position, time_s)
        color = renderer.trace(batch, width_px / height_px, footprint_px).color.cpu().numpy()
        means = color.sum(axis=1, dtype=np.float64) / samples_per_axis**2
        image[first : first + len(rows)] = torch.from_numpy(means).view(-1, width_px, 3)
    return image
