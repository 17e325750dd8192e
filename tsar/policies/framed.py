"""The ordinary framed renderer: a whole frame is traced, then shown until the next one is done.

Source: Stephens 2011, sec. 7.1.2 (nonadaptive renderer) and 3.4.2 (two frames of latency).
"""

from __future__ import annotations

from dataclasses import dataclass
from math import log2

import torch
import torch.nn.functional as F
from jaxtyping import Float
from torch import Tensor

from tsar.clock import StageTimer
from tsar.config import TsarConfig, require
from tsar.morton import raster_to_morton
from tsar.policy import Moment, Picture, Policy, Price, Setting
from tsar.selection import sample_positions
from tsar.tiling import uniform
from tsar.types import FrameletBatch, SampleBatch, SampleMap


@dataclass(frozen=True)
class Frame:
    """The newest frame: its image, and the animation time it shows."""

    image: Float[Tensor, "h w 3"] | None = None
    time_s: float = -float("inf")


class Framed(Policy[Frame]):
    """Whole frames with ``samples_per_axis²`` samples a pixel; the start is early enough for the latency."""

    latency_cycles = 2
    probe_cycles = 1

    def __init__(self, setting: Setting, samples_per_axis: int = 1) -> None:
        """Takes the samples along a pixel's side.

        Raises:
            ConfigError: ``samples_per_axis`` is not a power of two.
        """
        super().__init__(setting)
        ok = samples_per_axis >= 1 and samples_per_axis & (samples_per_axis - 1) == 0
        require(ok, "samples_per_axis", "a power of two", samples_per_axis)
        self._axis = samples_per_axis
        self._level = int(log2(self.config.resolution_px * samples_per_axis / self.config.framelet_side))

    @property
    def footprint(self) -> int:
        return self._axis

    @property
    def warmup_cycles(self) -> int:
        return self.latency_cycles + 1

    @property
    def price(self) -> Price:
        return Price((self.config.resolution_px * self._axis) ** 2)

    def start(self) -> Frame:
        return Frame()

    def request(self, state: Frame, moment: Moment) -> tuple[Frame, FrameletBatch]:
        """A whole frame as framelets: the uniform tiling with ``samples_per_axis²`` samples a pixel."""
        tiling = uniform(self._level)
        position = sample_positions(tiling.level, tiling.index, self.config.framelet_side)
        batch = FrameletBatch(
            tiling.level, tiling.index, position, moment.time_s, cycle=moment.cycle, seed=self.config.seed
        )
        return state, batch

    def observe(
        self, state: Frame, batch: FrameletBatch, samples: SampleBatch, moment: Moment, timer: StageTimer
    ) -> Frame:
        with timer("reconstruction"):
            return Frame(frame_image(samples, self.config, self._axis), moment.time_s)

    def image(self, state: Frame, moment: Moment) -> Picture:
        assert state.image is not None
        age = torch.full((1, 1), state.time_s, dtype=torch.float64)
        return Picture(state.image, SampleMap(age, torch.full((1, 1), self._level)))


def supersampled(setting: Setting) -> Framed:
    """The framed renderer with four samples a pixel."""
    return Framed(setting, samples_per_axis=2)


def frame_image(samples: SampleBatch, config: TsarConfig, samples_per_axis: int) -> Float[Tensor, "h w 3"]:
    """``(h, w, 3)`` image, box-filtered to pixels. Tiles in Morton order of samples in Morton order are one curve."""
    side = config.resolution_px * samples_per_axis
    raster = samples.color.reshape(-1, 3)[raster_to_morton(side)].reshape(side, side, 3)
    if samples_per_axis == 1:
        return raster
    return F.avg_pool2d(raster.permute(2, 0, 1)[None], samples_per_axis)[0].permute(1, 2, 0).contiguous()
