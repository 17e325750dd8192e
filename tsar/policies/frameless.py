"""Frameless rendering: each batch samples pixels in random order over the image and is shown at once.

Source: Bishop et al. 1994, as described in Stephens 2011, sec. 2.5.
"""

from __future__ import annotations

from dataclasses import dataclass

import torch
from jaxtyping import Float, Int64
from torch import Tensor

from tsar.clock import StageTimer
from tsar.config import TsarConfig
from tsar.policies.scatter import PixelBuffer, generator, pixel_batch, pixel_colors, pull_push, sample_map, write
from tsar.policy import Moment, Picture, Policy, Price
from tsar.types import FrameletBatch, SampleBatch


@dataclass(frozen=True)
class Sweep:
    """The newest sample of each pixel, the requested pixels, and those still to be visited.

    Frozen, except that the buffer changes in place.
    """

    buffer: PixelBuffer
    asked: Int64[Tensor, " samples"]
    queue: Int64[Tensor, " left"]


class Frameless(Policy[Sweep]):
    """Every pixel is visited once per sweep, each sweep in a new random order.

    The price is that of the samples and of the four operations that store each. Filling holes is not charged, because
    none are left after the first sweep.
    """

    @property
    def price(self) -> Price:
        return Price(int(self.config.budget), sample_flops=4.0)

    def start(self) -> Sweep:
        nothing = torch.empty(0, dtype=torch.int64)
        return Sweep(PixelBuffer.empty(self.config), nothing, nothing)

    def request(self, state: Sweep, moment: Moment) -> tuple[Sweep, FrameletBatch]:
        """The next ``batch_size * s²`` pixels of the sweep."""
        config, count, queue = self.config, int(self.config.budget), state.queue
        while queue.numel() < count:
            sweep = torch.randperm(config.pixels, generator=generator(config, moment.cycle + queue.numel()))
            queue = torch.cat((queue, sweep))
        asked = queue[:count]
        return Sweep(state.buffer, asked, queue[count:]), pixel_batch(asked, config, moment)

    def observe(
        self, state: Sweep, batch: FrameletBatch, samples: SampleBatch, moment: Moment, timer: StageTimer
    ) -> Sweep:
        with timer("cache"):
            write(state.buffer, state.asked, pixel_colors(samples, self.config), moment.time_s)
        return state

    def image(self, state: Sweep, moment: Moment) -> Picture:
        return Picture(_image(state.buffer, self.config), sample_map(state.buffer, self.config))


def _image(buffer: PixelBuffer, config: TsarConfig) -> Float[Tensor, "h w 3"]:
    height, width = config.shape
    color = buffer.color.reshape(height, width, 3)
    known = torch.isfinite(buffer.time_s).reshape(1, height, width)
    if bool(known.all()):
        return color.clone()
    return pull_push(color.permute(2, 0, 1), known.to(torch.float32)).permute(1, 2, 0).contiguous()
