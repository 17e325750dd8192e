"""The project's own policies: estimates of every pixel, filtered over time and space, moving with their surfaces.

Every pixel has an estimate of its colour and of the variance of its error. A cycle moves the estimates with their
surfaces to the positions that the poses known at its start predict for the middle of the display. It chooses the
tiles whose samples remove the most error for the longest time and averages the new samples into the estimates. From the
residuals it learns how fast the picture changes, and from the shadows of moving objects where it will change soon. It
shows the estimates, blended with their surroundings where they are uncertain. ``filter`` omits the reprojection.

The framelets of a cycle are tiles of 8 x 8 samples. A batch of more than a 32nd of the output's pixels is divided into
several cycles, which keeps the latency low; in pictures below 256 x 256 pixels cycles are longer.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import partial
from math import ceil

import torch
from jaxtyping import Bool, Float, Float64, Int64
from torch import Tensor

from tsar.clock import StageTimer
from tsar.error import replace_nonfinite
from tsar.filtering import noise, samples, shadows, tiles
from tsar.filtering.batches import Traced
from tsar.filtering.options import DEFAULT, FilterOptions
from tsar.filtering.records import ELEMENT_PX, TILE_SIDE, Change, Estimates, Surfels
from tsar.morton import morton_to_raster
from tsar.policy import Moment, Picture, Policy, Price, Setting, WhenAsked
from tsar.prediction import mid_display_s, predicted
from tsar.roots import GOLDEN_2D, square_root
from tsar.types import FrameletBatch, MapShown, SampleBatch, SampleMap, Viewpoint
from tsar.window import GRID

PIXEL_FLOPS = {True: 345.0, False: 185.0}
"""Operations per output pixel and cycle, with and without reprojection, as a test counts them in the code: aging,
moving, choosing and smoothing. The update by a batch is priced per sample."""
SAMPLE_FLOPS = 740.0
"""Operations per sample, an upper bound: replacement of non-finite values 6, encoding 6, roughness 24, sums 16,
projection 40, update of the pixel 135, drift of a shadow 85, and 3 x 3 pixels of roughness around it 9 x 35, with about
100 to spare."""
_STEP = torch.tensor(GOLDEN_2D, dtype=torch.float64)
_WARMUP_FRAMES = 12  # as many as accumulating framed renderers have
_TILES_A_PROBE = 64
_FIRST_CYCLE = 1 << 20  # numbers of warm-up cycles are above its negative


@dataclass(frozen=True)
class State:
    """The state that one cycle passes to the next.

    Attributes:
        estimates: estimates of all pixels, aged to ``now_s``.
        surfels: surfels of all pixels.
        change: change observed so far.
        drift_s: speed of the shadows over each element, image sides per second, as observed by its newest samples.
        rate: variance per second that estimates gain: the greater of the observed rate and that expected from shadows.
        now_s: start of the newest cycle; None before the first.
        known: poses at the start of the newest cycles, three at most; empty without reprojection.
        view: poses to which estimates are moved, predicted from the known ones for the middle of the picture's display;
            None without reprojection.
        earlier: the ``view`` of the cycle before; None where there was none.
        spacing: distance between samples of each requested tile, pixels.
        visits: number of cycles that sampled each element.
        shown, remaining: the picture, and the variance of its errors.
    """

    estimates: Estimates
    surfels: Surfels
    change: Change
    drift_s: Float[Tensor, "1 e e"]
    rate: Float[Tensor, "1 e e"]
    now_s: float | None
    known: tuple[Viewpoint, ...]
    view: Viewpoint | None
    earlier: Viewpoint | None
    spacing: Float[Tensor, " n"]
    visits: Int64[Tensor, "1 e e"]
    shown: Float[Tensor, "3 h w"]
    remaining: Float[Tensor, "1 h w"]

    @property
    def reprojected(self) -> Surfels | None:
        """Surfels; None without reprojection."""
        return self.surfels if self.view is not None else None


class Filter(Policy[State]):
    """Samples are accumulated in pixels, or on surfaces."""

    def __init__(self, setting: Setting, options: FilterOptions = DEFAULT) -> None:
        super().__init__(setting)
        self._window, self._side = self.config.window, self.config.resolution_px
        self._options = replace(options, reach=options.reach * self._window.reach)
        stages = setting.stages_of(self.config)
        self._stages, self._own_threads = stages.filtering, stages.own_threads
        self._view = setting.view if options.reprojection else None
        self._noisy = options.noise and options.smoothing and setting.random()
        most = options.samples_max(self.config.pixels) // TILE_SIDE**2
        asked = self.config.batch_size * self.config.samples // TILE_SIDE**2
        self._tiles = max(1, min(asked, most))
        cell = morton_to_raster(TILE_SIDE)
        self._cell = torch.stack((cell % TILE_SIDE, cell // TILE_SIDE), dim=1).to(torch.float64)
        self._places, self._kinds = tiles.places(self._side), tiles.spacings(min(self.config.shape))
        self._size = torch.tensor(self.config.shape[::-1], dtype=torch.float64)
        self._sampled = (self._places[:, :2] < self._size.flip(0)).all(1) & (self._places[:, 2] <= self._kinds[0])
        level = max(0, (self._side // self.config.framelet_side).bit_length() - 1)
        self._level = torch.full((self._side, self._side), level)

    @property
    def latency_cycles(self) -> int:  # pyright: ignore[reportIncompatibleVariableOverride]
        return self._options.latency_cycles

    @property
    def footprint(self) -> int:
        return self._options.footprint

    @property
    def own_threads(self) -> bool:
        return self._own_threads

    @property
    def warmup_cycles(self) -> int:
        """Enough cycles to sample every pixel twelve times, whatever their length."""
        return max(self.config.warmup_cycles, _WARMUP_FRAMES * self.config.pixels // (self._tiles * TILE_SIDE**2))

    @property
    def pixel_flops(self) -> float:
        """Operations per output pixel and cycle, without those that tell noise from detail."""
        return PIXEL_FLOPS[self._options.reprojection]

    @property
    def price(self) -> Price:
        pixel_flops = self.pixel_flops + noise.PIXEL_FLOPS * self._noisy
        return Price(self._tiles * TILE_SIDE**2, pixel_flops=pixel_flops, sample_flops=SAMPLE_FLOPS)

    def start(self) -> State:
        side = self._side
        nothing, observed = Estimates.empty(side), Change.empty(side)
        visits, still = torch.zeros_like(observed.rate, dtype=torch.int64), torch.zeros_like(observed.rate)
        return State(nothing, Surfels.empty(side), observed, still, self._rate(observed, still), None, (), None, None,
                     torch.ones(self._tiles), visits, nothing.color, self._window.inside(nothing.variance))  # fmt: skip

    def request(self, state: State, moment: Moment) -> tuple[State, FrameletBatch]:
        """Moves the estimates to the poses of the cycle and requests the samples that they need."""
        state = self._advanced(state, moment)
        state, (x, y, spacing) = self._chosen(state, moment)
        if self._probes(moment):
            spacing[0] = self._kinds[0]
            width = TILE_SIDE * self._kinds[0]
            down, across = (ceil(side / width) for side in self.config.shape)
            number = moment.cycle // self._every % (down * across)
            x[0], y[0] = number % across * width, number // across * width
        place = torch.stack((x, y), dim=1)
        offset = torch.full((self._tiles, 2), 0.5, dtype=torch.float64)
        if self._options.jitter:
            # each tile uses its next point of the sequence, so that a pixel receives consecutive points
            middle = ((place + 0.5 * TILE_SIDE * spacing[:, None]) / ELEMENT_PX).to(torch.int64)
            offset = ((state.visits[0][middle[:, 1], middle[:, 0]][:, None] + 1) * _STEP) % 1.0
        # tiles that extend beyond the picture are shifted to its border
        place = torch.minimum(place, self._size - TILE_SIDE * spacing[:, None])
        position = place[:, None] + (self._cell + offset[:, None]) * spacing[:, None, None]
        position = self._window.of_picture((position / self._side * GRID).floor() / GRID)
        at = torch.arange(self._tiles, dtype=torch.float64) / self._tiles * moment.cycle_s
        times = (moment.time_s + at)[:, None].expand(-1, TILE_SIDE**2).contiguous()
        none = torch.zeros(self._tiles, dtype=torch.int64)
        batch = FrameletBatch(
            none, none, position.to(torch.float32), times, cycle=moment.cycle, seed=self.config.seed,
            hits=state.view is not None,
        )  # fmt: skip
        counted = slice(1 if self._probes(moment) else 0, None)  # a probe does not advance the points of other tiles
        visits = state.visits + tiles.covered(x[counted], y[counted], spacing[counted], self._side)
        return replace(state, spacing=spacing.to(torch.float32), visits=visits), batch

    def observe(
        self, state: State, batch: FrameletBatch, samples: SampleBatch, moment: Moment, timer: StageTimer
    ) -> State:
        with timer("response"):
            state = self._updated(state, batch, samples, moment)
        with timer("reconstruction"):
            return self._displayed(state, moment)

    def image(self, state: State, moment: Moment) -> Picture:
        newest = SampleMap(state.estimates.time_s[0], self._level, state.estimates.inverse[0])
        carried = partial(self._carried, state, moment) if self._options.smoothing else None
        return Picture(state.shown.permute(1, 2, 0).contiguous(), newest, maps=_maps(state), carried=carried)

    def _carried(self, state: State, moment: Moment, image: Float[Tensor, "h w 3"]) -> Float[Tensor, "h w 3"]:
        """The picture that would be shown if all estimates had these colours, with the same variances."""
        color = image.permute(2, 0, 1).clamp(0.0, samples.COLOR_MAX).contiguous()
        shown = self._displayed(state, moment, color).shown
        return shown.permute(1, 2, 0).contiguous()

    def _advanced(self, state: State, moment: Moment) -> State:
        estimates, surfels, known, now_s = state.estimates, state.surfels, state.known, moment.time_s
        seconds = now_s - state.now_s if state.now_s is not None else 0.0
        view = self._window.on_plane(self._view(now_s)) if self._view is not None else None
        if view is not None and view.kind == "panorama":
            view = None
        if view is not None:
            known = (*known[-2:], view)
            shown_s = mid_display_s(now_s, moment.cycle_s, self.latency_cycles)
            view = predicted(known, shown_s) if self._options.prediction else view
            estimates, surfels = self._stages.advanced(estimates, surfels, state.rate, seconds, view)
        else:
            estimates = estimates.later(state.rate, seconds)
        return replace(
            state, estimates=estimates, surfels=surfels, now_s=now_s, known=known, view=view, earlier=state.view
        )

    def _chosen(
        self, state: State, moment: Moment
    ) -> tuple[State, tuple[Float64[Tensor, " n"], Float64[Tensor, " n"], Float64[Tensor, " n"]]]:
        """Left and upper edges of the tiles and their spacing, pixels. Tiles are ordered by their rate of change: those
        that change fastest are sampled last."""
        state, chosen = self._picked(state, moment)
        found = torch.cat([level.reshape(-1) for level in chosen]).nonzero().squeeze(1)
        tile = self._places[found[self._sampled[found]]]
        if len(tile) < self._tiles:
            tile = tile[torch.arange(self._tiles) % len(tile)]
        middle = ((tile[:, :2] + 0.5 * TILE_SIDE * tile[:, 2:]) / ELEMENT_PX).to(torch.int64)
        order = torch.argsort(state.rate[0][middle[:, 0], middle[:, 1]], stable=True)
        y, x, spacing = tile[order].unbind(1)
        return state, (x, y, spacing)

    def _picked(self, state: State, moment: Moment) -> tuple[State, list[Bool[Tensor, "_ _"]]]:
        """The tiles to sample, a mask for every spacing."""
        if not self._options.by_gain:
            first = (moment.cycle + _FIRST_CYCLE) * self._tiles
            return state, tiles.in_turn(self._side, self._sampled, first, self._tiles)
        return state, self._stages.chosen(
            state.remaining, state.estimates.roughness, state.rate, state.reprojected, moment.cycle_s, self._tiles,
            self._options,
        )  # fmt: skip

    def _probes(self, moment: Moment) -> bool:
        """Whether the first tile of a cycle is a probe where no change is expected."""
        return self._options.probes and self._options.by_gain and moment.cycle % self._every == 0

    @property
    def _every(self) -> int:
        """Number of cycles from one probe to the next."""
        return max(1, _TILES_A_PROBE // self._tiles)

    def _updated(self, state: State, batch: FrameletBatch, answered: SampleBatch, moment: Moment) -> State:
        color = replace_nonfinite(answered.color, TILE_SIDE)[0].clamp(0.0, samples.COLOR_MAX)
        place = self._window.of_plane(batch.position)
        traced = Traced(
            color, place * self._side, batch.times, state.spacing, moment.time_s, moment.cycle_s,
            answered.hits, state.view, state.earlier,
        )  # fmt: skip
        after = self._stages.taken_in(state.estimates, state.surfels, state.change, traced, self._options)
        estimates, surfels, observed = after
        drift_s = self._shadows(state, place, answered, moment)
        rate = self._rate(observed, drift_s)
        return replace(state, estimates=estimates, surfels=surfels, change=observed, drift_s=drift_s, rate=rate)

    def _shadows(
        self, state: State, place: Float[Tensor, "n samples 2"], answered: SampleBatch, moment: Moment
    ) -> Float[Tensor, "1 e e"]:
        if not self._options.shadows or answered.hits is None or state.view is None or state.earlier is None:
            return state.drift_s
        return self._stages.drifted(state.drift_s, place, answered.hits, state.view, state.earlier, moment.cycle_s)

    def _rate(self, observed: Change, drift_s: Float[Tensor, "1 e e"]) -> Float[Tensor, "1 e e"]:
        return torch.maximum(observed.rate, shadows.expected_rate(drift_s, self._options.reach))

    def _displayed(self, state: State, moment: Moment, color: Float[Tensor, "3 h w"] | None = None) -> State:
        surfels, estimates = state.reprojected, state.estimates
        between = self._stages.detailed(estimates) if self._noisy else None
        if color is not None:
            estimates = replace(estimates, color=color)
        if not self._options.smoothing:
            later = estimates.later(state.rate, moment.cycle_s)
            later = later if surfels is None else later.beside(surfels)
            return replace(state, shown=later.color, remaining=self._window.inside(later.variance))
        shown, remaining = self._stages.displayed(estimates, surfels, state.rate, moment.cycle_s, between)
        return replace(state, shown=shown, remaining=remaining)


def _maps(state: State) -> Mapping[str, MapShown]:
    """The estimated rate of change of the picture, and the expected error of each pixel."""
    return WhenAsked({
        "rate of change": lambda: MapShown(state.rate[0], (1e-4, 1.0), "variance per second"),
        "expected error": lambda: MapShown(square_root(state.remaining[0]), (0.003, 0.3), "RMS"),
    })  # fmt: skip


WITHOUT_REPROJECTION = FilterOptions(
    reprojection=False, probes=False, share_max=1.0, life_min_s=0.1, life_max_s=1.0, memory_s=0.1
)
"""The filter alone. Its samples are useful for a shorter time, because they do not follow moving surfaces."""
unmoved = partial(Filter, options=WITHOUT_REPROJECTION)
"""The filter without reprojection."""
