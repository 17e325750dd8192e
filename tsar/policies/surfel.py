"""Reprojected surfels under the control of the dissertation: one point per pixel, with errors measured after
reprojection.

A cycle moves the points to their positions at the new poses, updates them by the new samples, and draws them. The
response of ``thesis`` receives the error that remains after reprojection: in space the variance of the mean, in time
the variance from change. All elements have an error in every cycle, not only the sampled ones. Transport, tiling and
selection are those of ``thesis``; estimates are those of :mod:`tsar.policies.filter`.

Deviation: the tolerated power follows the mean of the picture; the dissertation has a fixed template. With a fixed one
all elements of a fast pan ask for density, none frees it, and densities do not change.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import torch
import torch.nn.functional as F
from jaxtyping import Float, Float64
from torch import Tensor

from tsar.clock import StageTimer
from tsar.config import TsarConfig
from tsar.filtering import splats
from tsar.filtering.options import DEFAULT, FilterOptions
from tsar.filtering.records import ELEMENT_PX, SPACINGS, TILE_SIDE, VARIANCE_MAX
from tsar.morton import deinterleave, morton_to_raster
from tsar.policies.filter import SAMPLE_FLOPS, Filter, State
from tsar.policy import Moment, Price, Setting, require_square
from tsar.response import initial_densities
from tsar.selection import initial_history
from tsar.types import Densities, Errors

PIXEL_FLOPS = 440.0
"""Operations per output pixel and cycle, as a test counts them: aging, moving, errors, points and smoothing."""
ELEMENT_FLOPS = 147.0
"""Operations of response, tiling and selection per element of the field. Source: Stephens 2011, table 7.1; a count of
the code gives about 136."""
SPATIAL = 2.0**-12
TEMPORAL = 2.0**-11
"""Variances that are tolerated in every picture, in space (``SPATIAL``) and in time."""


@dataclass(frozen=True)
class SurfelState(State):
    """The state of the filter, and that of the response.

    Attributes:
        densities: sample densities.
        history: credit of every element.
    """

    densities: Densities
    history: Float64[Tensor, " elements"]


class Surfel(Filter):
    """Points, sampled by densities in space and in time."""

    def __init__(self, setting: Setting, options: FilterOptions = DEFAULT) -> None:
        super().__init__(setting, options)
        require_square(self.config, "surfel")
        within = self.config.samples // TILE_SIDE**2
        self.config = _smaller(self.config, max(1, self._tiles // within))
        self._tiles = within * self.config.batch_size
        self._stages = replace(self._stages, advanced=splats.advanced)
        self._decide = setting.stages_of(self.config).decide

    @property
    def price(self) -> Price:
        elements = self.config.sdf_side**2 / self._side**2
        return Price(
            self._tiles * TILE_SIDE**2, pixel_flops=PIXEL_FLOPS + ELEMENT_FLOPS * elements, sample_flops=SAMPLE_FLOPS
        )

    def start(self) -> SurfelState:
        return SurfelState(
            **vars(super().start()), densities=initial_densities(self.config), history=initial_history(self.config)
        )

    def _chosen(
        self, state: State, moment: Moment
    ) -> tuple[State, tuple[Float64[Tensor, " n"], Float64[Tensor, " n"], Float64[Tensor, " n"]]]:
        """The framelets that are due, each divided into tiles of 8 x 8 samples."""
        assert isinstance(state, SurfelState)
        made = self._decide(state.densities, self._errors(state, moment), state.history, self.config, StageTimer())
        across = self.config.framelet_side // TILE_SIDE
        part_x, part_y = deinterleave(torch.arange(across**2))
        column, row = deinterleave(made.due.index)
        tiles = torch.exp2(made.due.level.to(torch.float64)) * across  # tiles of this size along the image's side
        width = (self._side / tiles)[:, None].expand(-1, across**2).reshape(-1)
        x, y = ((of[:, None] * across + part).reshape(-1) * width for of, part in ((column, part_x), (row, part_y)))
        return replace(state, densities=made.densities, history=made.due.history), (x, y, width / TILE_SIDE)

    def _displayed(self, state: State, moment: Moment, color: Float[Tensor, "3 h w"] | None = None) -> State:
        estimates = state.estimates if color is None else replace(state.estimates, color=color)
        later = estimates.later(state.rate, moment.cycle_s)
        depth = torch.ones_like(later.time_s) if state.view is None else splats.depths(state.surfels, state.view)
        shown, remaining = splats.drawn(later, state.surfels, depth)
        return replace(state, shown=shown, remaining=remaining)

    def _errors(self, state: State, moment: Moment) -> Errors:
        """Errors of all elements of the field: ``(S - T) / (S + T)`` with the remaining variance ``S`` and the
        tolerated one ``T``. A pixel without estimate has the spatial variance of one sample and the greatest temporal
        variance, because it needs coarse samples first.

        ``T`` is the mean over the picture of the sum of both variances, at least :data:`SPATIAL` or :data:`TEMPORAL`.
        So some elements free density in every picture, and where all ask for more, space is traded for time or time for
        space.
        """
        estimates = state.estimates
        left = torch.where(estimates.known, estimates.observed, 0.5 * estimates.roughness).clamp(max=VARIANCE_MAX)
        space = F.avg_pool2d(left[None], ELEMENT_PX)[0]
        time = F.avg_pool2d(estimates.aged[None], ELEMENT_PX)[0] + state.rate * moment.cycle_s
        usual = float((space + time).reshape(-1).cumsum(0)[-1]) / space.numel()
        pairs = (space, max(SPATIAL, usual)), (time, max(TEMPORAL, usual))
        return Errors(*(self._field((signal - least) / (signal + least)) for signal, least in pairs))

    def _field(self, plane: Float[Tensor, "1 e e"]) -> Float[Tensor, " elements"]:
        """A plane resampled to the field of the densities, Morton order."""
        side, wide = self.config.sdf_side, plane.shape[-1]
        if wide > side:
            plane = F.avg_pool2d(plane[None], wide // side)[0]
        elif wide < side:
            plane = plane.repeat_interleave(side // wide, 1).repeat_interleave(side // wide, 2)
        return plane.reshape(-1)[morton_to_raster(side)]


def _smaller(config: TsarConfig, batch_size: int) -> TsarConfig:
    """A configuration with smaller batches and equally many tiles, whose spacings are limited to
    :data:`tsar.filtering.records.SPACINGS`. The least temporal density shrinks in proportion to the batch."""
    pixels = config.resolution_px // config.framelet_side
    fine = min(config.level_max, int(pixels / SPACINGS[-1]).bit_length() - 1)
    coarse = min(max(config.level_min, int(pixels / SPACINGS[0]).bit_length() - 1), fine)
    share = batch_size / config.batch_size / 4 ** (coarse - config.level_min)
    count = min(max(config.tile_count_max, 4**coarse), 4**fine)
    tiling = replace(config.tiling, level_min=coarse, level_max=fine, rate_max=0, tile_count_max=count)
    response = replace(config.response, temporal_min=max(config.response.temporal_min * share, 1e-6))
    return replace(config, batch_size=batch_size, tiling=tiling, response=response)
