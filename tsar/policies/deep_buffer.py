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
from jaxtyping import Bool, Float, Float64, Int32, Int64
from torch import Tensor

from tsar.projection import project
from tsar.types import Hits, Viewpoint

SAMPLE_FLOPS = 75
"""Operations per stored sample of :meth:`DeepBuffer.seen`: projection 31, pixel 8, nearest depth 2, and the comparison
with nine depths 34."""
_NEARER, _NEARER_AROUND, _AROUND = 1.3, 1.07, 6


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
        room = self.time_s.numel()
        order = (self.head + torch.arange(room)) % room
        order = order[self.time_s[order].isfinite()]
        place, depth = self.position[order], None
        if view is not None:
            found, depth = project(view, self.instance[order], self.point[order])
            place = torch.where(found.isnan(), place, found) if view.kind == "parallel" else found
        inside = ((place >= 0.0) & (place < 1.0)).all(1)
        order, place = order[inside], place[inside]
        column, row = (place * place.new_tensor(shape[::-1])).to(torch.int64).unbind(1)
        pixel = row * shape[1] + column
        if depth is None:
            return Placed(order, pixel)
        seen = ~_hidden(depth[inside], pixel, shape)
        return Placed(order[seen], pixel[seen])


def _hidden(depth: Float64[Tensor, " n"], pixel: Int64[Tensor, " n"], shape: tuple[int, int]) -> Bool[Tensor, " n"]:
    height, width = shape
    nearest = torch.full((height * width,), torch.inf, dtype=torch.float64).scatter_reduce(0, pixel, depth, "amin")
    around = F.pad(nearest.reshape(shape), (1, 1, 1, 1), value=torch.inf).reshape(-1)
    centre = (pixel // width + 1) * (width + 2) + pixel % width + 1
    steps = [row * (width + 2) + column for row in (-1, 0, 1) for column in (-1, 0, 1) if row or column]
    nearer = sum((around[centre + step] * _NEARER_AROUND < depth).to(torch.int64) for step in steps)
    return (nearest[pixel] * _NEARER < depth) | (nearer >= _AROUND)
