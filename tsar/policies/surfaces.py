"""What a frame shows where: the first hit of every pixel, and where it is seen at another time."""

from __future__ import annotations

from dataclasses import dataclass

import torch
from jaxtyping import Float, Float64, Int
from torch import Tensor

from tsar.projection import project
from tsar.types import Viewpoint

PROJECT_FLOPS = 42.0
"""Of :func:`seen` for a pixel: 18 for the three coordinates before the camera, 10 for the position on the image, 2 for
the tests of depth, 4 to pixels, 4 for the offset, 4 for the sample's place."""


@dataclass(frozen=True)
class Surfaces:
    """First hits of a frame with one sample a pixel, raster order.

    Attributes:
        instance, point: as in :class:`tsar.types.Hits`.
        jitter_px: where the samples lie beside the centres of their pixels, ``(x, y)``, pixels.
    """

    instance: Int[Tensor, "side side"]
    point: Float[Tensor, "side side 3"]
    jitter_px: tuple[float, float] = (0.0, 0.0)


def seen(surfaces: Surfaces, view: Viewpoint) -> tuple[Float64[Tensor, "side side 2"], Float64[Tensor, "side side"]]:
    """Where the centre of each pixel is seen by another view, and how deep.

    A pixel's centre moves as its sample does.

    Returns:
        Positions in pixels, as in :mod:`tsar.policies.resampling`, and depths, scene units; NaN and 0 or below where
        the view does not see it.
    """
    side = surfaces.instance.shape[0]
    position, depth = project(view, surfaces.instance, surfaces.point)
    beside = torch.tensor(surfaces.jitter_px, dtype=torch.float64)
    return position * side - 0.5 - beside, depth


def centres(side: int) -> Float64[Tensor, "side side 2"]:
    """Positions of the pixels' centres."""
    along = torch.arange(side, dtype=torch.float64)
    return torch.stack([along[None].expand(side, side), along[:, None].expand(side, side)], dim=-1)
