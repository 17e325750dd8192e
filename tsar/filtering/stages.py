"""The stages of the filter as its policy calls them. A compiled set gives the same bits as the reference."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

from torch import Tensor

from tsar.filtering.batches import Traced, taken_in
from tsar.filtering.display import displayed
from tsar.filtering.motion import advanced
from tsar.filtering.noise import detailed
from tsar.filtering.options import FilterOptions
from tsar.filtering.records import Change, Estimates, Surfels
from tsar.filtering.shadows import drifted
from tsar.filtering.tiles import chosen
from tsar.types import Hits, Viewpoint
from tsar.window import Window


@dataclass(frozen=True)
class FilterStages:
    """One function per stage; arguments and results are those of the reference, which is the default.

    Attributes:
        advanced: estimates and surfels at a later time, moved to its poses.
        chosen: the tiles to sample.
        taken_in: estimates, surfels and change after a batch.
        drifted: speed of the shadows over each element, after a batch.
        detailed: the roughness between pixels without noise.
        displayed: the picture, and the variance of its errors.
    """

    advanced: Callable[[Estimates, Surfels, Tensor, float, Viewpoint], tuple[Estimates, Surfels]] = advanced
    chosen: Callable[[Tensor, Tensor, Tensor, Surfels | None, float, int, FilterOptions], list[Tensor]] = chosen
    taken_in: Callable[[Estimates, Surfels, Change, Traced, FilterOptions], tuple[Estimates, Surfels, Change]] = (
        taken_in
    )
    drifted: Callable[[Tensor, Tensor, Hits, Viewpoint, Viewpoint, float], Tensor] = drifted
    detailed: Callable[[Estimates], Tensor] = detailed
    displayed: Callable[[Estimates, Surfels | None, Tensor, float, Tensor | None], tuple[Tensor, Tensor]] = displayed


REFERENCE = FilterStages()
"""The reference: all stages by tensor operations."""


def reference(window: Window) -> FilterStages:
    """The reference for a picture that is a window of the plane: nothing outside it is estimated or sampled."""
    if window.whole:
        return REFERENCE
    shape = window.height_px, window.width_px
    return FilterStages(
        partial(advanced, picture=shape),
        partial(chosen, picture=shape),
        partial(taken_in, picture=shape),
        detailed=partial(detailed, picture=shape),
        displayed=partial(displayed, picture=shape),
    )
