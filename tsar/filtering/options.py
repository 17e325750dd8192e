"""Options of the filter; without torch, so that a command can name them before it loads that."""

from __future__ import annotations

from dataclasses import dataclass
from math import sqrt

SMALL_PX = 256
"""Side of a square picture below which cycles are longer, pixels."""


@dataclass(frozen=True)
class FilterOptions:
    """Switches and constants of the filter. They were chosen on the five inputs at phase 0 and are used for all scenes.

    Attributes:
        reprojection: whether estimates move with the surfaces that they belong to.
        prediction: whether steady motion is continued to the middle of the time for which the picture is displayed.
        smoothing: whether uncertain pixels are blended with their surroundings when they are shown.
        accumulation: whether samples are averaged over time; otherwise the newest replaces the estimate.
        jitter: whether samples move within their pixels from cycle to cycle.
        by_gain: whether tiles are chosen by their gain; otherwise pixels are sampled in turn.
        spread: whether change is expected beside elements that changed.
        shadows: whether change is expected in the shadows of moving objects.
        probes: whether some tiles sample places where no change is expected.
        latency_cycles: cycles from the start of a cycle to the display of its picture, at least 1.
        noise: whether noise is told from detail, in scenes whose samples draw random numbers.
        wavelets: whether roughness and change are measured by the wavelets of the dissertation.
        share_max: maximum number of samples of a cycle, as a share of the output's pixels, in pictures of at least
            :data:`SMALL_PX` squared; a larger batch is divided into several cycles.
        footprint: number of samples along a pixel's side for which textures are filtered.
        life_min_s, life_max_s: bounds of the time for which a sample is assumed to be useful, seconds.
        reach: distance after which a moving surface is assumed to be out of sight, as a share of the image's side.
        memory_s: time constant of the memory of observed change, seconds.
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
    noise: bool = True
    latency_cycles: int = 1
    wavelets: bool = False
    share_max: float = 1.0 / 32.0
    footprint: int = 4
    life_min_s: float = 0.2
    life_max_s: float = 4.0
    reach: float = 0.125
    memory_s: float = 0.2

    def samples_max(self, pixels: int) -> int:
        """Maximum number of samples of a cycle in a picture of so many pixels.

        Below ``SMALL_PX`` squared the share grows with the root of ``SMALL_PX`` over the side: at 64 x 64 pixels longer
        cycles have less error (docs/results/rivals.md).
        """
        longer = sqrt(SMALL_PX / sqrt(min(pixels, SMALL_PX**2)))
        return min(pixels, int(self.share_max * longer * pixels))


DEFAULT = FilterOptions()
