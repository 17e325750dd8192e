"""Frameless rendering: as many pixels as a batch has samples, in random order over the image, shown at once.

Source: Bishop et al. 1994, as described in Stephens 2011, sec. 2.5.
"""

from __future__ import annotations

import time
from collections.abc import Iterator

import torch
from jaxtyping import Float
from torch import Tensor

from tsar.baselines.scatter import PixelBuffer, generator, pull_push, render_pixels, sample_map, write
from tsar.clock import CycleSeconds, checked
from tsar.config import TsarConfig
from tsar.types import Display, Trace

LATENCY_CYCLES = 1
"""A sample is on the display as soon as its cycle is over."""


def run(
    config: TsarConfig, trace: Trace, cycle_seconds: CycleSeconds, start_s: float, end_s: float
) -> Iterator[Display]:
    """Cycles of ``batch_size * s²`` pixels. Every pixel is visited once per sweep, each sweep in a new random order.

    Warm-up cycles before ``start_s`` are yielded too. Arguments as :func:`tsar.pipeline.run`.
    """
    count = int(config.budget)
    queue = torch.empty(0, dtype=torch.int64)
    buffer = PixelBuffer.empty(config)
    _, counters = render_pixels(torch.zeros(count, dtype=torch.int64), config, trace, start_s, 0)
    cycle_s = checked(cycle_seconds, counters, 1.0)
    cycle, time_s = -config.warmup_cycles, start_s - config.warmup_cycles * cycle_s
    while time_s < end_s:
        began = time.perf_counter()
        while queue.numel() < count:
            sweep = torch.randperm(config.resolution_px**2, generator=generator(config, cycle + queue.numel()))
            queue = torch.cat((queue, sweep))
        pixel, queue = queue[:count], queue[count:]
        color, counters = render_pixels(pixel, config, trace, time_s, cycle)
        write(buffer, pixel, color, time_s)
        image = _image(buffer, config)
        cycle_s = checked(cycle_seconds, counters, time.perf_counter() - began)
        yield Display(time_s + LATENCY_CYCLES * cycle_s, time_s, image, sample_map(buffer, config))
        cycle, time_s = cycle + 1, time_s + cycle_s


def _image(buffer: PixelBuffer, config: TsarConfig) -> Float[Tensor, "h w 3"]:
    side = config.resolution_px
    color = buffer.color.reshape(side, side, 3)
    known = torch.isfinite(buffer.time_s).reshape(1, side, side)
    if bool(known.all()):
        return color.clone()
    return pull_push(color.permute(2, 0, 1), known.to(torch.float32)).permute(1, 2, 0).contiguous()
