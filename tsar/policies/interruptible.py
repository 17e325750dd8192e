"""Interruptible rendering: a frame of one animation time is refined from coarse to fine until the scene has changed too
much.

The back buffer holds the frame in progress. Every cycle adds samples where they remove most of its error, all at the
animation time at which the frame was begun. Two errors are tracked, both in squared encoded colour: the *static* error,
which coarseness causes and refinement removes, and the *dynamic* error, the change of the picture between that time and
its display. Once the dynamic error exceeds the static one, the frame is interrupted: it is shown, and the next one is
begun. A frame is shown earlier, and refined while it is shown, if the sum of its errors is below that of the picture on
the display; so rendering goes sometimes into the back buffer and sometimes into the front buffer.

The static error is that of :func:`tsar.policies.refinement.remaining`, calibrated by the differences between new
samples and the picture at their positions. The dynamic error is the change of the picture when every pixel moves with
its first hit, from its position at the frame's time to that at the end of the cycle, extrapolated from the poses at its
start and those a cycle earlier. Changes without motion are detected by probes, a few samples that are traced again at
the present time: where they show more change than the motion explains, their estimate is used.

Source: Woolley, Luebke, Watson and Dayal 2003, *Interruptible rendering*, as described in its abstract and in Stephens
2011, sec. 2.4.

Deviation: the original measures both errors as distances in pixels on the image plane, and refines geometric detail, or
the resolution of a ray caster, uniformly. Here both are errors of colour, for which those distances are a proxy, and
the refinement is adaptive.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import inf, log2

import torch
from jaxtyping import Float, Int32, Int64
from torch import Tensor

from tsar.clock import StageTimer
from tsar.config import TsarConfig
from tsar.policies import displacement, refinement
from tsar.policies.refinement import Level, mean
from tsar.policies.scatter import filled, generator, pixel_colors
from tsar.policy import Moment, Picture, Policy, Price, Setting, require_square
from tsar.roots import GOLDEN_2D, encoded
from tsar.types import FrameletBatch, SampleBatch, SampleMap
from tsar.window import GRID

SAMPLES_PER_PIXEL = 16
"""A frame is complete when it has this many samples per pixel, whatever its dynamic error."""
PROBE_SHARE = 1.0 / 32.0
"""Share of the samples of a cycle that are probes for changes without motion."""
_SURE = 3.0  # standard errors by which the probes must exceed the change from motion
_STILL = 0.1  # or motion explains less than this share of their change
_CALIBRATION = 0.5  # initial value
_CALIBRATION_RANGE = 0.1, 3.0
_STEP = torch.tensor(GOLDEN_2D)


@dataclass(frozen=True)
class Frame:
    """The samples of one frame, pixels in raster order. Changes in place.

    Attributes:
        time_s: animation time of all its samples; ``-inf`` for a frame that was never begun.
        color, count: sum and number of each pixel's samples.
        position: position of each pixel's newest sample on the image plane.
        instance, point: first hit of that sample.
        grid, grid_color: pixels of the first, regular samples, which probes trace again, and their colours.
    """

    time_s: float
    color: Float[Tensor, "pixels 3"]
    count: Float[Tensor, " pixels"]
    position: Float[Tensor, "pixels 2"]
    instance: Int32[Tensor, " pixels"]
    point: Float[Tensor, "pixels 3"]
    grid: Int64[Tensor, " grid"]
    grid_color: Float[Tensor, "grid 3"]

    @property
    def hits(self) -> displacement.FirstHits:
        return displacement.FirstHits(self.count > 0, self.position, self.instance, self.point)

    @staticmethod
    def empty(config: TsarConfig, time_s: float, grid: Int64[Tensor, " grid"]) -> Frame:
        pixels = config.resolution_px**2
        instance = torch.full((pixels,), -1, dtype=torch.int32)
        planes = torch.zeros(pixels, 3), torch.zeros(pixels), torch.zeros(pixels, 2), instance, torch.zeros(pixels, 3)
        return Frame(time_s, *planes, grid, torch.zeros(grid.numel(), 3))


@dataclass(frozen=True)
class View:
    """A frame as a picture.

    Attributes:
        frame: frame that it shows, which may have received more samples since.
        image: ``(height, width, 3)`` linear RGB.
        error, static: expected squared error of each pixel, and its mean.
        tree: quadtree that refines it.
        samples: number of its samples.
        changed: dynamic error when the frame was interrupted.
    """

    frame: Frame
    image: Float[Tensor, "h w 3"]
    error: Float[Tensor, "h w"]
    static: float
    tree: list[Level]
    samples: int
    changed: float = 0.0


@dataclass(frozen=True)
class Asked:
    """The requested samples: pixels of the refining samples, and indices into the frame's grid of the probes that
    follow them."""

    pixel: Int64[Tensor, " samples"]
    probe: Int64[Tensor, " probes"]


@dataclass(frozen=True)
class Buffers:
    """The frame in progress, the picture on the display, and the requested samples.

    Attributes:
        frame: frame that is refined; None when a new one is to be begun.
        back: that frame as a picture; None before its first samples.
        front: picture on the display; None before the first.
        calibration: factor of the static error.
        asked: samples requested from the renderer.
    """

    frame: Frame | None = None
    back: View | None = None
    front: View | None = None
    calibration: float = _CALIBRATION
    asked: Asked | None = None


class Interruptible(Policy[Buffers]):
    """Cycles of ``batch_size * s²`` samples, each for one frame."""

    def __init__(self, setting: Setting) -> None:
        super().__init__(setting)
        require_square(self.config, "interruptible")
        self._view = setting.view

    @property
    def footprint(self) -> float:
        """2, as samples are averaged later on: it had the least error of 1, 2 and 4."""
        return 2.0

    @property
    def price(self) -> Price:
        """Besides refinement, per pixel: image 84 (pyramid up 20 and down 26, of three channels, and means 3, times
        4/3, and roots 9); and displacement, for back and front buffer. Per sample: replacement of non-finite values 6,
        sums 8, encoding and calibration 20.
        """
        return Price(
            int(self.config.budget),
            pixel_flops=refinement.PIXEL_FLOPS + 84 + 2 * displacement.PIXEL_FLOPS,
            sample_flops=34,
        )

    def start(self) -> Buffers:
        return Buffers()

    def request(self, state: Buffers, moment: Moment) -> tuple[Buffers, FrameletBatch]:
        """The pixels that refine the frame most, and probes; for a new frame, a coarse grid."""
        config, count = self.config, int(self.config.budget)
        random = generator(config, moment.cycle)
        if state.frame is None or state.back is None:
            pixel, regular = refinement.spread(config.resolution_px, count, random)
            state = replace(state, frame=Frame.empty(config, moment.time_s, pixel[:regular]), back=None)
            probe = torch.zeros(0, dtype=torch.int64)
        else:
            probes = int(count * PROBE_SHARE)
            probe = torch.randint(state.frame.grid.numel(), (probes,), generator=random)
            pixel = refinement.worthiest(state.back.tree, count - probes, random)
        assert state.frame is not None
        asked = Asked(pixel, probe)
        return replace(state, asked=asked), _batch(state.frame, asked, config, moment, self._view is not None)

    def observe(
        self, state: Buffers, batch: FrameletBatch, samples: SampleBatch, moment: Moment, timer: StageTimer
    ) -> Buffers:
        frame, asked = state.frame, state.asked
        assert frame is not None and asked is not None
        color, count = pixel_colors(samples, self.config), asked.pixel.numel()
        calibration = _CALIBRATION if state.back is None else _calibrated(state, asked, color[:count])
        with timer("cache"):
            _add(frame, asked, batch, samples, color[:count], first=state.back is None)
        with timer("error"):
            done = count + (state.back.samples if state.back else 0)
            back = _seen(frame, calibration, done, self.config)
            dynamic = self._dynamic(back, moment, _probed(frame, asked, color[count:]))
            front = state.front
            known = inf if front is None else front.static + max(front.changed, self._dynamic(front, moment, None))
        complete = done >= SAMPLES_PER_PIXEL * self.config.resolution_px**2
        interrupted = dynamic >= back.static or complete
        if interrupted or front is None or front.frame is frame or back.static + dynamic < known:
            front = replace(back, changed=dynamic)
        return Buffers(None if interrupted else frame, back, front, calibration)

    def image(self, state: Buffers, moment: Moment) -> Picture:
        front = state.front
        assert front is not None
        level = max(0, int(log2(front.samples**0.5 / self.config.framelet_side)))
        age = torch.full((1, 1), front.frame.time_s, dtype=torch.float64)
        return Picture(front.image, SampleMap(age, torch.full((1, 1), level)))

    def _dynamic(self, view: View, moment: Moment, probes: tuple[float, float] | None) -> float:
        """Dynamic error of a picture at the end of the cycle: the change from motion or, where the probes show more
        change than that, the change that they extrapolate to. ``probes`` is their mean and its standard error."""
        moved, age_s = 0.0, moment.time_s - view.frame.time_s
        if self._view is not None:
            now, before = self._view(moment.time_s), self._view(moment.time_s - moment.cycle_s)
            moved = displacement.change(view.image, view.frame.hits, now, before)
        if probes is None or age_s <= 0.0:
            return moved
        if probes[0] - _SURE * probes[1] <= moved and _STILL * probes[0] <= moved:
            return moved
        return probes[0] * (age_s + moment.cycle_s) / age_s


def _batch(frame: Frame, asked: Asked, config: TsarConfig, moment: Moment, hits: bool) -> FrameletBatch:
    """Samples at the frame's time, the first of a pixel at its centre and further ones elsewhere in it; and probes at
    the present time."""
    side = config.resolution_px
    count = frame.count[asked.pixel][:, None]
    offset = torch.where(count > 0, (0.5 + count * _STEP) % 1.0, 0.5)
    pixel = torch.cat((asked.pixel, frame.grid[asked.probe]))
    offset = torch.cat((offset, torch.full((asked.probe.numel(), 2), 0.5)))
    place = torch.stack((pixel % side, pixel // side), dim=1).to(torch.float32) + offset
    position = (place * (GRID // side)).floor() / GRID
    time_s = torch.full((pixel.numel(),), frame.time_s, dtype=torch.float64)
    time_s[asked.pixel.numel() :] = moment.time_s
    nothing = torch.zeros(pixel.numel() // config.samples, dtype=torch.int64)
    return FrameletBatch(
        nothing,
        nothing,
        position.reshape(-1, config.samples, 2),
        time_s.reshape(-1, config.samples),
        cycle=moment.cycle,
        seed=config.seed,
        hits=hits,
    )


def _add(
    frame: Frame,
    asked: Asked,
    batch: FrameletBatch,
    samples: SampleBatch,
    color: Float[Tensor, "samples 3"],
    first: bool,
) -> None:
    """Adds the samples of a cycle to the frame; those of its first cycle begin with its grid."""
    pixel, count = asked.pixel, asked.pixel.numel()
    frame.color.index_add_(0, pixel, color)
    frame.count.index_add_(0, pixel, torch.ones(count))
    last = torch.full(frame.count.shape, -1).scatter_reduce(0, pixel, torch.arange(count), "amax")
    hit = (last >= 0).nonzero().squeeze(1)
    frame.position[hit] = batch.position.reshape(-1, 2)[last[hit]]
    if samples.hits is not None:
        frame.instance[hit] = samples.hits.instance.reshape(-1)[last[hit]]
        frame.point[hit] = samples.hits.point.reshape(-1, 3)[last[hit]]
    if first:
        frame.grid_color[:] = color[: frame.grid.numel()]


def _seen(frame: Frame, calibration: float, samples: int, config: TsarConfig) -> View:
    """The frame as a picture: means of the pixels, with empty ones filled from coarser levels."""
    side = config.resolution_px
    color, count = frame.color.T.reshape(3, side, side), frame.count.reshape(side, side)
    image = filled(color / count.clamp(min=1.0), (count > 0).to(torch.float32)[None])
    tree = refinement.levels(color, count)
    error = refinement.remaining(tree, calibration)
    return View(frame, image.permute(1, 2, 0).contiguous(), error, mean(error), tree, samples)


def _calibrated(state: Buffers, asked: Asked, color: Float[Tensor, "samples 3"]) -> float:
    """Squared error observed by samples of pixels that were empty, over the expected one."""
    assert state.frame is not None and state.back is not None
    fresh = state.frame.count[asked.pixel] == 0
    if int(fresh.sum()) < asked.pixel.numel() // 4:
        return state.calibration
    pixel = asked.pixel[fresh]
    found = (encoded(color[fresh]) - encoded(state.back.image.reshape(-1, 3)[pixel])).square()
    expected = mean(state.back.error.reshape(-1)[pixel]) / state.calibration
    low, high = _CALIBRATION_RANGE
    return min(max(mean(found) / max(expected, 1e-12), low), high)


def _probed(frame: Frame, asked: Asked, color: Float[Tensor, "probes 3"]) -> tuple[float, float] | None:
    """Mean squared change of the colours of the probes, and its standard error; None with fewer than two probes."""
    if asked.probe.numel() < 2:
        return None
    change = encoded(color) - encoded(frame.grid_color[asked.probe])
    squared = change.square().to(torch.float64).sum(1) / 3.0
    average = mean(squared)
    return average, (mean((squared - average).square()) / (squared.numel() - 1)) ** 0.5
