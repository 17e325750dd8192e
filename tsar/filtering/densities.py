"""Selection of tiles after the dissertation: densities of samples in space and in time, the sum of whose products is
conserved; a tiling that follows the spatial density; and credit that accumulates the temporal one.

Elements are those in which change is observed, of :data:`tsar.filtering.records.ELEMENT_PX` pixels a side.

Source: Stephens 2011, sec. 3.1.1, 4.1.6 and 3.4.4.1 for densities, tiling and selection.

Deviation: the densities are optimal for the state of every element, in closed form; in the thesis a response moves them
step by step (chapter 6). Their products sum to the budget, and there is no surplus.
"""

from __future__ import annotations

from math import sqrt

import torch
import torch.nn.functional as F
from jaxtyping import Bool, Float64
from torch import Tensor

from tsar.filtering.records import ELEMENT_PX, SPACINGS, TILE_SIDE
from tsar.filtering.tiles import doubled, spacings
from tsar.roots import cube_root, square_root

SPATIAL = 1.0 / SPACINGS[0] ** 2, 1.0 / SPACINGS[-1] ** 2
"""Least and greatest θ_s, samples per pixel: the densities of the coarsest and the finest tiles."""
TEMPORAL = 1.0 / 128.0, 1.0
"""Least and greatest θ_t, refreshes per cycle."""
_BISECTIONS = 40
_SCALES = 2.0**-30, 2.0**30

Field = Float64[Tensor, "1 e e"]


def best(coarse: Field, stale: Field, mean: float) -> tuple[Field, Field]:
    """The densities θ_s, samples per pixel, and θ_t, refreshes per cycle, that minimise ``Σ (a / θ_s + b / θ_t)`` at
    ``Σ θ_s θ_t = budget``, within :data:`SPATIAL` and :data:`TEMPORAL`.

    With ``a`` and ``b`` the arguments ``coarse`` and ``stale``, inside the bounds ``θ_s = (a² / λb)^⅓`` and
    ``θ_t = (b² / λa)^⅓``. Where one of them is at a bound the other is ``sqrt(a / λθ_t)`` or ``sqrt(b / λθ_s)``. The
    multiplier λ is found by bisection.

    Args:
        coarse: error ``a`` that falls with θ_s, the roughness; above 0.
        stale: error ``b`` that falls with θ_t, the variance from change in a cycle; above 0.
        mean: budget, samples per pixel and cycle; between the products of the least and of the greatest densities.
    """
    spatial, temporal = cube_root(coarse * (coarse / stale)), cube_root(stale * (stale / coarse))

    def at(scale: float) -> tuple[Field, Field]:
        """Both densities for ``λ = scale⁻³``. A bound may be applied to either first; each element takes the better
        result."""
        price = 1.0 / scale**3
        time = (temporal * scale).clamp(*TEMPORAL)
        space = (spatial * scale).clamp(*SPATIAL)
        space_1 = square_root(coarse / (price * time)).clamp(*SPATIAL)
        time_2 = square_root(stale / (price * space)).clamp(*TEMPORAL)
        first = coarse / space_1 + stale / time + price * space_1 * time
        second = coarse / space + stale / time_2 + price * space * time_2
        less = first <= second
        return torch.where(less, space_1, space), torch.where(less, time, time_2)

    low, high = _SCALES
    for _ in range(_BISECTIONS):
        scale = sqrt(low * high)
        space, time = at(scale)
        if float((space * time).reshape(-1).cumsum(0)[-1]) > mean * space.numel():
            high = scale
        else:
            low = scale
    return at(low)


def tiling(spatial: Field) -> list[Bool[Tensor, "_ _"]]:
    """Tiles that cover the image once: a mask for every spacing of :func:`tsar.filtering.tiles.spacings`, coarsest
    first. A tile is split while more samples are requested in it than it holds."""
    kinds = spacings(spatial.shape[-1] * ELEMENT_PX)
    asked = [spatial * float(ELEMENT_PX**2)]  # in the finest tiles, one per element
    for _ in kinds[1:]:
        asked.append(4.0 * F.avg_pool2d(asked[-1][None], 2)[0])
    found, there = [], torch.ones_like(asked[-1][0], dtype=torch.bool)
    for number, samples in enumerate(reversed(asked)):
        split = there & (samples[0] > TILE_SIDE**2) & (number + 1 < len(kinds))
        found.append(there & ~split)
        there = doubled(split)
    return found


def due(
    tiles: list[Bool[Tensor, "_ _"]], temporal: Field, credit: Field, count: int
) -> tuple[list[Bool[Tensor, "_ _"]], Field]:
    """The ``count`` most overdue tiles of a tiling, and the credit that is left.

    Every element accumulates its θ_t each cycle as credit. The priority of a tile is the mean credit of its elements; a
    refresh subtracts 1, and the remainder is clamped to [-1, 1]. Among equal tiles the coarser comes first, then the
    earlier in raster order. If the tiling has fewer than ``count`` tiles, all are taken.
    """
    credit = credit + temporal
    overdue = [credit]
    for _ in tiles[1:]:
        overdue.append(F.avg_pool2d(overdue[-1][None], 2)[0])
    overdue.reverse()
    of_all = torch.cat([level[0][there] for level, there in zip(overdue, tiles, strict=True)])
    order = torch.sort(of_all, descending=True, stable=True).indices[:count]
    taken = torch.zeros_like(of_all, dtype=torch.bool)
    taken[order] = True
    chosen, left, first = [], torch.full_like(overdue[0], torch.nan)[0], 0
    for level, there in zip(overdue, tiles, strict=True):
        last = first + int(there.sum())
        mine = torch.zeros_like(there)
        mine[there] = taken[first:last]
        left = torch.where(mine, (level[0] - 1.0).clamp(-1.0, 1.0), left if not chosen else doubled(left))
        chosen.append(mine)
        first = last
    return chosen, torch.where(left.isnan(), credit[0], left)[None]
