"""What the filter knows of every pixel, and its constants."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import inf

import torch
from jaxtyping import Bool, Float, Float64, Int64
from torch import Tensor

TILE_SIDE = 8
"""Samples along a tile's side."""
SPACINGS = (8.0, 4.0, 2.0, 1.0, 0.5)
"""Pixels from one sample to the next in the tiles that can be asked for, coarsest first; a tile is 8 of them wide."""
ELEMENT_PX = 4
"""Pixels along a side of the elements in which change is observed."""
VARIANCE_MAX = 0.1
"""Variance of a pixel that nothing is known of, in squared encoded colour."""
NOTHING_KNOWN = 10.0
"""Variance at which a pixel is shown whose own has reached :data:`VARIANCE_MAX`: it takes its surroundings alone."""
UNSEEN = -2
"""Instance of a pixel without a surfel; -1 is what is seen at infinity."""


@dataclass(frozen=True)
class FilterOptions:
    """Parts of the filter and its constants. They were chosen on the five inputs at phase 0, and hold for all scenes.

    Attributes:
        reprojection: whether estimates move with the surfaces that they belong to.
        prediction: whether steady motion is continued to the time at which the picture is first shown.
        smoothing: whether uncertain pixels are blended with their surroundings when they are shown.
        accumulation: whether samples are averaged over time; without, the newest replaces what was known.
        jitter: whether samples move within their pixels from cycle to cycle.
        by_gain: whether tiles are chosen by what they gain; without, pixels are sampled in turn.
        spread: whether change is expected beside elements that changed.
        shadows: whether change is expected where shadows of what moves lie.
        probes: whether a tile now and then looks where nothing is expected.
        latency_cycles: cycles from the start of one to the display of its picture, at least 1.
        wavelets: whether roughness and change are measured by the wavelets of the dissertation.
        share_max: most samples of a cycle, as a share of the output's pixels; a batch of more becomes several cycles.
        footprint: samples along a pixel's side that textures are filtered for.
        life_min_s, life_max_s: bounds of how long a sample is taken to be of use.
        reach: share of the image's side beyond which a surface that moves is taken to be out of sight.
        memory_s: how long observed change is remembered.
    """

    reprojection: bool = True
    prediction: bool = True
    smoothing: bool = True
    accumulation: bool = True
    jitter: bool = True
    by_gain: bool = True
    spread: bool = True
    shadows: bool = True
    probes: bool = True
    latency_cycles: int = 1
    wavelets: bool = False
    share_max: float = 1.0 / 32.0
    footprint: int = 4
    life_min_s: float = 0.2
    life_max_s: float = 4.0
    reach: float = 0.125
    memory_s: float = 0.2


DEFAULT = FilterOptions()


@dataclass(frozen=True)
class Estimates:
    """Of the pixels of the output, raster order. Colours are linear; variances are of ``sqrt`` of the colour clipped to
    [0, 1], averaged over the channels.

    Attributes:
        color: mean colour.
        aged: variance of its error by change since it was sampled.
        inverse: one over the number of samples that it is worth.
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
        """Variance of the mean of its samples: half the roughness for each of one."""
        return 0.5 * self.roughness * self.inverse

    @property
    def variance(self) -> Float[Tensor, "1 h w"]:
        """Variance of the error of its colour, at most :data:`VARIANCE_MAX`."""
        return (self.aged + self.observed).clamp(max=VARIANCE_MAX)

    def later(self, rate: Float[Tensor, "1 e e"], seconds: float) -> Estimates:
        """Some seconds later, at a rate of variance per second in each element."""
        return replace(self, aged=(self.aged + by_pixels(rate) * seconds).clamp(max=VARIANCE_MAX))

    def beside(self, surfels: Surfels) -> Estimates:
        """With the variance of surfels that lie beside their pixels."""
        return replace(self, aged=self.aged + self.roughness * surfels.outside_px)

    @staticmethod
    def empty(side: int) -> Estimates:
        plane, one = torch.full((1, side, side), VARIANCE_MAX), torch.ones(1, side, side)
        nothing = torch.full((1, side, side), -inf, dtype=torch.float64)
        return Estimates(torch.zeros(3, side, side), plane, one, nothing, 1e-2 * one)


@dataclass(frozen=True)
class Surfels:
    """The surface in every pixel, for estimates that move. A surfel may lie up to a pixel beside its pixel.

    Attributes:
        instance: of the first hit, -1 at infinity, :data:`UNSEEN` where there is none.
        point: in the space of the instance's track, or a direction.
        position: on the image, pixels.
        step: how far it moved on the image in the last cycle, pixels.
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
        """How far it lies beside its pixel, along the axis where that is most."""
        away = (self.position - centres(self.position.shape[-1])).abs().amax(0, keepdim=True)
        return (away - 0.5).clamp(min=0.0)


@dataclass(frozen=True)
class Change:
    """What was observed of change, by elements.

    Attributes:
        excess: sum of squared residuals beyond those expected, faded.
        span_s: sum of the times between the samples that they compare, faded.
        seen_s: animation time at which an element was last looked at.
        rate: variance per second by which estimates age.
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
        """The rate, by pixels."""
        return by_pixels(self.rate)


def by_pixels(element: Float[Tensor, "1 e e"]) -> Float[Tensor, "1 h w"]:
    """Each element's value in all its pixels."""
    return element.repeat_interleave(ELEMENT_PX, 1).repeat_interleave(ELEMENT_PX, 2)


def centres(side: int) -> Float[Tensor, "2 h w"]:
    """Centres of the pixels, ``(x, y)``."""
    at = torch.arange(side) + 0.5
    return torch.stack((at.expand(side, side), at[:, None].expand(side, side)))
