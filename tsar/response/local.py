"""Local constraints: from errors to a desired and a greatest change of combined density at every element.

Works in normalised densities: each axis divided by its maximum, so that a unit of error means the same on both.

Source: Stephens 2011, sec. 6.2.

Deviation: eq. 6.12 is misprinted (``a_t`` and repeated bounds in the spatial rows) and eq. 6.13 as printed is always
zero, because two of its four distances are negative; here the distance at which the ray leaves the box is computed. The
extremum of eq. 6.21 can lie outside the box: it counts only inside, and ``k_max`` is always a bound.

Deviation: at a wall of the box, a component of the error that points out of it is dropped. Otherwise the ray would
leave at distance zero and fix the element permanently, whatever the other axis needs: static detail at the finest level
would keep its refresh rate for ever (sec. 6.3.2.4 reports 97 % of all elements at a bound). Instead the element slides
along the wall.
"""

from __future__ import annotations

from dataclasses import dataclass

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from tsar.roots import square_root
from tsar.types import Errors

Field = Float[Tensor, " e"]
AT_WALL = 1e-9
"""Relative distance from a bound within which a density counts as at the bound."""


@dataclass(frozen=True)
class Box:
    """Bounds of the normalised densities: ``(min, 1)`` on either axis."""

    spatial_min: float
    temporal_min: float


@dataclass(frozen=True)
class LocalConstraints:
    """Constraints of every element, normalised, float64.

    Attributes:
        a_s, a_t: densities before the decision.
        m_s, m_t: mixture, a unit vector, or zero where no move is possible.
        k_min: requested distance, clamped to the box; k_max: distance to the wall of the box.
        desired_change: Δθ* at ``k_min``; max_change: Δθ_max, of the same sign and at least as large.
    """

    a_s: Field
    a_t: Field
    m_s: Field
    m_t: Field
    k_min: Field
    k_max: Field
    desired_change: Field
    max_change: Field

    @property
    def active(self) -> Bool[Tensor, " e"]:
        return (self.m_s != 0) | (self.m_t != 0)


def area_change(a_s: Field, a_t: Field, m_s: Field, m_t: Field, k: Field) -> Field:
    """``Area(a + k m) - Area(a) = k (a_s m_t + a_t m_s + k m_s m_t)``, computed without subtracting areas.

    Source: Stephens 2011, eq. 6.16, 6.18.
    """
    return k * (a_s * m_t + a_t * m_s + m_s * m_t * k)


def exit_distance(a: Field, m: Field, low: float, high: float) -> Field:
    """Distance at which a ray from ``a`` within ``[low, high]`` leaves the interval along one axis; inf where
    ``m = 0``."""
    wall = torch.where(m > 0, high - a, low - a)
    return torch.where(m == 0, torch.inf, wall / torch.where(m == 0, 1.0, m)).clamp(min=0.0)


def _drop_outward(a: Field, phi: Field, low: float) -> Field:
    """The error, set to 0 where it points out of ``[low, 1]`` at a wall (up to rounding)."""
    at_wall = ((phi < 0) & (a <= low * (1 + AT_WALL))) | ((phi > 0) & (a >= 1 - AT_WALL))
    return torch.where(at_wall, 0.0, phi)


def constrain(a_s: Field, a_t: Field, errors: Errors, box: Box, gain: float) -> LocalConstraints:
    """Desired and greatest change of combined density, for normalised densities ``a`` inside the box.

    An element moves along ``a + k m``, ``m = phi / |phi|``; components of the error ``phi`` that point out of the box
    at its wall are dropped first. It leaves the box at ``k_max``; the requested distance
    ``k_min = min(k_max, gain |phi|)`` gives the desired change. The greatest change is that at ``k_max``. Where
    ``m_s m_t < 0``, it is that at the extremum ``k = -(a_s m_t + a_t m_s) / (2 m_s m_t)`` instead, if that lies before
    ``k_max`` and ``k_min`` is less than twice as far; beyond that the change has the opposite sign.

    Source: Stephens 2011, eq. 6.8–6.22.
    """
    phi_s = _drop_outward(a_s, errors.spatial.to(a_s.dtype), box.spatial_min)
    phi_t = _drop_outward(a_t, errors.temporal.to(a_t.dtype), box.temporal_min)
    # Not hypot: its vectorised and its scalar form differ in the last bit, and the number of threads decides which
    # runs.
    length = square_root(phi_s * phi_s + phi_t * phi_t)
    unit = torch.where(length > 0, length, 1.0)
    m_s, m_t = phi_s / unit, phi_t / unit
    k_max = torch.minimum(exit_distance(a_s, m_s, box.spatial_min, 1.0), exit_distance(a_t, m_t, box.temporal_min, 1.0))
    k_max = torch.where(length > 0, k_max, 0.0)
    k_min = torch.minimum(k_max, gain * length)
    desired = area_change(a_s, a_t, m_s, m_t, k_min)
    product = m_s * m_t
    opposed = product < 0
    extremum = -(a_s * m_t + a_t * m_s) / torch.where(opposed, 2.0 * product, 1.0)
    use_extremum = opposed & (extremum > 0) & (extremum < k_max) & (k_min < 2.0 * extremum)
    most = area_change(a_s, a_t, m_s, m_t, torch.where(use_extremum, extremum, k_max))
    # Where the two differ by rounding, the desired change is the bound: solvers rely on |desired| <= |max|.
    most = torch.where(desired >= 0, torch.maximum(desired, most), torch.minimum(desired, most))
    return LocalConstraints(a_s, a_t, m_s, m_t, k_min, k_max, desired, most)
