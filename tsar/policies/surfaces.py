"""Surfaces of a frame: the first hit of every pixel, and its position in the view of another time."""

from __future__ import annotations

from dataclasses import dataclass

import torch
from jaxtyping import Bool, Float, Float64, Int
from torch import Tensor

from tsar.projection import project
from tsar.types import Viewpoint

PROJECT_FLOPS = 42.0
"""Operations of :func:`seen` per pixel: 18 for the three camera coordinates, 10 for the position on the image, 2 for
the tests of depth, 4 for the conversion to pixels, 4 for the offset, 4 for the sample's position."""


@dataclass(frozen=True)
class Surfaces:
    """First hits of a frame with one sample per pixel, raster order.

    Attributes:
        instance, point: as in :class:`tsar.types.Hits`.
        jitter_px: offset ``(x, y)`` of the samples from the centres of their pixels, pixels.
    """

    instance: Int[Tensor, "h w"]
    point: Float[Tensor, "h w 3"]
    jitter_px: tuple[float, float] = (0.0, 0.0)


def seen(surfaces: Surfaces, view: Viewpoint) -> tuple[Float64[Tensor, "h w 2"], Float64[Tensor, "h w"]]:
    """Position and depth at which another view shows the centre of each pixel.

    The centre of a pixel moves as its sample does.

    Returns:
        Positions in pixels, as in :mod:`tsar.policies.resampling`, and depths, scene units. Where the view does not
        show it, the position is NaN and the depth at most 0.
    """
    height, width = surfaces.instance.shape
    position, depth = project(view, surfaces.instance, surfaces.point)
    beside = torch.tensor(surfaces.jitter_px, dtype=torch.float64)
    return position * position.new_tensor((width, height)) - 0.5 - beside, depth


def centres(height: int, width: int) -> Float64[Tensor, "h w 2"]:
    """Positions of the pixels' centres."""
    row, column = (torch.arange(count, dtype=torch.float64) for count in (height, width))
    return torch.stack([column[None].expand(height, width), row[:, None].expand(height, width)], dim=-1)


def within(place: Float64[Tensor, "h w 2"]) -> Bool[Tensor, "h w"]:
    """Mask of the positions that lie on a picture with as many pixels as there are positions."""
    height, width = place.shape[:2]
    return ((place >= -0.5) & (place < place.new_tensor((width, height)) - 0.5)).all(-1)
