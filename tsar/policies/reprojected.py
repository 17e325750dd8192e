"""Framed renderers with reprojection: temporal accumulation, and warping of the last image to newer poses.

A frame is traced in parts, one per cycle. At the end of every cycle the last finished image is shown, warped to the
poses of that time, which are predicted from those at the start of the cycle and before; later poses are never used.
Without warping a frame has one part.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import floor, gcd, log2

import torch
from jaxtyping import Float
from torch import Tensor

from tsar.clock import StageTimer
from tsar.config import require
from tsar.morton import curve
from tsar.policies.accumulation import ACCUMULATE_FLOPS, Accumulation, History, accumulated
from tsar.policies.framed import curve_positions, finite
from tsar.policies.late import WARP_FLOPS, warped
from tsar.policies.surfaces import Surfaces
from tsar.policy import Moment, Picture, Policy, Price, Setting
from tsar.prediction import foretold
from tsar.roots import GOLDEN_2D
from tsar.types import FrameletBatch, SampleBatch, SampleMap, Viewpoint
from tsar.window import GRID


@dataclass(frozen=True)
class Finished:
    """The last finished frame.

    Attributes:
        color: its image, or the accumulated image.
        surfaces: its first hits.
        view: poses of its time.
        history: accumulated image and its sample counts; None without accumulation.
    """

    color: Float[Tensor, "h w 3"]
    surfaces: Surfaces
    view: Viewpoint
    history: History | None = None


@dataclass(frozen=True)
class Progress:
    """The frame that is being traced, and the one that is shown.

    Attributes:
        number: number of the frame that is being traced, from 0.
        time_s: its animation time, seconds.
        parts: traced parts of it.
        finished: last finished frame; None before the first.
    """

    number: int = 0
    time_s: float = 0.0
    parts: tuple[SampleBatch, ...] = ()
    finished: Finished | None = None


class Reprojected(Policy[Progress]):
    """Frames with one sample per pixel that are accumulated, warped, or both; the poses have one cycle of latency."""

    def __init__(
        self,
        setting: Setting,
        parts: int = 1,
        accumulation: Accumulation | None = None,
        warm_frames: int = 3,
        footprint: float = 1.0,
    ) -> None:
        """Sets the processing of the frames.

        Args:
            setting: setting of the run; it must have poses.
            parts: number of cycles over which a frame is traced, each of which shows a warped image; 1 shows frames
                without warping.
            accumulation: constants of the accumulation; None for none.
            warm_frames: number of frames before the start.
            footprint: samples along a pixel's side that textures are filtered for.

        Raises:
            ConfigError: ``parts`` is not a power of two, the renderer gives no poses, or the camera is a panorama.
        """
        super().__init__(setting)
        require(parts >= 1 and parts & (parts - 1) == 0, "parts", "a power of two", parts)
        require(setting.view is not None, "policy", "a renderer that tells poses, for reprojection", setting.view)
        assert setting.view is not None
        kind = setting.view(0.0).kind
        require(kind != "panorama", "policy", "a perspective or parallel camera, for reprojection", kind)
        self._view, self._accumulation, self._warm_frames = setting.view, accumulation, warm_frames
        self._footprint, self._warps = footprint, parts > 1
        self._level = int(log2(self.config.resolution_px // self.config.framelet_side))
        self._parts = gcd(parts, 4**self._level if self.config.window.whole else self.config.pixels)
        self._order = torch.argsort(curve(*self.config.shape))

    @property
    def footprint(self) -> float:
        return self._footprint

    @property
    def probe_cycles(self) -> int:  # pyright: ignore[reportIncompatibleVariableOverride]
        """One frame, so that the last cycle warps an image."""
        return self._parts

    @property
    def warmup_cycles(self) -> int:
        return self._warm_frames * self._parts

    @property
    def price(self) -> Price:
        """Price of one part of a frame's samples and accumulation, and of a warp."""
        accumulate = ACCUMULATE_FLOPS / self._parts if self._accumulation else 0.0
        warp = WARP_FLOPS if self._warps else 0.0
        return Price(self.config.pixels // self._parts, pixel_flops=accumulate + warp)

    def start(self) -> Progress:
        return Progress()

    def request(self, state: Progress, moment: Moment) -> tuple[Progress, FrameletBatch]:
        """The next part of a frame, in Morton order; all parts have the animation time at which the first is traced."""
        if not state.parts:
            state = replace(state, time_s=moment.time_s)
        height, width = self.config.shape
        count, number = self.config.pixels // self._parts, len(state.parts)
        position = curve_positions(height, width, height, width)[number * count : (number + 1) * count]
        position = position.reshape(-1, gcd(count, self.config.samples), 2)
        nothing = torch.zeros(len(position), dtype=torch.int64)
        beside = torch.tensor(self._jitter_px(state.number)) / torch.tensor((width, height))
        batch = FrameletBatch(
            nothing, nothing, position + beside, state.time_s, cycle=moment.cycle, seed=self.config.seed, hits=True
        )
        return state, batch

    def observe(
        self, state: Progress, batch: FrameletBatch, samples: SampleBatch, moment: Moment, timer: StageTimer
    ) -> Progress:
        parts = (*state.parts, samples)
        if len(parts) < self._parts:
            return replace(state, parts=parts)
        with timer("reconstruction"):
            return Progress(state.number + 1, finished=self._finish(state, parts))

    def image(self, state: Progress, moment: Moment) -> Picture:
        """The last finished frame, warped to the poses of the middle of its display, as predicted from those at the
        cycle's start and before; black before the first frame."""
        last = state.finished
        if last is None:
            return Picture(torch.zeros(*self.config.shape, 3))
        age = torch.full((1, 1), last.view.time_s, dtype=torch.float64)
        shown = SampleMap(age, torch.full((1, 1), self._level))
        if not self._warps:
            return Picture(last.color, shown)
        view = foretold(self._view, moment.time_s, moment.cycle_s)
        return Picture(warped(last.color, last.surfaces, view), shown)

    def _finish(self, state: Progress, parts: tuple[SampleBatch, ...]) -> Finished:
        shape, order = self.config.shape, self._order
        hits = [part.hits for part in parts if part.hits is not None]
        require(len(hits) == len(parts), "policy", "a renderer that tells first hits, for reprojection", None)
        color = finite(torch.cat([part.color for part in parts]), shape, self.config.framelet_side)
        color = color.reshape(-1, 3)[order].reshape(*shape, 3)
        surfaces = Surfaces(
            torch.cat([hit.instance for hit in hits]).reshape(-1)[order].reshape(shape),
            torch.cat([hit.point for hit in hits]).reshape(-1, 3)[order].reshape(*shape, 3),
            self._jitter_px(state.number),
        )
        view = self._view(state.time_s)
        if self._accumulation is None:
            return Finished(color, surfaces, view)
        last = state.finished
        before, history = (last.view, last.history) if last else (None, None)
        history = accumulated(color, surfaces, view, before, history, self._accumulation)
        return Finished(history.color, surfaces, view, history)

    def _jitter_px(self, number: int) -> tuple[float, float]:
        """Offset of a frame's samples from the centres of the pixels, in [-1/2, 1/2) pixels."""
        if self._accumulation is None:
            return 0.0, 0.0
        pixel = GRID // self.config.resolution_px
        x, y = (floor(((0.5 + number * step) % 1.0) * pixel) / pixel - 0.5 for step in GOLDEN_2D)
        return x, y


PARTS = 8
"""Number of cycles over which a warped frame is traced: with half as many, poses are late; with twice as many, nothing
is gained.

This number, the constants of the accumulation and the footprints below minimise the error on the five inputs, row 7 of
table 7.2 at a quarter of the side, seed 0, phase 0.
"""
ACCUMULATED_FOOTPRINT, LATE_FOOTPRINT = 4.0, 2.0
"""Averaged samples need textures filtered over less than a pixel; a single sample needs that to a lesser degree."""
WARM_FRAMES = 12


def accumulating(setting: Setting) -> Reprojected:
    """Temporal accumulation: jittered frames, each shown when it is done."""
    return Reprojected(setting, 1, Accumulation(), WARM_FRAMES, ACCUMULATED_FOOTPRINT)


def late(setting: Setting) -> Reprojected:
    """The last frame, warped to the poses at which it is shown."""
    return Reprojected(setting, PARTS, footprint=LATE_FOOTPRINT)


def accumulating_late(setting: Setting) -> Reprojected:
    """Temporal accumulation, warped to the poses at which it is shown."""
    return Reprojected(setting, PARTS, Accumulation(), WARM_FRAMES, ACCUMULATED_FOOTPRINT)
