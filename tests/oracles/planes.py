"""A plane of texture before a camera that pans, with a square that moves over it: what a renderer that tells first hits
answers, exactly.

The camera's rays are parallel and the image is one unit wide: a point ``(x, y)`` of the world is seen at
``(x - pan, 1 - y)``.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import torch
from torch import Tensor

from tsar.types import FrameletBatch, Hits, SampleBatch, Viewpoint

Texture = Callable[[Tensor, Tensor], Tensor]


def smooth(x: Tensor, y: Tensor) -> Tensor:
    """Waves some 20 pixels of 128 long."""
    return 0.5 + 0.2 * torch.sin(40.0 * x) * torch.cos(30.0 * y)


def fine(x: Tensor, y: Tensor) -> Tensor:
    """Slanted stripes narrower than a pixel of 64."""
    return torch.where(torch.sin(300.0 * x + 170.0 * y) > 0, 0.9, 0.1)


@dataclass(frozen=True)
class Planes:
    """The scene.

    Attributes:
        texture: of the plane.
        pan: units a second that the camera moves to the right.
        square: units a second that a white square of a quarter of a unit moves to the right; None for no square.
    """

    texture: Texture = smooth
    pan: float = 0.0
    square: float | None = None

    def view(self, time_s: float) -> Viewpoint:
        """Instance 0 is the plane, instance 1 the square, on a track of its own."""
        moved = [0.0, 0.0, 0.0], [(self.square or 0.0) * time_s, 0.0, 0.5]
        return Viewpoint(
            time_s=time_s,
            track_of_instance=torch.tensor([0, 1]),
            rotation=torch.eye(3, dtype=torch.float64).expand(2, 3, 3),
            translation=torch.tensor(moved, dtype=torch.float64),
            to_camera=torch.eye(3, dtype=torch.float64),
            to_camera_offset=torch.tensor([-0.5 - self.pan * time_s, -0.5, -1.0], dtype=torch.float64),
            kind="parallel",
            tan_x=0.5,
            tan_y=0.5,
        )

    def color(self, x: Tensor, y: Tensor, time_s: Tensor) -> tuple[Tensor, Tensor]:
        """Colour, and whether the square is seen, at places of the image."""
        world_x, world_y = x + self.pan * time_s, 1.0 - y
        from_square = world_x - (self.square or 0.0) * time_s
        inside = (from_square >= 0.25) & (from_square < 0.5) & (world_y >= 0.25) & (world_y < 0.5)
        square = inside & (self.square is not None)
        value = torch.where(square, 1.0, self.texture(world_x, world_y))
        return value[..., None].expand(*x.shape, 3).to(torch.float32).contiguous(), square

    def image(self, side: int, time_s: float, samples_per_axis: int = 1) -> Tensor:
        """The picture, box-filtered over samples, ``(side, side, 3)``."""
        count = side * samples_per_axis
        along = ((torch.arange(count) + 0.5) / count).to(torch.float64)
        x, y = along[None].expand(count, count), along[:, None].expand(count, count)
        color = self.color(x, y, torch.tensor(time_s, dtype=torch.float64))[0].permute(2, 0, 1)[None]
        return torch.nn.functional.avg_pool2d(color, samples_per_axis)[0].permute(1, 2, 0)

    def trace(self, batch: FrameletBatch) -> SampleBatch:
        """The renderer."""
        x, y = batch.position.to(torch.float64).unbind(-1)
        color, square = self.color(x, y, batch.times)
        along = torch.where(square, (self.square or 0.0) * batch.times, 0.0)
        point = torch.stack([x + self.pan * batch.times - along, 1.0 - y, torch.zeros_like(x)], dim=-1)
        hits = Hits(square.to(torch.int32), point.to(torch.float32), torch.full_like(square, -1, dtype=torch.int32))
        return SampleBatch(color, {"primary_rays": x.numel()}, hits if batch.hits else None)
