"""Density transport: the change granted to each element, so that the total density is conserved.

Every solver takes ``desired`` and ``bound`` (same sign, ``|bound| >= |desired|``) and the surplus C with its bound, and
returns ``change`` with ``0 <= change / desired``, ``|change| <= |bound|`` and ``0 <= C - sum(change) <= C_max``.

A is the set of elements that ask for density, and B the set of those that free it.

Source: Stephens 2011, sec. 6.3.

Deviation: eq. 6.27 has a sign slip. Freed density that no element takes is added to the surplus:
``C' = C - sum(change)``.
"""

from __future__ import annotations

from collections.abc import Callable

import torch
import torch.nn.functional as F

from tsar.morton import morton_to_raster, raster_to_morton, total
from tsar.response.local import Field

TransportSolver = Callable[[Field, Field, float, float], Field]
"""``(desired, bound, surplus, surplus_max) -> change``: one way to choose a solution from the set of eq. 6.36."""

_DIFFUSION_STEPS = 32
"""Explicit steps of diffusion: density travels about the square root of that many elements per decision."""
_EXACT_SHARE = 1e-4
"""Share of all weights above which a difference of sums has a relative error of at most 1e-12."""


def fill(direction: Field, bound: Field, target: float) -> Field:
    """``min(λ * direction, bound)`` with the λ for which it sums to ``target`` (water filling).

    All arguments are non-negative. Exact up to rounding: the sum is piecewise linear in λ with a knee at every
    ``bound / direction``, so sorting the knees finds the segment and one division finds λ.
    """
    if target <= 0.0:
        return torch.zeros_like(direction)
    active = direction > 0
    weight, vessel = direction[active], bound[active]
    if target >= total(vessel):
        return torch.where(active, bound, 0.0)
    knee, order = torch.sort(vessel / weight, stable=True)
    full = torch.cumsum(vessel[order], 0)
    whole = total(weight)
    open_weight = whole - torch.cumsum(weight[order], 0)
    # A difference loses weights many decades below the total: the remainder is summed from the other end.
    left = F.pad(torch.cumsum(weight[order].flip(0), 0).flip(0)[1:], (0, 1))
    open_weight = torch.where(open_weight > _EXACT_SHARE * whole, open_weight, left)
    at_knee = full + torch.where(open_weight > 0, knee * open_weight, 0.0)
    segment = int(torch.searchsorted(at_knee, torch.tensor(target, dtype=at_knee.dtype)))
    segment = min(segment, knee.numel() - 1)
    before_full = full[segment - 1] if segment > 0 else full.new_zeros(())
    before_weight = total(weight[order][segment:])
    scale = (target - before_full) / before_weight
    poured = torch.zeros_like(direction)
    poured[active] = torch.minimum(scale * weight, vessel)
    return poured


def _sides(desired: Field, bound: Field) -> tuple[Field, Field, Field, Field]:
    """Magnitudes of desired change and bound for the sets A and B, zero outside each set."""
    asks, frees = desired > 0, desired < 0
    zero = torch.zeros_like(desired)
    return (
        torch.where(asks, desired, zero),
        torch.where(asks, bound, zero),
        torch.where(frees, -desired, zero),
        torch.where(frees, -bound, zero),
    )


def _max_weight(desired: Field, bound: Field) -> float:
    """The greatest common weight of one set: ``min(bound / desired)`` over its elements (eq. 6.40–6.41)."""
    active = desired > 0
    return float((bound[active] / desired[active]).min()) if bool(active.any()) else 0.0


def trivial(desired: Field, bound: Field, surplus: float, surplus_max: float) -> Field:
    """No change of combined density (fig. 6.5c)."""
    return torch.zeros_like(desired)


def slow_greater(desired: Field, bound: Field, surplus: float, surplus_max: float) -> Field:
    """Point b: the change of the set with the greater total is scaled down to the other; the surplus is unchanged (fig.
    6.5d, 6.8)."""
    ask, _, free, _ = _sides(desired, bound)
    return _slowed(ask, free)


def _slowed(ask: Field, free: Field) -> Field:
    """Change in which the set with the greater sum is scaled down to the sum of the other."""
    total_ask, total_free = total(ask), total(free)
    flux = min(total_ask, total_free)
    return _scaled(ask, total_ask, flux) - _scaled(free, total_free, flux)


def scale_lesser(desired: Field, bound: Field, surplus: float, surplus_max: float) -> Field:
    """Point e with a running surplus: the change of the set with the lesser total is scaled up by one weight, as far as
    its tightest element allows, and the surplus takes or gives the difference (sec. 6.3.2.3)."""
    ask, ask_bound, free, free_bound = _sides(desired, bound)
    total_ask, total_free = total(ask), total(free)
    if total_ask >= total_free:
        most_free = total_free * _max_weight(free, free_bound)
        given = min(total_ask, most_free + surplus)
        freed = min(most_free, given)
    else:
        most_ask = total_ask * _max_weight(ask, ask_bound)
        freed = min(total_free, most_ask + surplus_max - surplus)
        given = min(most_ask, freed)
    return _scaled(ask, total_ask, given) - _scaled(free, total_free, freed)


