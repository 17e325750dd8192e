"""The ordinary framed renderer: a whole frame is traced, then shown until the next one is done.

Source: Stephens 2011, sec. 7.1.2 (nonadaptive renderer) and 3.4.2 (two frames of latency).
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from math import log2

import torch
import torch.nn.functional as F
from jaxtyping import Float
from torch import Tensor

from tsar.clock import CycleSeconds, checked
from tsar.config import TsarConfig, require
from tsar.morton import raster_to_morton
from tsar.selection import sample_positions
from tsar.tiling import uniform
from tsar.types import Display, FrameletBatch, SampleBatch, SampleMap, Trace

LATENCY_FRAMES = 2
"""A framed renderer shows what was sampled two frames ago."""


def frame_batch(config: TsarConfig, time_s: float, frame: int, samples_per_axis: int) -> FrameletBatch:
    """A whole frame as framelets: the uniform tiling with ``samples_per_axis²`` samples a pixel."""
    tiling = uniform(int(log2(config.resolution_px * samples_per_axis / config.framelet_side)))
    position = sample_positions(tiling.level, tiling.index, config.framelet_side)
    return FrameletBatch(tiling.level, tiling.index, position, time_s, cycle=frame, seed=config.seed)


def frame_image(samples: SampleBatch, config: TsarConfig, samples_per_axis: int) -> Float[Tensor, "h w 3"]:
    """``(h, w, 3)`` image, box-filtered to pixels. Tiles in Morton order of samples in Morton order are one curve."""
    side = config.resolution_px * samples_per_axis
    raster = samples.color.reshape(-1, 3)[raster_to_morton(side)].reshape(side, side, 3)
    if samples_per_axis == 1:
        return raster
    return F.avg_pool2d(raster.permute(2, 0, 1)[None], samples_per_axis)[0].permute(1, 2, 0).contiguous()


def run(
    config: TsarConfig,
    trace: Trace,
    frame_seconds: CycleSeconds,
    start_s: float,
    end_s: float,
    samples_per_axis: int = 1,
) -> Iterator[Display]:
    """Frames that cover ``[start_s, end_s)`` on the display, beginning early enough for its latency.

    Raises:
        ConfigError: ``samples_per_axis`` is not a power of two.
    """
    ok = samples_per_axis >= 1 and samples_per_axis & (samples_per_axis - 1) == 0
    require(ok, "samples_per_axis", "a power of two", samples_per_axis)
    frame_s, time_s, frame = None, start_s, 0
    while frame_s is None or time_s < end_s:
        began = time.perf_counter()
        samples = trace(frame_batch(config, time_s, frame, samples_per_axis))
        image = frame_image(samples, config, samples_per_axis)
        cost = checked(frame_seconds, samples.counters, time.perf_counter() - began)
        if frame_s is None:
            # The first frame only tells what a frame costs; the run proper starts early by the latency.
            frame_s, time_s = cost, start_s - (LATENCY_FRAMES + 1) * cost
            continue
        age = torch.full((1, 1), time_s, dtype=torch.float64)
        level = torch.full((1, 1), int(log2(config.resolution_px * samples_per_axis / config.framelet_side)))
        yield Display(time_s + LATENCY_FRAMES * cost, time_s, image, SampleMap(age, level))
        frame_s, time_s, frame = cost, time_s + cost, frame + 1
