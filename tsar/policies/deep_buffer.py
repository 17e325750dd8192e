"""A buffer of all recent samples, with their colours, times and first hits, that reprojects them to the newest poses.

Source: the temporally deep buffer of Dayal et al. 2005.

Deviation: the buffer has one queue for the whole picture, not one per tile. A sample is hidden where another in its
pixel is nearer by 30 % (ground that is seen from low down differs by less), or six of the eight pixels around it hold
one that is nearer by 7 %.
"""

from __future__ import annotations

from dataclasses import dataclass

import torch
import torch.nn.functional as F
from jaxtyping import Float, Float64, Int32, Int64
from torch import Tensor

from tsar.projection import project
from tsar.types import Hits, Viewpoint

SAMPLE_FLOPS = 42
"""Operations per stored sample of :meth:`DeepBuffer.seen`: projection 31, pixel 8, nearest depth 2, and a comparison of
depths."""
PIXEL_FLOPS = 51
"""Operations per pixel of :meth:`DeepBuffer.seen`: third greatest of the eight depths around it 48, and limits 3."""
_NEARER, _NEARER_AROUND, _AROUND = 1.3, 1.07, 6
_STEPS = [(row, column) for row in range(3) for column in range(3) if (row, column) != (1, 1)]


@dataclass(frozen=True)
class Placed:
    """Visible samples of a buffer, from the oldest to the newest.

    Attributes:
        sample: index in the buffer; samples that are hidden or outside the picture are left out.
        pixel: raster index of the pixel that shows the sample.
    """

    sample: Int64[Tensor, " n"]
    pixel: Int64[Tensor, " n"]


@dataclass(frozen=True)
class DeepBuffer:
    """The newest samples in a ring buffer. Changes in place.

    Attributes:
        color: linear RGB.
        time_s: animation time; ``-inf`` where nothing has been stored yet.
        position: position on the image plane at the time of sampling.
        instance, point: first hits, where they are known.
        head: index of the next sample, one element.
    """

    color: Float[Tensor, "room 3"]
    time_s: Float64[Tensor, " room"]
    position: Float64[Tensor, "room 2"]
    instance: Int32[Tensor, " room"]
    point: Float[Tensor, "room 3"]
    head: Int64[Tensor, " 1"]

    @staticmethod
    def empty(room: int) -> DeepBuffer:
        return DeepBuffer(
            torch.zeros(room, 3),
            torch.full((room,), -torch.inf, dtype=torch.float64),
            torch.zeros(room, 2, dtype=torch.float64),
            torch.full((room,), -1, dtype=torch.int32),
            torch.zeros(room, 3),
            torch.zeros(1, dtype=torch.int64),
        )

    def add(
        self, color: Float[Tensor, "n 3"], time_s: float, position: Float[Tensor, "n 2"], hits: Hits | None
    ) -> None:
        """Replaces the oldest samples. Of more samples than the buffer can hold, only the last are stored."""
        room = self.time_s.numel()
        keep = slice(max(0, color.shape[0] - room), None)
        place = (self.head + torch.arange(min(room, color.shape[0]))) % room
        self.color[place], self.time_s[place] = color[keep], time_s
        self.position[place] = position[keep].to(torch.float64)
        if hits is not None:
            self.instance[place] = hits.instance.reshape(-1)[keep]
            self.point[place] = hits.point.reshape(-1, 3)[keep]
        self.head[0] = (self.head + place.numel()) % room

    def seen(self, view: Viewpoint | None, shape: tuple[int, int]) -> Placed:
        """Samples that are visible at the poses of a view in a picture of ``shape``, height and width. Without poses,
        all stored samples at the positions where they were taken."""
        stored = self.time_s.numel() if self.time_s[-1].isfinite() else int(self.head)
        place, depth = self.position[:stored], None
        if view is not None:
            found, depth = project(view, self.instance[:stored], self.point[:stored])
            place = torch.where(found.isnan(), place, found) if view.kind == "parallel" else found
        x, y = place.unbind(1)
        inside = (x >= 0.0) & (x < 1.0) & (y >= 0.0) & (y < 1.0)
        oldest = int(self.head) % max(1, stored)
        order = inside.roll(-oldest).nonzero().squeeze(1).add_(oldest).remainder_(max(1, stored))
        height, width = shape
        column = (x.index_select(0, order) * width).to(torch.int64)
        pixel = (y.index_select(0, order) * height).to(torch.int64) * width + column
        if depth is None:
            return Placed(order, pixel)
        depth = depth.index_select(0, order)
        seen = (depth <= _farthest(depth, pixel, shape).index_select(0, pixel)).nonzero().squeeze(1)
        return Placed(order.index_select(0, seen), pixel.index_select(0, seen))


def _farthest(depth: Float64[Tensor, " n"], pixel: Int64[Tensor, " n"], shape: tuple[int, int]) -> Tensor:
    """Greatest depth at which a sample of each pixel, in raster order, is visible; float64."""
    height, width = shape
    nearest = torch.full((height * width,), torch.inf, dtype=torch.float64).scatter_reduce(0, pixel, depth, "amin")
    nearest = nearest.reshape(shape)
    padded = F.pad(nearest, (1, 1, 1, 1), value=torch.inf)
    greatest = [torch.full_like(nearest, -torch.inf) for _ in range(len(_STEPS) - _AROUND + 1)]
    for row, column in _STEPS:
        around = padded[row : row + height, column : column + width]
        for rank, great in enumerate(greatest):
            greatest[rank], around = torch.maximum(great, around), torch.minimum(great, around)
    return torch.minimum(nearest * _NEARER, greatest[-1] * _NEARER_AROUND).reshape(-1)
