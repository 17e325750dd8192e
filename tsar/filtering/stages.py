"""The stages of the filter as its policy sees them: functions, of which compiled sets give the same bits."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from torch import Tensor

from tsar.filtering.batches import Traced, taken_in
from tsar.filtering.display import smoothed
from tsar.filtering.motion import moved
from tsar.filtering.records import Change, Estimates, FilterOptions, Surfels
from tsar.filtering.tiles import chosen
from tsar.types import Viewpoint


@dataclass(frozen=True)
class FilterStages:
    """One function a stage; arguments and results are those of the reference, which is the default.

    Attributes:
        moved: estimates and surfels as new poses show them.
        chosen: the tiles to sample.
        taken_in: estimates, surfels and change after a batch.
        smoothed: the picture, and the variance of its errors.
    """

    moved: Callable[[Estimates, Surfels, Viewpoint], tuple[Estimates, Surfels]] = moved
    chosen: Callable[[Tensor, Tensor, Tensor, Tensor, float, int, FilterOptions], list[Tensor]] = chosen
    taken_in: Callable[[Estimates, Surfels, Change, Traced, FilterOptions], tuple[Estimates, Surfels, Change]] = (
        taken_in
    )
    smoothed: Callable[[Tensor, Tensor, Tensor], tuple[Tensor, Tensor]] = smoothed


REFERENCE = FilterStages()
"""Tensor operations throughout."""
