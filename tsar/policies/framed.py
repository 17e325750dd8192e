"""The ordinary framed renderer: a whole frame is traced, then shown until the next one is done.

A frame has one sample per pixel, several, or one per square of several pixels, in which case it is shown enlarged. It
takes as long as its samples cost, so a small frame is soon followed by the next.

Source: Stephens 2011, sec. 7.1.2 (nonadaptive renderer); its latency is two frames by sec. 3.4.4 and one by sec. 3.4.2.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from math import ceil, frexp, gcd, log2

import torch
import torch.nn.functional as F
from jaxtyping import Float
from torch import Tensor

from tsar.clock import StageTimer
from tsar.config import require
from tsar.error import replace_nonfinite
from tsar.morton import curve
from tsar.policies.resampling import widened
from tsar.policy import Moment, Picture, Policy, Price, Setting
from tsar.types import FrameletBatch, SampleBatch, SampleMap


@dataclass(frozen=True)
class Frame:
    """The newest frame: its image and its animation time, seconds."""

    image: Float[Tensor, "h w 3"] | None = None
    time_s: float = -float("inf")


class Framed(Policy[Frame]):
    """Whole frames with ``samples_per_axis`` samples along a pixel's side; the run starts early enough for the latency.

    The latency is two frames: a frame is traced, and then shown while the next is traced (Stephens 2011, sec. 3.4.4).
    Ratios of errors are relative to this policy.
    """

    latency_cycles = 2
    probe_cycles = 1

    def __init__(self, setting: Setting, samples_per_axis: float = 1.0) -> None:
        """Sets the number of samples along a pixel's side; 1/2 is one sample per square of 2 x 2 pixels.

        Raises:
            ConfigError: ``samples_per_axis`` is not a power of two, or leaves less than one sample.
        """
        super().__init__(setting)
        resolution = self.config.resolution_px
        height, width = self.config.shape
        ok = samples_per_axis > 0 and frexp(samples_per_axis)[0] == 0.5
        require(ok, "samples_per_axis", "a power of two", samples_per_axis)
        require(resolution * samples_per_axis >= 1, "samples_per_axis", f"at least 1/{resolution}", samples_per_axis)
        self._axis = float(samples_per_axis)
        side = int(resolution * samples_per_axis)
        self._level = int(log2(side // min(self.config.framelet_side, side)))
        self._shape = ceil(height * samples_per_axis), ceil(width * samples_per_axis)

    @property
    def footprint(self) -> float:
        return self._axis

    @property
    def warmup_cycles(self) -> int:
        return self.latency_cycles + 1

    @property
    def price(self) -> Price:
        """Enlargement by ``k`` interpolates two values of each channel with three operations, in a ``k``-th of the rows
        for the width and in all rows for the height. The box filter over several samples is not charged."""
        enlarge = 9.0 * (1.0 + self._axis) if self._axis < 1 else 0.0
        return Price(self._shape[0] * self._shape[1], pixel_flops=enlarge)

    def start(self) -> Frame:
        return Frame()

    def request(self, state: Frame, moment: Moment) -> tuple[Frame, FrameletBatch]:
        """A whole frame, in the order of the Morton curve."""
        position = curve_positions(*self._shape, *self.config.shape, self._axis)
        position = position.reshape(-1, gcd(len(position), self.config.samples), 2)
        nothing = torch.zeros(len(position), dtype=torch.int64)
        batch = FrameletBatch(nothing, nothing, position, moment.time_s, cycle=moment.cycle, seed=self.config.seed)
        return state, batch

    def observe(
        self, state: Frame, batch: FrameletBatch, samples: SampleBatch, moment: Moment, timer: StageTimer
    ) -> Frame:
        with timer("reconstruction"):
            color = finite(samples.color, self._shape, self.config.framelet_side)
            return Frame(frame_image(color, self._shape, self.config.shape, self._axis), moment.time_s)

    def image(self, state: Frame, moment: Moment) -> Picture:
        assert state.image is not None
        age = torch.full((1, 1), state.time_s, dtype=torch.float64)
        return Picture(state.image, SampleMap(age, torch.full((1, 1), self._level)))


class PromptlyFramed(Framed):
    """The latency is one frame: a frame is shown as soon as it is traced (Stephens 2011, sec. 3.4.2)."""

    latency_cycles = 1


def supersampled(setting: Setting) -> Framed:
    """Four samples per pixel, one frame of latency."""
    return PromptlyFramed(setting, 2.0)


def halved(setting: Setting) -> Framed:
    """Half as many samples along a side as pixels, shown enlarged, one frame of latency."""
    return PromptlyFramed(setting, 0.5)


def quartered(setting: Setting) -> Framed:
    """A quarter as many samples along a side as pixels, shown enlarged, one frame of latency."""
    return PromptlyFramed(setting, 0.25)


def finite(
    color: Float[Tensor, "n samples 3"], shape: tuple[int, int], side_most: int
) -> Float[Tensor, "blocks block 3"]:
    """Samples along :func:`tsar.morton.curve`, repaired by :func:`tsar.error.replace_nonfinite` in square blocks.

    Args:
        color: samples of a raster of ``shape``, linear RGB.
        shape: height and width of the samples. Blocks are the largest squares of a power of two that divide it.
        side_most: maximum number of samples along the side of a block, a power of two.
    """
    side = gcd(*shape, side_most)
    return replace_nonfinite(color.reshape(-1, side**2, 3), side)[0]


def frame_image(
    color: Float[Tensor, "n samples 3"], shape: tuple[int, int], picture: tuple[int, int], samples_per_axis: float
) -> Float[Tensor, "h w 3"]:
    """The image of samples along :func:`tsar.morton.curve`.

    Args:
        color: samples of a raster of ``shape``, linear RGB.
        shape: height and width of the samples.
        picture: height and width of the image. Its pixels are box averages of several samples, or bilinear
            interpolations where there are fewer samples than pixels.
        samples_per_axis: number of samples along a pixel's side.
    """
    raster = torch.empty(shape[0] * shape[1], 3)
    raster[curve(*shape)] = color.reshape(-1, 3)
    image = _resampled(raster.reshape(*shape, 3), 1.0 / samples_per_axis)
    return image[: picture[0], : picture[1]].contiguous()


@lru_cache(maxsize=4)
def curve_positions(
    rows: int, columns: int, height: int, width: int, samples_per_axis: float = 1.0
) -> Float[Tensor, "samples 2"]:
    """Positions of regular samples on an image of ``width x height`` pixels, along :func:`tsar.morton.curve`. If a
    square of pixels with one sample extends beyond the image, the sample lies in the centre of the last pixel."""
    number = curve(rows, columns)
    x, y = ((at + 0.5) / samples_per_axis for at in (number % columns, number // columns))
    last = 0.5 * min(1.0, 1.0 / samples_per_axis)
    return torch.stack((x.clamp(max=width - last) / width, y.clamp(max=height - last) / height), dim=1)


def _resampled(raster: Float[Tensor, "h w 3"], factor: float) -> Float[Tensor, "h2 w2 3"]:
    """The raster enlarged, or averaged where the factor is below 1."""
    planes = raster.permute(2, 0, 1)
    if factor == 1.0:
        return raster
    if factor < 1.0:
        return F.avg_pool2d(planes[None], round(1.0 / factor))[0].permute(1, 2, 0).contiguous()
    wide = widened(planes, round(factor))
    return widened(wide.transpose(1, 2), round(factor)).permute(2, 1, 0).contiguous()
