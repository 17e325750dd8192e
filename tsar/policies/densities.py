"""``tsar`` with parts of the dissertation: densities in space and in time, the sum of whose products is conserved,
instead of the gain of tiles; and wavelets instead of semivariance and residuals.

Everything else is as in :mod:`tsar.policies.filter`, so that the contribution of each part can be measured.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial

import torch
import torch.nn.functional as F
from jaxtyping import Bool, Float64
from torch import Tensor

from tsar.filtering import densities
from tsar.filtering.options import DEFAULT, FilterOptions
from tsar.filtering.records import ELEMENT_PX, TILE_SIDE
from tsar.policies.filter import Filter, State
from tsar.policy import Moment, Setting, require_square

_AGED = 4.0
"""Weight of the variance from change so far, relative to that of the next cycle; values from 1 to 8 give the same error
within 5 %."""

PIXEL_FLOPS = 310.0
"""Operations per output pixel and cycle, as a test counts them: aging, moving, densities and smoothing."""


@dataclass(frozen=True)
class DenseState(State):
    """The state of the filter, and the θ_t that elements have accumulated since they were sampled.

    Attributes:
        credit: number of refreshes that are due.
    """

    credit: Float64[Tensor, "1 e e"]


class ByDensities(Filter):
    """Tiles follow θ_s and are sampled when their θ_t is due."""

    def __init__(self, setting: Setting, options: FilterOptions = DEFAULT) -> None:
        super().__init__(setting, options)
        require_square(self.config, "tsar-densities")

    @property
    def pixel_flops(self) -> float:
        return PIXEL_FLOPS

    def start(self) -> DenseState:
        """The initial credit is a seeded permutation in [0, 1), as in :func:`tsar.selection.initial_history`."""
        side = self._side // ELEMENT_PX
        generator = torch.Generator().manual_seed(self.config.seed)
        credit = torch.randperm(side**2, generator=generator).to(torch.float64).reshape(1, side, side) / side**2
        return DenseState(**vars(super().start()), credit=credit)

    def _picked(self, state: State, moment: Moment) -> tuple[State, list[Bool[Tensor, "_ _"]]]:
        """Roughness determines the samples in space, change the refreshes: the change expected in the next cycle and
        that since the last sample. It is greatest where a surface comes into sight."""
        assert isinstance(state, DenseState)
        rough = F.avg_pool2d(state.estimates.roughness[None], ELEMENT_PX)[0].to(torch.float64)
        aged = F.avg_pool2d(state.estimates.aged[None], ELEMENT_PX)[0].to(torch.float64)
        stale = _AGED * aged + state.rate.to(torch.float64) * moment.cycle_s
        budget = self._tiles * TILE_SIDE**2 / self._side**2
        spatial, temporal = densities.best(rough, stale, budget)
        chosen, credit = densities.due(densities.tiling(spatial), temporal, state.credit, self._tiles)
        return replace(state, credit=credit), chosen


by_wavelets = partial(Filter, options=replace(DEFAULT, wavelets=True))
"""Tiles chosen by gain; roughness and change from wavelets."""
dense_by_wavelets = partial(ByDensities, options=replace(DEFAULT, wavelets=True))
"""Tiles chosen by densities; roughness and change from wavelets."""