def _scaled(side: Field, present: float, wanted: float) -> Field:
    return side * (wanted / present) if present > 0.0 else torch.zeros_like(side)


def square(desired: Field, bound: Field, surplus: float, surplus_max: float) -> Field:
    """The set with the greater total is squared before it is normalised to the other, so that large responses are
    reduced least (fig. 6.5e); the excess of elements at their bound is passed on to the others."""
    ask, ask_bound, free, free_bound = _sides(desired, bound)
    total_ask, total_free = total(ask), total(free)
    flux = min(total_ask, total_free)
    if total_ask >= total_free:
        return fill(ask.square(), ask_bound, flux) - fill(free, free_bound, flux)
    return fill(ask, ask_bound, flux) - fill(free.square(), free_bound, flux)


def descend(desired: Field, bound: Field, surplus: float, surplus_max: float) -> Field:
    """The set with the lesser total is filled up to its bounds; the other is served in descending order until the sums
    are equal, and the rest gets nothing (fig. 6.5f)."""
    ask, ask_bound, free, free_bound = _sides(desired, bound)
    total_ask, total_free = total(ask), total(free)
    if total_ask >= total_free:
        flux = min(total(free_bound), total_ask)
        return _largest_first(ask, flux) - fill(free, free_bound, flux)
    flux = min(total(ask_bound), total_free)
    return fill(ask, ask_bound, flux) - _largest_first(free, flux)


def _largest_first(side: Field, flux: float) -> Field:
    """Full desired change in descending order while the sum stays within ``flux``; the element that would exceed it
    gets the remainder."""
    ordered, order = torch.sort(side, descending=True, stable=True)
    before = torch.cumsum(ordered, 0) - ordered
    granted = torch.zeros_like(side)
    granted[order] = torch.minimum(ordered, (flux - before).clamp(min=0.0))
    return granted


def waterfill(desired: Field, bound: Field, surplus: float, surplus_max: float) -> Field:
    """``clip(λ * desired, bound)`` with one λ for A and one for B. All elements of a set are scaled equally up to their
    own bounds, so that the many elements at a bound do not restrict the few others (sec. 6.3.2.4).

    The set with the lesser total is scaled up towards the other as far as its bounds allow. The surplus provides
    missing density and takes excess density.
    """
    ask, ask_bound, free, free_bound = _sides(desired, bound)
    total_ask, total_free = total(ask), total(free)
    if total_ask >= total_free:
        freed = min(total(free_bound), total_ask)
        given = min(total_ask, freed + surplus)
    else:
        given = min(total(ask_bound), total_free)
        freed = min(total_free, given + surplus_max - surplus)
    # A set that is granted all of its change gets it exactly: later decisions compare granted and desired changes, and
    # must not depend on the rounding of a sum.
    gains = ask if given == total_ask else fill(ask, ask_bound, given)
    return gains - (free if freed == total_free else fill(free, free_bound, freed))


def diffusion(desired: Field, bound: Field, surplus: float, surplus_max: float) -> Field:
    """Density flows between neighbouring elements, from those that free it to those that ask for it, as heat does.

    A field starts as the desired change and diffuses over the elements that have an error,
    ``x <- x + sum(x_neighbour - x) / 4`` per step. The net flow of an element is its change, as far as its sign and its
    bound allow, and the set with the greater sum is scaled down to the other. The field is in Morton order, ``4^k``
    elements. The surplus is unchanged.

    Source: Stephens 2011, sec. 8.4, which names transport by a physical process and gives no equation.
    """
    side = round(desired.numel() ** 0.5)
    left = desired[raster_to_morton(side)].reshape(side, side)
    open_ = left != 0
    across, down = 0.25 * (open_[:, 1:] & open_[:, :-1]), 0.25 * (open_[1:] & open_[:-1])
    for _ in range(_DIFFUSION_STEPS):
        flow_x, flow_y = across * (left[:, :-1] - left[:, 1:]), down * (left[:-1] - left[1:])
        left = left - F.pad(flow_x, (0, 1)) + F.pad(flow_x, (1, 0))
        left = left - F.pad(flow_y, (0, 0, 0, 1)) + F.pad(flow_y, (0, 0, 1, 0))
    flowed = desired - left.reshape(-1)[morton_to_raster(side)]
    ask, ask_bound, free, free_bound = _sides(desired, bound)
    return _slowed(
        torch.minimum(torch.where(ask > 0, flowed, 0.0).clamp(min=0.0), ask_bound),
        torch.minimum(torch.where(free > 0, -flowed, 0.0).clamp(min=0.0), free_bound),
    )
