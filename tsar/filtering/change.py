"""The rate at which the picture changes, observed from the residuals between new samples and the estimates in their
pixels."""

from __future__ import annotations

import torch
import torch.nn.functional as F
from jaxtyping import Bool, Float, Float64
from torch import Tensor

from tsar.filtering.options import FilterOptions
from tsar.filtering.records import ELEMENT_PX, VARIANCE_MAX, Change, Estimates
from tsar.roots import encoded

TOLERANCE = 4.0  # a squared residual beyond this many variances indicates change
SURE = 4.0  # an excess beyond this many expected residuals discards most of the memory
DROPPED = 0.1
RATE_MIN = 1e-5
SPAN_MIN_S = 1e-3
BETWEEN = 0.8  # share of the roughness by which a sample differs from the mean of a pixel
GAP_MOST_S = 1e3  # longer gaps fade as this one does
SHARE_NEAR, SHARE_AROUND = 0.5, 0.25  # shares of the greatest rates in 3 x 3 and 5 x 5 elements


def residuals(
    estimates: Estimates, color: Float[Tensor, "3 h w"], count: Float[Tensor, "1 h w"]
) -> tuple[Float[Tensor, "1 h w"], Float[Tensor, "1 h w"]]:
    """Residuals of new samples against the estimates, and the greatest that noise explains; variances.

    A pixel with ``k`` new samples has the residual ``d²``, the mean over the channels of the squared difference of
    encoded colours, and at most ``4 (g i / 2 + 0.8 g / k)`` is expected from noise, with ``g`` the roughness and ``i``
    the inverse of the estimate.

    Args:
        estimates: before the batch.
        color, count: mean and number of the new samples of each pixel.
    """
    red, green, blue = (encoded(color) - encoded(estimates.color)).square()
    expected = TOLERANCE * (estimates.observed + BETWEEN * estimates.roughness / count.clamp(min=1.0))
    return ((red + green + blue) / 3.0)[None], expected


def observed(
    before: Change,
    residual: Float[Tensor, "1 h w"],
    expected: Float[Tensor, "1 h w"],
    elapsed_s: Float64[Tensor, "1 h w"],
    compared: Bool[Tensor, "1 h w"],
    now_s: float,
    cycle_s: float,
    options: FilterOptions,
) -> Change:
    """The rates of change after a batch.

    Per element ``N <- f N + sum(residual - expected)`` and ``D <- f D + sum(time between the samples)``; the rate is
    ``max(N, 0) / D``, at least half of the greatest in the 3 x 3 elements around it and a quarter of the greatest in 5
    x 5. The factor ``f`` fades earlier observations; it is at most 0.1 where the residuals exceed the expected ones by
    far.

    Deviation: ``f = 1 / (1 + x + x²/2)``, where ``x`` is the time since the element was last sampled divided by
    ``memory_s``, in place of ``exp(-x)``, whose last bit depends on the processor.

    Args:
        before: change observed before the batch.
        residual, expected: residuals of new samples, and the greatest that noise explains.
        elapsed_s: time between the new samples of a pixel and the samples before them, seconds.
        compared: pixels that have both new and earlier samples.
        now_s, cycle_s: start of the cycle and length of the one before, seconds.
        options: options of the filter.
    """
    nothing = torch.zeros_like(residual)
    excess = _summed(torch.where(compared, residual - expected, nothing))
    usual = _summed(torch.where(compared, expected, nothing))
    span_s = _summed(torch.where(compared, elapsed_s.to(torch.float32), nothing))
    looked = F.max_pool2d(compared.to(torch.float32)[None], ELEMENT_PX)[0] > 0.0
    gap = (now_s - before.seen_s).clamp(0.0, GAP_MOST_S).to(torch.float32) / options.memory_s
    fade = 1.0 / (1.0 + gap + 0.5 * gap * gap)
    fade = torch.where(excess > SURE * usual, fade.clamp(max=DROPPED), fade)
    total = torch.where(looked, fade * before.excess + excess, before.excess)
    span = torch.where(looked, fade * before.span_s + span_s, before.span_s)
    seen_s = torch.where(looked, torch.full_like(before.seen_s, now_s), before.seen_s)
    own = total.clamp(min=0.0) / span.clamp(min=SPAN_MIN_S)
    rate = own
    if options.spread:
        rate = torch.maximum(rate, SHARE_NEAR * F.max_pool2d(own[None], 3, 1, 1)[0])
        rate = torch.maximum(rate, SHARE_AROUND * F.max_pool2d(own[None], 5, 1, 2)[0])
    return Change(total, span, seen_s, rate.clamp(RATE_MIN, VARIANCE_MAX / cycle_s))


def _summed(pixels: Float[Tensor, "1 h w"]) -> Float[Tensor, "1 e e"]:
    return F.avg_pool2d(pixels[None], ELEMENT_PX)[0] * ELEMENT_PX**2
