"""State of the filter in every pixel, and its constants."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import inf

import torch
from jaxtyping import Bool, Float, Float64, Int64
from torch import Tensor

TILE_SIDE = 8
"""Samples along a tile's side."""
SPACINGS = (8.0, 4.0, 2.0, 1.0, 0.5)
"""Distances between samples in the tiles that can be requested, pixels, coarsest first; a tile is 8 of them wide."""
ELEMENT_PX = 4
"""Pixels along a side of the elements in which change is observed."""
VARIANCE_MAX = 0.1
"""Variance of a pixel without information, in squared encoded colour."""
NOTHING_KNOWN = 10.0
"""Variance assumed for display once that of a pixel has reached :data:`VARIANCE_MAX`: the pixel takes the colour of its
surroundings alone."""
UNSEEN = -2
"""Instance of a pixel without a surfel; -1 stands for infinity."""


@dataclass(frozen=True)
class Estimates:
    """Estimates of the pixels of the output, raster order. Colours are linear; variances are those of the encoded
    colour, ``sqrt`` of the colour clipped to [0, 1], averaged over the channels.

    Attributes:
        color: mean colour.
        aged: variance of its error from change since it was sampled.
        inverse: reciprocal of the effective number of samples.
        time_s: animation time of the newest sample; ``-inf`` where there is none.
        roughness: semivariance per pixel of distance, at least 1e-6.
    """

    color: Float[Tensor, "3 h w"]
    aged: Float[Tensor, "1 h w"]
    inverse: Float[Tensor, "1 h w"]
    time_s: Float64[Tensor, "1 h w"]
    roughness: Float[Tensor, "1 h w"]

    @property
    def known(self) -> Bool[Tensor, "1 h w"]:
        return self.time_s > -inf

    @property
    def observed(self) -> Float[Tensor, "1 h w"]:
        """Variance of the mean of the samples, ``g i / 2``: half the roughness times the inverse."""
        return 0.5 * self.roughness * self.inverse

    @property
    def variance(self) -> Float[Tensor, "1 h w"]:
        """Variance of the error of its colour, at most :data:`VARIANCE_MAX`."""
        return (self.aged + self.observed).clamp(max=VARIANCE_MAX)

    def later(self, rate: Float[Tensor, "1 e e"], seconds: float) -> Estimates:
        """The estimates ``seconds`` later, which age at ``rate``, variance per second of each element."""
        return replace(self, aged=(self.aged + by_pixels(rate) * seconds).clamp(max=VARIANCE_MAX))

    def beside(self, surfels: Surfels) -> Estimates:
        """The estimates with the additional variance of surfels that lie beside their pixels."""
        return replace(self, aged=self.aged + self.roughness * surfels.outside_px)

    @staticmethod
    def empty(side: int) -> Estimates:
        plane, one = torch.full((1, side, side), VARIANCE_MAX), torch.ones(1, side, side)
        nothing = torch.full((1, side, side), -inf, dtype=torch.float64)
        return Estimates(torch.zeros(3, side, side), plane, one, nothing, 1e-2 * one)


@dataclass(frozen=True)
class Surfels:
    """The surface element of every pixel, for estimates that move. A surfel may lie up to a pixel outside its pixel.

    Attributes:
        instance: instance of the first hit, -1 at infinity, :data:`UNSEEN` where there is none.
        point: first hit in the space of the instance's track, or the direction to infinity.
        position: position on the image, pixels.
        step: its displacement on the image in the last cycle, pixels.
    """

    instance: Int64[Tensor, "1 h w"]
    point: Float[Tensor, "3 h w"]
    position: Float[Tensor, "2 h w"]
    step: Float[Tensor, "2 h w"]

    @staticmethod
    def empty(side: int) -> Surfels:
        unseen = torch.full((1, side, side), UNSEEN, dtype=torch.int64)
        return Surfels(unseen, torch.zeros(3, side, side), centres(side), torch.zeros(2, side, side))

    @property
    def outside_px(self) -> Float[Tensor, "1 h w"]:
        """Distance of each surfel from its pixel, pixels; the greater of both axes."""
        away = (self.position - centres(self.position.shape[-1])).abs().amax(0, keepdim=True)
        return (away - 0.5).clamp(min=0.0)


@dataclass(frozen=True)
class Change:
    """Observed change of every element.

    Attributes:
        excess: sum of squared residuals beyond those expected, faded.
        span_s: sum of the times between the samples that they compare, faded.
        seen_s: animation time at which an element was last sampled.
        rate: variance per second that estimates gain.
    """

    excess: Float[Tensor, "1 e e"]
    span_s: Float[Tensor, "1 e e"]
    seen_s: Float64[Tensor, "1 e e"]
    rate: Float[Tensor, "1 e e"]

    @staticmethod
    def empty(side: int) -> Change:
        elements = side // ELEMENT_PX
        none = torch.zeros(1, elements, elements)
        never = torch.full((1, elements, elements), -inf, dtype=torch.float64)
        return Change(none, none, never, torch.full((1, elements, elements), VARIANCE_MAX))

    @property
    def rate_px(self) -> Float[Tensor, "1 h w"]:
        """The rate of every pixel."""
        return by_pixels(self.rate)


def by_pixels(element: Float[Tensor, "1 e e"]) -> Float[Tensor, "1 h w"]:
    """The value of each element, repeated in all its pixels."""
    return element.repeat_interleave(ELEMENT_PX, 1).repeat_interleave(ELEMENT_PX, 2)


def centres(side: int) -> Float[Tensor, "2 h w"]:
    """Centres of the pixels, ``(x, y)``, pixels."""
    at = torch.arange(side) + 0.5
    return torch.stack((at.expand(side, side), at[:, None].expand(side, side)))
