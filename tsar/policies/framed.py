"""The ordinary framed renderer: a whole frame is traced, then shown until the next one is done.

A frame has one sample a pixel, several, or one for a square of several pixels, in which case it is shown enlarged. Each
takes the time that its samples cost, so a small frame is soon followed by the next.

Source: Stephens 2011, sec. 7.1.2 (nonadaptive renderer); its latency is two frames by sec. 3.4.4 and one by sec. 3.4.2.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import frexp, log2

import torch
import torch.nn.functional as F
from jaxtyping import Float
from torch import Tensor

from tsar.clock import StageTimer
from tsar.config import require
from tsar.error import replace_nonfinite
from tsar.morton import raster_to_morton
from tsar.policies.resampling import widened
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
    """Whole frames with ``samples_per_axis`` samples along a pixel's side; the start is early enough for the latency.

    Two frames of latency: the first is traced, and shown while the second is (Stephens 2011, sec. 3.4.4). It is what
    ratios are relative to.
    """

    latency_cycles = 2
    probe_cycles = 1

    def __init__(self, setting: Setting, samples_per_axis: float = 1.0) -> None:
        """Takes the samples along a pixel's side; 1/2 is one sample for a square of 2² pixels.

        Raises:
            ConfigError: ``samples_per_axis`` is not a power of two, or leaves less than one sample.
        """
        super().__init__(setting)
        resolution = self.config.resolution_px
        ok = samples_per_axis > 0 and frexp(samples_per_axis)[0] == 0.5
        require(ok, "samples_per_axis", "a power of two", samples_per_axis)
        require(resolution * samples_per_axis >= 1, "samples_per_axis", f"at least 1/{resolution}", samples_per_axis)
        self._axis = float(samples_per_axis)
        self._side = int(resolution * samples_per_axis)
        self._framelet_side = min(self.config.framelet_side, self._side)
        self._level = int(log2(self._side // self._framelet_side))

    @property
    def footprint(self) -> float:
        return self._axis

    @property
    def warmup_cycles(self) -> int:
        return self.latency_cycles + 1

    @property
    def price(self) -> Price:
        """Enlarging by ``k`` weights two values of each channel: three operations, in a ``k``-th of the rows for the
        width and in all for the height. The box filter over several samples is not charged."""
        enlarge = 9.0 * (1.0 + self._axis) if self._axis < 1 else 0.0
        return Price(self._side**2, pixel_flops=enlarge)

    def start(self) -> Frame:
        return Frame()

    def request(self, state: Frame, moment: Moment) -> tuple[Frame, FrameletBatch]:
        """A whole frame as framelets of the uniform tiling."""
        tiling = uniform(self._level)
        position = sample_positions(tiling.level, tiling.index, self._framelet_side)
        batch = FrameletBatch(
            tiling.level, tiling.index, position, moment.time_s, cycle=moment.cycle, seed=self.config.seed
        )
        return state, batch

    def observe(
        self, state: Frame, batch: FrameletBatch, samples: SampleBatch, moment: Moment, timer: StageTimer
    ) -> Frame:
        with timer("reconstruction"):
            color = replace_nonfinite(samples.color, self._framelet_side)[0]
            return Frame(frame_image(color, self._side, self.config.resolution_px), moment.time_s)

    def image(self, state: Frame, moment: Moment) -> Picture:
        assert state.image is not None
        age = torch.full((1, 1), state.time_s, dtype=torch.float64)
        return Picture(state.image, SampleMap(age, torch.full((1, 1), self._level)))


class PromptlyFramed(Framed):
    """One frame of latency: a frame is shown as soon as it is traced (Stephens 2011, sec. 3.4.2)."""

    latency_cycles = 1


def supersampled(setting: Setting) -> Framed:
    """Four samples a pixel, one frame of latency."""
    return PromptlyFramed(setting, 2.0)


def halved(setting: Setting) -> Framed:
    """Half as many samples along a side as pixels, shown enlarged, one frame of latency."""
    return PromptlyFramed(setting, 0.5)


def quartered(setting: Setting) -> Framed:
    """A quarter as many samples along a side as pixels, shown enlarged, one frame of latency."""
    return PromptlyFramed(setting, 0.25)


def frame_image(color: Float[Tensor, "n samples 3"], side: int, resolution_px: int) -> Float[Tensor, "h w 3"]:
    """Image of the samples of a uniform tiling.

    Args:
        color: ``side²`` samples: tiles in Morton order of samples in Morton order, which are one curve.
        side: samples along the image's side.
        resolution_px: pixels along it; these are box averages of several samples, or bilinear between few.
    """
    raster = color.reshape(-1, 3)[raster_to_morton(side)].reshape(side, side, 3)
    if side == resolution_px:
        return raster
    planes = raster.permute(2, 0, 1)
    if side > resolution_px:
        return F.avg_pool2d(planes[None], side // resolution_px)[0].permute(1, 2, 0).contiguous()
    factor = resolution_px // side
    wide = widened(planes, factor)
    return widened(wide.transpose(1, 2), factor).permute(2, 1, 0).contiguous()
