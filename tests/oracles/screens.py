"""Scenes of flat layers before a camera of parallel rays: colours, first hits and poses, evaluated exactly.

The picture spans ``[0, 1)`` along both axes, as positions of samples do; in the world ``X = x - 0.5`` and
``Y = 0.5 - y``. A layer's space is the world turned and shifted by its pose.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import torch
from torch import Tensor

from tsar.types import FrameletBatch, Hits, SampleBatch, Viewpoint

Color = Callable[[Tensor, Tensor, Tensor], Tensor]
"""``(u, v, t) -> (…, 3)``: linear radiance of a layer at a place of its own, the picture's centre in the middle."""


def still(t: Tensor) -> tuple[Tensor, Tensor, Tensor]:
    """A pose, as angle and shift: none."""
    return torch.zeros_like(t), torch.zeros_like(t), torch.zeros_like(t)


@dataclass(frozen=True)
class Layer:
    """A flat thing: its colour, where it is there, and its pose: an angle, and a shift along x and y of the world."""

    color: Color
    inside: Callable[[Tensor, Tensor, Tensor], Tensor] = lambda u, v, t: torch.ones_like(u, dtype=torch.bool)
    pose: Callable[[Tensor], tuple[Tensor, Tensor, Tensor]] = still


@dataclass(frozen=True)
class Screen:
    """Layers, the nearest first, the last of which covers all; and the camera's shift along x and y of the world."""

    layers: Sequence[Layer]
    camera: Callable[[Tensor], tuple[Tensor, Tensor]] = lambda t: (torch.zeros_like(t), torch.zeros_like(t))

    def trace(self, batch: FrameletBatch) -> SampleBatch:
        x, y = batch.position.to(torch.float64).unbind(-1)
        t = batch.times.contiguous()
        shift = self.camera(t)
        world_x, world_y = x - 0.5 + shift[0], 0.5 - y + shift[1]
        color, point = torch.zeros(*x.shape, 3, dtype=torch.float64), torch.zeros(*x.shape, 3, dtype=torch.float64)
        instance = torch.zeros(x.shape, dtype=torch.int64)
        for number, layer in reversed([*enumerate(self.layers)]):
            angle, right, up = layer.pose(t)
            cos, sin = angle.cos(), angle.sin()
            u = cos * (world_x - right) + sin * (world_y - up)
            v = cos * (world_y - up) - sin * (world_x - right)
            there = layer.inside(u, v, t)
            color = torch.where(there[..., None], layer.color(u, v, t), color)
            place = torch.stack((u, v, torch.full_like(u, -1.0 - number)), dim=-1)
            point = torch.where(there[..., None], place, point)
            instance = torch.where(there, number, instance)
        seen = torch.full(instance.shape, -1, dtype=torch.int32)
        hits = Hits(instance.to(torch.int32), point.to(torch.float32), seen) if batch.hits else None
        return SampleBatch(color.to(torch.float32), {"primary_rays": x.numel()}, hits)

    def view(self, time_s: float) -> Viewpoint:
        t = torch.tensor(time_s, dtype=torch.float64)
        rotation, translation = [], []
        for layer in self.layers:
            angle, right, up = layer.pose(t)
            cos, sin, no, one = angle.cos(), angle.sin(), torch.zeros_like(t), torch.ones_like(t)
            rotation.append(torch.stack((cos, -sin, no, sin, cos, no, no, no, one)).reshape(3, 3))
            translation.append(torch.stack((right, up, no)))
        right, up = self.camera(t)
        return Viewpoint(
            time_s=time_s,
            track_of_instance=torch.arange(len(self.layers)),
            rotation=torch.stack(rotation),
            translation=torch.stack(translation),
            to_camera=torch.eye(3, dtype=torch.float64),
            to_camera_offset=-torch.stack((right, up, torch.zeros_like(t))),
            kind="parallel",
            tan_x=0.5,
            tan_y=0.5,
        )

    def picture(self, time_s: float, side: int, axis: int = 4) -> Tensor:
        """The picture as it should be: ``axis²`` samples a pixel, averaged; ``(side, side, 3)`` linear."""
        place = (torch.arange(side * axis) + 0.5) / (side * axis)
        grid = torch.stack(torch.meshgrid(place, place, indexing="xy"), dim=-1).to(torch.float32)
        nothing = torch.zeros(side * axis, dtype=torch.int64)
        color = self.trace(FrameletBatch(nothing, nothing, grid, time_s)).color
        return color.reshape(side, axis, side, axis, 3).mean((1, 3))
