"""Common parts of policies of single samples: scattered requests, a buffer of the newest sample per pixel, its
display."""

from __future__ import annotations

from dataclasses import dataclass
from math import log2

import torch
import torch.nn.functional as F
from jaxtyping import Float, Int64
from torch import Tensor

from tsar.config import TsarConfig
from tsar.error import replace_nonfinite
from tsar.policies.resampling import double_width
from tsar.policy import Moment
from tsar.roots import square_root
from tsar.types import FrameletBatch, SampleBatch, SampleMap


@dataclass(frozen=True)
class PixelBuffer:
    """Newest sample per output pixel, raster order; changes in place.

    Attributes:
        color: ``(height * width, 3)`` float32.
        time_s: ``(height * width,)`` float64, ``-inf`` where nothing has been sampled yet.
    """

    color: Float[Tensor, "pixels 3"]
    time_s: Float[Tensor, " pixels"]

    @staticmethod
    def empty(config: TsarConfig) -> PixelBuffer:
        pixels = config.pixels
        return PixelBuffer(torch.zeros(pixels, 3), torch.full((pixels,), -torch.inf, dtype=torch.float64))


def sample_map(buffer: PixelBuffer, config: TsarConfig) -> SampleMap:
    """The sample map of a buffer: one sample per pixel, each with its own time."""
    level = torch.full(config.shape, int(log2(config.resolution_px / config.framelet_side)))
    return SampleMap(buffer.time_s.reshape(config.shape).clone(), level)


def generator(config: TsarConfig, cycle: int) -> torch.Generator:
    """Random number generator of one cycle, a function of seed and cycle only."""
    return torch.Generator().manual_seed((config.seed * 1_000_003 + cycle + 500_000) % 2**63)


def pixel_batch(pixel: Int64[Tensor, " samples"], config: TsarConfig, moment: Moment) -> FrameletBatch:
    """A batch of samples at the centres of output pixels (raster indices), grouped into framelets. The number of pixels
    must be a multiple of ``config.samples``."""
    height, width = config.shape
    position = torch.stack((pixel % width, pixel // width), dim=1).to(torch.float32).add_(0.5)
    position = (position / position.new_tensor((width, height))).reshape(-1, config.samples, 2)
    nothing = torch.zeros(position.shape[0], dtype=torch.int64)
    return FrameletBatch(nothing, nothing, position, moment.time_s, cycle=moment.cycle, seed=config.seed)


def pixel_colors(samples: SampleBatch, config: TsarConfig) -> Float[Tensor, "samples 3"]:
    """Colours of such a batch, one row per pixel. Non-finite samples are replaced as in the adaptive pipeline."""
    return replace_nonfinite(samples.color, config.framelet_side)[0].reshape(-1, 3)


def write(
    buffer: PixelBuffer, pixel: Int64[Tensor, " samples"], color: Float[Tensor, "samples 3"], time_s: float
) -> None:
    """Writes samples into the buffer; where a pixel occurs twice, the last sample stays."""
    last = torch.full(buffer.time_s.shape, -1).scatter_reduce(0, pixel, torch.arange(pixel.numel()), "amax")
    hit = (last >= 0).nonzero().squeeze(1)
    buffer.color[hit] = color[last[hit]]
    buffer.time_s[hit] = time_s


def pull_push(color: Float[Tensor, "c h w"], weight: Float[Tensor, "1 h w"]) -> Float[Tensor, "c h w"]:
    """Fills an image by pull and push over a pyramid. A pixel of weight 1 keeps its colour; one of less weight is
    blended with the coarser level, whose weights are the sums over its children, at most 1. The weight outside the
    picture is 0."""
    height, width = color.shape[1:]
    side = 1 << (max(height, width) - 1).bit_length()
    if (height, width) != (side, side):
        beyond = (0, side - width, 0, side - height)
        return pull_push(F.pad(color, beyond), F.pad(weight, beyond))[:, :height, :width].contiguous()
    if side == 1:
        return color
    total = 4.0 * F.avg_pool2d(weight[None], 2)[0]
    mean = 4.0 * F.avg_pool2d((color * weight)[None], 2)[0] / total.clamp(min=1e-12)
    coarse = pull_push(mean, total.clamp(max=1.0))
    fine = double_width(double_width(coarse).transpose(1, 2)).transpose(1, 2)
    return weight * color + (1.0 - weight) * fine


def filled(color: Float[Tensor, "c h w"], weight: Float[Tensor, "1 h w"]) -> Float[Tensor, "c h w"]:
    """:func:`pull_push` of the square roots of colours, as of :func:`tsar.filtering.display.smoothed`. Of the policies
    that fill pictures, ``interruptible`` alone has less error with it (docs/results/rivals.md)."""
    root = pull_push(square_root(color.clamp(min=0.0)), weight)
    return root * root
