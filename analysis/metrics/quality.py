"""Errors of the image on a display against a reference, as a stream that holds two images at a time.

The main error is the MSE of display-encoded images (sRGB, clipped to [0, 1]). It is the error that a viewer sees. It is
bounded, so a highlight a hundred times brighter than white cannot dominate the rest of the picture as it would in
linear radiance. The MSE of log-compressed radiance is the second error; it keeps the differences that clipping hides.

Source: Stephens 2011, sec. 7.2.3.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Generic, TypeVar

import numpy as np
import torch
from jaxtyping import Float
from kornia.color import linear_rgb_to_rgb
from torch import Tensor

from analysis.command.cli import InputError
from analysis.metrics.arrays import Floats
from tsar.types import ShownImage, StepRecord

WHISKERS = 1.5
"""Greatest length of whiskers beyond the box, in interquartile ranges, in tables and figures."""
DRAWS = 4000
"""Bootstrap samples of an interval."""
INTERVAL = (2.5, 97.5)
"""Percentiles of the samples that bound an interval."""

Payload = TypeVar("Payload")


Shown = tuple[StepRecord | None, ShownImage]
"""A record, if the policy makes any, and its image."""


@dataclass(frozen=True)
class DisplayedImages:
    """The images on all displays at one reference time.

    Attributes:
        number: index of the reference time.
        time_s: simulated time, seconds.
        reference: ``(h, w, 3)`` linear RGB.
        shown: records and images of the cycles whose images are on the displays, by name of the run.
        mse: mean squared error of each run.
    """

    number: int
    time_s: float
    reference: Tensor
    shown: Mapping[str, Shown]
    mse: Mapping[str, float]


def reference_times(start_s: float, end_s: float, rate_hz: float) -> Floats:
    """Times of the reference images in ``[start_s, end_s)``: ``start_s + k / rate_hz``.

    Raises:
        ValueError: the span or the rate is not positive.
    """
    if not (end_s > start_s and rate_hz > 0):
        raise ValueError(
            f"reference times: expected end_s > start_s and rate_hz > 0, got {start_s}, {end_s}, {rate_hz}"
        )
    # rounding, so that 0.3 s at 60 Hz have 18 images, not 19
    return start_s + np.arange(math.ceil(round((end_s - start_s) * rate_hz, 6))) / rate_hz


class Hold(Generic[Payload]):
    """The image on a display at any time: the last one that was put on it, unchanged until the next.

    Consumes a stream of images and holds two of them.

    Attributes:
        refresh_s: display times of the images that have been shown so far, seconds.
        nonfinite: number of non-finite values in these images.
    """

    def __init__(self, displays: Iterable[tuple[Payload, ShownImage]]) -> None:
        self._stream: Iterator[tuple[Payload, ShownImage]] = iter(displays)
        self._current: tuple[Payload, ShownImage] | None = None
        self._next = next(self._stream, None)
        self.refresh_s: list[float] = []
        self.nonfinite = 0

    def at(self, time_s: float) -> tuple[Payload, ShownImage]:
        """The image on the display at ``time_s``; times must not decrease.

        Raises:
            InputError: no image has been displayed by then.
        """
        while self._next is not None and self._next[1].display_time_s <= time_s:
            self._current = self._next
            shown = self._current[1]
            self.refresh_s.append(shown.display_time_s)
            self.nonfinite += int((~torch.isfinite(shown.image)).sum())
            self._next = next(self._stream, None)
        if self._current is None:
            raise InputError(f"warmup_cycles: expected enough for an image at {time_s:.4f} s, nothing is shown yet")
        return self._current


def encode(image: Float[Tensor, "h w 3"]) -> Float[Tensor, "h w 3"]:
    """Linear radiance encoded for a display: clipped to [0, 1] and sRGB-encoded."""
    return linear_rgb_to_rgb(image.clamp(0.0, 1.0).permute(2, 0, 1)).permute(1, 2, 0)


@dataclass(frozen=True)
class PixelErrors:
    """Errors of one image.

    Attributes:
        mse: MSE of display-encoded values in [0, 1], mean over pixels and channels.
        log_mse: MSE of ``log(1 + radiance)``.
        nonfinite: number of non-finite values in the image; they count as 0.
    """

    mse: float
    log_mse: float
    nonfinite: int


def pixel_errors(
    image: Float[Tensor, "h w 3"], reference: Float[Tensor, "h w 3"], encoded: Float[Tensor, "h w 3"] | None = None
) -> tuple[PixelErrors, Float[Tensor, "h w 3"]]:
    """Mean squared errors of an image against the reference, both linear.

    ``mse = Σ (encode(image) - encode(reference))² / (3 h w)``, and the same with ``log(1 + x)`` in place of the
    encoding. Source: Stephens 2011, eq. 7.1.

    Deviation: the mean runs over pixels and channels; the printed ``1 / N`` before ``N²`` terms would scale with size.

    Args:
        image: the image on the display.
        reference: the reference.
        encoded: ``encode(reference)``, if it is known already.

    Returns:
        The errors, and ``encode(image)``.

    Raises:
        ValueError: the shapes differ.
    """
    if image.shape != reference.shape:
        raise ValueError(f"pixel_errors: expected equal shapes, got {tuple(image.shape)} and {tuple(reference.shape)}")
    bad = int((~torch.isfinite(image)).sum())
    if bad:
        image = torch.nan_to_num(image, nan=0.0, posinf=0.0, neginf=0.0)
    shown = encode(image)
    mse = float((shown - (encode(reference) if encoded is None else encoded)).square().mean(dtype=torch.float64))
    compressed = image.clamp(min=0).log1p() - reference.clamp(min=0).log1p()
    return PixelErrors(mse, float(compressed.square().mean(dtype=torch.float64)), bad), shown


def ratio(adaptive: Floats, framed: Floats) -> Floats:
    """``mse_adaptive / mse_framed``; 1 where both are 0, infinite where only the framed one is 0, NaN where either is
    NaN.

    Source: Stephens 2011, eq. 7.2.
    """
    adaptive, framed = np.asarray(adaptive, np.float64), np.asarray(framed, np.float64)
    quotient = np.full(adaptive.shape, np.inf)
    np.divide(adaptive, framed, out=quotient, where=framed != 0)
    quotient[(adaptive == 0) & (framed == 0)] = 1.0
    return quotient


def percentile(ordered: Floats, percent: float) -> float:
    """Percentile of sorted values with linear interpolation; an infinite upper neighbour makes it infinite."""
    position = percent / 100.0 * (len(ordered) - 1)
    low = int(position)
    share = position - low
    if share == 0.0:
        return float(ordered[low])
    if math.isinf(ordered[low + 1]):
        return math.inf
    return float(ordered[low] + share * (ordered[low + 1] - ordered[low]))


def suitable_percentile(ratios: Floats) -> float:
    """Greatest ``p`` in [0, 100] such that the ``p``-th percentile of the ratios is at most 1.

    With linear interpolation the percentile is continuous and increasing in ``p``, so the greatest one lies where the
    line between two neighbours crosses 1. It is 100 if all ratios are at most 1, and 0 if none is.

    Source: Stephens 2011, sec. 7.2.5 and table 7.2.

    Raises:
        ValueError: there are no ratios, or some are NaN.
    """
    ordered = _sorted(ratios)
    below = int(np.searchsorted(ordered, 1.0, side="right"))
    if below == 0:
        return 0.0
    if below == len(ordered):
        return 100.0
    last, following = ordered[below - 1], ordered[below]
    share = 0.0 if math.isinf(following) else (1.0 - last) / (following - last)
    return float(100.0 * (below - 1 + share) / (len(ordered) - 1))


@dataclass(frozen=True)
class RatioStatistics:
    """Box-plot statistics of the ratio over the reference times (figs 7.10–7.13)."""

    count: int
    median: float
    quartile_low: float
    quartile_high: float
    whisker_low: float
    """Least ratio within 1.5 interquartile ranges of the box."""
    whisker_high: float
    """Greatest ratio within 1.5 interquartile ranges of the box."""
    outliers: int
    """Ratios beyond the whiskers."""
    infinite: int
    """Times at which only the framed error was 0."""
    both_zero: int
    """Times at which both errors were 0."""
    share_suitable: float
    """Share of the ratios that are at most 1."""
    suitable_percentile: float


def ratio_statistics(adaptive: Floats, framed: Floats) -> RatioStatistics:
    """Statistics of the ratio of two error traces."""
    adaptive, framed = np.asarray(adaptive, np.float64), np.asarray(framed, np.float64)
    ratios = ratio(adaptive, framed)
    ordered = _sorted(ratios)
    low, median, high = (percentile(ordered, p) for p in (25.0, 50.0, 75.0))
    reach = WHISKERS * (high - low) if math.isfinite(low) else 0.0
    inside = ordered[(ordered >= low - reach) & (ordered <= high + reach)]
    return RatioStatistics(
        count=len(ordered),
        median=median,
        quartile_low=low,
        quartile_high=high,
        whisker_low=float(inside[0]),
        whisker_high=float(inside[-1]),
        outliers=len(ordered) - len(inside),
        infinite=int(np.isinf(ratios).sum()),
        both_zero=int(((adaptive == 0) & (framed == 0)).sum()),
        share_suitable=float((ratios <= 1.0).mean()),
        suitable_percentile=suitable_percentile(ratios),
    )


def _sorted(ratios: Floats) -> Floats:
    ratios = np.asarray(ratios, np.float64)
    if ratios.size == 0 or np.isnan(ratios).any():
        raise ValueError(
            f"ratios: expected at least one and no NaN, got {ratios.size} with {np.isnan(ratios).sum()} NaN"
        )
    return np.sort(ratios)
