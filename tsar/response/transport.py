"""Density transport: how much of each element's desired change is granted, so that the total is conserved.

Every solver takes ``desired`` and ``bound`` (same sign, ``|bound| >= |desired|``) and the surplus C with its bound, and
returns ``change`` with ``0 <= change / desired``, ``|change| <= |bound|`` and ``0 <= C - sum(change) <= C_max``.

A is the set of elements that ask for density and B the set that frees it.

Source: Stephens 2011, sec. 6.3.

Deviation: eq. 6.27 has a sign slip. Freed density that nobody takes adds to the surplus: ``C' = C - sum(change)``.
"""

from __future__ import annotations

from collections.abc import Callable

import torch
import torch.nn.functional as F

from tsar.morton import morton_to_raster, raster_to_morton, total
from tsar.response.local import Field

TransportSolver = Callable[[Field, Field, float, float], Field]
"""``(desired, bound, surplus, surplus_max) -> change``: one way to pick a solution out of the set of eq. 6.36."""

_DIFFUSION_STEPS = 32
"""Explicit steps of diffusion: density travels about the square root of that many elements a decision."""
_EXACT_SHARE = 1e-4
"""Of all weights: above it a difference of sums is exact to a trillionth."""


def fill(direction: Field, bound: Field, target: float) -> Field:
    """``min(λ * direction, bound)`` with the λ that makes it sum to ``target``: water poured into vessels.

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
    # A difference loses weights that are many decades below the whole: what is left of it is summed from the far end.
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
    """Magnitudes of desired change and bound for A and for B, zero outside each set."""
    asks, frees = desired > 0, desired < 0
    zero = torch.zeros_like(desired)
    return (
        torch.where(asks, desired, zero),
        torch.where(asks, bound, zero),
        torch.where(frees, -desired, zero),
        torch.where(frees, -bound, zero),
    )


def _max_weight(desired: Field, bound: Field) -> float:
    """The greatest common weight of one side: ``min(bound / desired)`` over it (eq. 6.40–6.41)."""
    active = desired > 0
    return float((bound[active] / desired[active]).min()) if bool(active.any()) else 0.0


def trivial(desired: Field, bound: Field, surplus: float, surplus_max: float) -> Field:
    """No change of combined density (fig. 6.5c)."""
    return torch.zeros_like(desired)


def slow_greater(desired: Field, bound: Field, surplus: float, surplus_max: float) -> Field:
    """Point b: the side that wants more is slowed to the other; no surplus is used or made (fig. 6.5d, 6.8)."""
    ask, _, free, _ = _sides(desired, bound)
    return _slowed(ask, free)


def _slowed(ask: Field, free: Field) -> Field:
    """The greater side scaled down to the sum of the lesser."""
    total_ask, total_free = total(ask), total(free)
    flux = min(total_ask, total_free)
    return _scaled(ask, total_ask, flux) - _scaled(free, total_free, flux)


def scale_lesser(desired: Field, bound: Field, surplus: float, surplus_max: float) -> Field:
    """Point e with a running surplus: the lesser side is sped up by one weight as far as its tightest element allows,
    and the surplus takes or gives what is left (sec. 6.3.2.3)."""
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
    """The side that wants more is squared before it is normalised to the other, so that large responses are slowed
    least (fig. 6.5e); elements at their bound pass the rest on."""
    ask, ask_bound, free, free_bound = _sides(desired, bound)
    total_ask, total_free = total(ask), total(free)
    flux = min(total_ask, total_free)
    if total_ask >= total_free:
        return fill(ask.square(), ask_bound, flux) - fill(free, free_bound, flux)
    return fill(ask, ask_bound, flux) - fill(free.square(), free_bound, flux)


def descend(desired: Field, bound: Field, surplus: float, surplus_max: float) -> Field:
    """The lesser side goes to its bounds; the greater is served in descending order until the sums meet, the rest gets
    nothing (fig. 6.5f)."""
    ask, ask_bound, free, free_bound = _sides(desired, bound)
    total_ask, total_free = total(ask), total(free)
    if total_ask >= total_free:
        flux = min(total(free_bound), total_ask)
        return _largest_first(ask, flux) - fill(free, free_bound, flux)
    flux = min(total(ask_bound), total_free)
    return fill(ask, ask_bound, flux) - _largest_first(free, flux)


def _largest_first(side: Field, flux: float) -> Field:
    """Full desired change in descending order while the sum stays within ``flux``; the element that would pass it gets
    what is left."""
    ordered, order = torch.sort(side, descending=True, stable=True)
    before = torch.cumsum(ordered, 0) - ordered
    granted = torch.zeros_like(side)
    granted[order] = torch.minimum(ordered, (flux - before).clamp(min=0.0))
    return granted


def waterfill(desired: Field, bound: Field, surplus: float, surplus_max: float) -> Field:
    """``clip(λ * desired, bound)`` with one λ a side: each element is sped up or slowed alike until its own bound, so
    that the many elements at a bound do not hold back the few that are not (sec. 6.3.2.4).

    The side that wants less is sped up towards the other as far as its bounds allow; what is missing comes out of the
    surplus, what is left over goes into it.
    """
    ask, ask_bound, free, free_bound = _sides(desired, bound)
    total_ask, total_free = total(ask), total(free)
    if total_ask >= total_free:
        freed = min(total(free_bound), total_ask)
        given = min(total_ask, freed + surplus)
    else:
        given = min(total(ask_bound), total_free)
        freed = min(total_free, given + surplus_max - surplus)
    # A side that gets all it wants gets exactly that: what an element may do beside hangs on it, and must not hang
    # on how a sum was rounded.
    gains = ask if given == total_ask else fill(ask, ask_bound, given)
    return gains - (free if freed == total_free else fill(free, free_bound, freed))


def diffusion(desired: Field, bound: Field, surplus: float, surplus_max: float) -> Field:
    """Density flows between neighbouring elements, from those that free it to those that ask, as heat does.

    What is left to hand out is a field that starts as the desired change and diffuses over the elements that have an
    error; what flowed into or out of an element is its change, as far as its sign and its bound allow, and the greater
    side is slowed to the lesser. The field is in Morton order, ``4^k`` elements. No surplus is used or made.

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
