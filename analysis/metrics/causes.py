"""Causes of the difference between an image and the reference: aliasing, blur and lag; and its flicker.

With D the image on the display, R the reference now, R' the reference at the age of the samples shown in each place,
and B the part of R' that samples of the density shown can carry, all display-encoded,

    D - R = (D - B) + (B - R') + (R' - R)
          = aliasing + blur + lag.

Older samples that are blended into D also count in the first term. The mean squares of the three terms do not add up to
that of the sum: twice the sum of their products remains and is reported as ``mixed``. R' is the nearest reference image
in time, so lag is known to half the interval of the reference.

*Flicker* is not a fourth part: it is the share of the error that changes from one reference time to the next where the
picture stands still, half its mean squared change.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable
from dataclasses import dataclass

import torch
import torch.nn.functional as F
from jaxtyping import Bool, Float, Int64
from torch import Tensor

from analysis.metrics.quality import encode
from tsar.types import SampleMap

CAUSES = ("aliasing", "blur", "lag", "mixed")
REGIONS = ("still plain", "still detailed", "moving plain", "moving detailed")

_STILL = 2.0 / 255.0
_PLAIN = 8.0 / 255.0
_KEPT = 48

Images = Callable[[int], Float[Tensor, "h w 3"]]
"""``number -> reference image``, linear RGB."""


@dataclass(frozen=True)
class Split:
    """The causes of one image's error.

    Attributes:
        causes: mean of each of :data:`CAUSES` over the known pixels and all channels; they sum to ``mse``.
        regions: the same for each region, as sums over its pixels divided by all known pixels, so that regions add up.
        share: share of the known pixels in each region.
        mse: mean squared error of the known pixels.
        known: share of the pixels whose truth at their own age is known; it is unknown for samples older than the
            first reference image.
    """

    causes: dict[str, float]
    regions: dict[str, dict[str, float]]
    share: dict[str, float]
    mse: float
    known: float


class Truths:
    """Reference images by number, with the newest kept in memory. Changes in place."""

    def __init__(self, images: Images, start_s: float, rate_hz: float, count: int) -> None:
        self._images, self._start_s, self._rate_hz, self.count = images, start_s, rate_hz, count
        self._kept: OrderedDict[int, Tensor] = OrderedDict()

    def image(self, number: int) -> Float[Tensor, "h w 3"]:
        """Linear reference image."""
        if number not in self._kept:
            self._kept[number] = self._images(number)
            if len(self._kept) > _KEPT:
                self._kept.popitem(last=False)
        return self._kept[number]

    def nearest(self, time_s: Float[Tensor, "*n"]) -> tuple[Int64[Tensor, "*n"], Bool[Tensor, "*n"]]:
        """Number of the reference image nearest to each time, and whether the time lies within the reference."""
        number = torch.floor((time_s - self._start_s) * self._rate_hz + 0.5)
        known = (number >= 0) & (number < self.count)
        return torch.where(known, number, 0.0).to(torch.int64), known

    def at(self, time_s: float) -> Float[Tensor, "h w 3"]:
        """Nearest reference image; before and after all of them, the first and the last."""
        number = round((time_s - self._start_s) * self._rate_hz)
        return self.image(min(max(number, 0), self.count - 1))

    def of_age(self, samples: SampleMap, side: int) -> tuple[Float[Tensor, "h w 3"], Bool[Tensor, "h w"]]:
        """The truth in each place at the time of the newest sample shown there, and the places where it is known."""
        number, known = self.nearest(samples.newest_s)
        number, known = _to_pixels(number, side), _to_pixels(known, side)
        image = torch.zeros(side, side, 3)
        for one in number[known].unique().tolist():
            image = torch.where((number == one)[..., None], self.image(one), image)
        return image, known


def _to_pixels(field: Tensor, side: int) -> Tensor:
    repeat = side // field.shape[0]
    return field.repeat_interleave(repeat, 0).repeat_interleave(repeat, 1)


def carried(image: Float[Tensor, "h w 3"], level: Int64[Tensor, "side side"], framelet_side: int) -> Tensor:
    """The part of an image that samples of a tile's density at each level carry: box averages, bilinear in between.

    Where samples are at most a pixel apart, that is the image itself.
    """
    side = image.shape[0]
    pixels, result = _to_pixels(level, side), image
    planes = image.permute(2, 0, 1)[None]
    for one in level.unique().tolist():
        spacing = side // (framelet_side << one)
        if spacing > 1:
            coarse = F.avg_pool2d(planes, spacing)
            smooth = F.interpolate(coarse, (side, side), mode="bilinear", align_corners=False)
            result = torch.where((pixels == one)[..., None], smooth[0].permute(1, 2, 0), result)
    return result


def regions_of(now: Float[Tensor, "h w 3"], before: Float[Tensor, "h w 3"]) -> Int64[Tensor, "h w"]:
    """Region of each pixel, an index into :data:`REGIONS`, from two encoded reference images.

    A pixel is moving if a channel changes by more than two of 255 steps at some pixel of the 9 x 9 pixels around it. It
    is detailed if a channel varies by more than eight steps over the 3 x 3 pixels around one of these pixels.
    """
    moving = (now - before).abs().amax(2) > _STILL
    planes = now.permute(2, 0, 1)[None]
    spread = F.max_pool2d(planes, 3, 1, 1) + F.max_pool2d(-planes, 3, 1, 1)
    detailed = spread.amax(1)[0] > _PLAIN
    near = [F.max_pool2d(mask[None, None].float(), 9, 1, 4)[0, 0] > 0 for mask in (moving, detailed)]
    return 2 * near[0].long() + near[1].long()


def split(
    shown: Float[Tensor, "h w 3"], samples: SampleMap, number: int, truths: Truths, framelet_side: int, step: int
) -> Split:
    """Causes of the error of one linear image at reference time ``number``.

    Args:
        shown: image on the display.
        samples: age and density of its samples.
        number: number of the reference time.
        truths: reference images.
        framelet_side: samples along a framelet's side.
        step: number of reference images back with which the image is compared to find motion.
    """
    side = shown.shape[0]
    old, known = truths.of_age(samples, side)
    held = encode(carried(old, samples.level, framelet_side))
    now, old_shown = encode(truths.image(number)), encode(old)
    parts = {"aliasing": encode(shown) - held, "blur": held - old_shown, "lag": old_shown - now}
    squares = {name: part.square().mean(2, dtype=torch.float64) for name, part in parts.items()}
    whole = (encode(shown) - now).square().mean(2, dtype=torch.float64)
    squares["mixed"] = whole - squares["aliasing"] - squares["blur"] - squares["lag"]
    region = regions_of(now, encode(truths.image(max(number - step, 0))))
    masks = {name: (region == place) & known for place, name in enumerate(REGIONS)}
    count = max(int(known.sum()), 1)

    def means(mask: Tensor) -> dict[str, float]:
        return {name: float(squares[name][mask].sum()) / count for name in CAUSES}

    return Split(
        causes=means(known),
        regions={name: means(mask) for name, mask in masks.items()},
        share={name: int(mask.sum()) / count for name, mask in masks.items()},
        mse=float(whole[known].sum()) / count,
        known=float(known.float().mean()),
    )


def flicker(
    error: Float[Tensor, "h w 3"],
    error_before: Float[Tensor, "h w 3"],
    reference: Float[Tensor, "h w 3"],
    reference_before: Float[Tensor, "h w 3"],
) -> float:
    """Half the mean squared change of the error where the reference stands still, over all pixels.

    For an error that is independent from one time to the next this is its variance. All images are display-encoded.
    """
    still = ((reference - reference_before).abs().amax(2) <= _STILL).to(torch.float64)
    change = (error - error_before).square().mean(2, dtype=torch.float64)
    return float((0.5 * change * still).mean())
