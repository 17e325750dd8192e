"""The update of the estimates, the surfels and the observed change by a batch of samples."""

from __future__ import annotations

from dataclasses import dataclass, replace

import torch
from jaxtyping import Float, Float64
from torch import Tensor

from tsar.filtering import change, samples, wavelets
from tsar.filtering.options import FilterOptions
from tsar.filtering.records import Change, Estimates, Surfels
from tsar.projection import project
from tsar.roots import encoded
from tsar.types import Hits, Viewpoint


@dataclass(frozen=True)
class Traced:
    """The samples traced in a cycle.

    Attributes:
        color: linear RGB, finite, at most :data:`tsar.filtering.samples.COLOR_MAX`.
        position: sample positions on the image, pixels.
        time_s: animation time of each sample, seconds.
        spacing: distance between samples of each tile, pixels.
        now_s: start of the cycle, seconds.
        cycle_s: length of the cycle before, seconds.
        hits, view: first hits, and the poses to which estimates were moved; None without reprojection.
        earlier: poses of the cycle before; None where there was none.
    """

    color: Float[Tensor, "n samples 3"]
    position: Float[Tensor, "n samples 2"]
    time_s: Float64[Tensor, "n samples"]
    spacing: Float[Tensor, " n"]
    now_s: float
    cycle_s: float
    hits: Hits | None = None
    view: Viewpoint | None = None
    earlier: Viewpoint | None = None


def taken_in(
    estimates: Estimates,
    surfels: Surfels,
    known: Change,
    traced: Traced,
    options: FilterOptions,
    picture: tuple[int, int] | None = None,
) -> tuple[Estimates, Surfels, Change]:
    """Estimates, surfels and change after a batch.

    A sample belongs to the pixel in which its first hit is seen at the start of the cycle.

    Args:
        estimates, surfels: moved and aged to the start of the cycle. A compiled set of stages overwrites them.
        known: change observed before the batch.
        traced: the batch.
        options: options of the filter.
        picture: height and width of the part of the plane beyond which samples are left out; None for all of it.
    """
    side, now_s, hits, view = estimates.color.shape[-1], traced.now_s, traced.hits, traced.view
    position: Tensor = traced.position.reshape(-1, 2)
    if view is not None and hits is not None:
        place, depth = project(view, hits.instance.reshape(-1), hits.point.reshape(-1, 3))
        position = torch.where((depth > 0.0)[:, None], place * side, -1.0)
    pixel = samples.pixels_of(position, side, picture)
    color = encoded(traced.color)
    rough = wavelets.semivariance_of(color) if options.wavelets else samples.semivariance_of(color)
    seen = samples.gathered(traced.color, traced.time_s, traced.spacing, pixel, now_s, estimates.roughness, rough)
    judged = replace(estimates, roughness=seen.roughness)
    if options.wavelets:
        found = wavelets.residuals(judged, color, pixel, seen.count)
    else:
        found = change.residuals(judged, seen.color, seen.count)
    elapsed_s, compared = seen.time_s - estimates.time_s, seen.hit & estimates.known
    changed = change.observed(known, *found, elapsed_s, compared, now_s, traced.cycle_s, options)
    if view is None or hits is None:
        none = torch.zeros_like(estimates.variance)
        after, _ = samples.updated(estimates, seen, changed.rate_px, now_s, none > 0.0, none, options)
        return after, surfels, changed
    found = samples.met(hits, seen, surfels, view, traced.earlier)
    after, share = samples.updated(
        estimates.beside(surfels), seen, changed.rate_px, now_s, found.replaced, found.least_share, options
    )
    after = replace(after, aged=torch.where(seen.hit, after.aged, estimates.aged))
    return after, samples.joined(surfels, found, seen.hit, share), changed
