"""Transmittance and internal reflectance of dielectric coats.

Those of rough coats are means over the facets visible from a direction: of ``(1 - F) G₁``, and of ``F G₁`` from
inside. Facets of GGX are sampled by their visible area, and those of Beckmann by their area and weighted. Light that
meets several facets is lost, as in the reflection of rough surfaces here and in Mitsuba.

Source: Walter et al. 2007, "Microfacet Models for Refraction through Rough Surfaces"; Heitz 2018, "Sampling the GGX
Distribution of Visible Normals".
"""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache

import numpy as np
from jaxtyping import Float
from numpy.polynomial.chebyshev import cheb2poly
from numpy.typing import NDArray

from scenes.arithmetic import cos, log, sin
from scenes.canonical.facets import Distribution

Numbers = NDArray[np.float64]

TERMS = 8
"""Number of coefficients of the difference between a rough and a smooth coat."""

_SIDE = 64  # strata along each of two random numbers


def smooth_reflectance(cosine: Numbers, ratio: float) -> NDArray[np.float64]:
    """Unpolarised reflectance of a smooth dielectric, as
    :func:`renderer.kernels.glass.dielectric_reflectance`."""
    squared = ratio * ratio * np.maximum(1.0 - cosine * cosine, 0.0)
    beyond = np.sqrt(np.maximum(1.0 - squared, 0.0))
    across = (ratio * cosine - beyond) / (ratio * cosine + beyond)
    within = (cosine - ratio * beyond) / (cosine + ratio * beyond)
    return np.where(squared >= 1.0, 1.0, 0.5 * (across * across + within * within))


def thrown_back(ior: float) -> float:
    """Internal diffuse reflectance of a smooth dielectric: ``1 - (1 - r) / ior²`` with the external one ``r``.

    ``r = ∫ 2 F sin cos`` over the external angle from 0 to 90 degrees, by Simpson's rule.
    """
    angle = np.linspace(0.0, np.pi / 2.0, 2049)
    cosine = np.asarray(sin(np.pi / 2.0 - angle))
    value = 2.0 * smooth_reflectance(cosine, 1.0 / ior) * np.asarray(sin(angle)) * cosine
    weights = np.full(len(angle), 2.0)
    weights[1::2], weights[[0, -1]] = 4.0, 1.0
    outside = float((weights * value).sum() * (angle[1] / 3.0))
    return 1.0 - (1.0 - outside) / ior**2


def rough_shares(cosine: float, ratio: float, alpha: float, distribution: Distribution) -> tuple[float, float]:
    """Shares of light along a direction that facets reflect, and transmit, without further facets in its way.

    Args:
        cosine: cosine of the direction to the normal, in (0, 1).
        ratio: refractive index on this side over that beyond.
        alpha: roughness, positive.
        distribution: distribution of the facets.
    """
    x, y = (part.ravel() for part in np.meshgrid(*[(np.arange(_SIDE) + 0.5) / _SIDE] * 2))
    sine = np.sqrt(1.0 - cosine * cosine)
    if distribution == "beckmann":
        normal = _beckmann_normals(x, y, alpha)
        toward = np.maximum(normal[:, 0] * sine + normal[:, 2] * cosine, 1e-12)
        share = float(_beckmann_seen(np.array(cosine), alpha)) * toward / (cosine * normal[:, 2])
        return _scattered(normal, toward, cosine, ratio, share, lambda c: _beckmann_seen(c, alpha))
    normal = _visible_normals(x, y, sine, cosine, alpha)
    toward = normal[:, 0] * sine + normal[:, 2] * cosine
    return _scattered(normal, toward, cosine, ratio, np.ones(len(x)), lambda c: _seen(c, alpha))


def _visible_normals(x: Numbers, y: Numbers, sine: float, cosine: float, alpha: float) -> Numbers:
    stretched = np.array([alpha * sine, 0.0, cosine])
    stretched = stretched / np.sqrt((stretched * stretched).sum())
    second = np.array([-stretched[2], 0.0, stretched[0]])  # the stretched direction times (0, 1, 0)
    radius, turn = np.sqrt(x), 2.0 * np.pi * y
    across, along = radius * np.asarray(cos(turn)), radius * np.asarray(sin(turn))
    share = 0.5 * (1.0 + stretched[2])
    along = (1.0 - share) * np.sqrt(np.maximum(1.0 - across * across, 0.0)) + share * along
    up = np.sqrt(np.maximum(1.0 - across * across - along * along, 0.0))
    normal = across[:, None] * np.array([0.0, 1.0, 0.0]) + along[:, None] * second + up[:, None] * stretched
    normal = normal * np.array([alpha, alpha, 1.0])
    return normal / np.linalg.norm(normal, axis=1, keepdims=True)


def _beckmann_normals(x: Numbers, y: Numbers, alpha: float) -> Numbers:
    """Normals with the density ``D cos``, as :mod:`renderer.kernels.scattering.beckmann` samples them."""
    steep = -alpha * alpha * np.asarray(log(1.0 - x))
    up, turn = 1.0 / np.sqrt(1.0 + steep), 2.0 * np.pi * y
    flat = np.sqrt(np.maximum(1.0 - up * up, 0.0))
    return np.stack([flat * np.asarray(cos(turn)), flat * np.asarray(sin(turn)), up], axis=1)


def _scattered(
    normal: Numbers, toward: Numbers, cosine: float, ratio: float, share: Numbers, seen: Callable[[Numbers], Numbers]
) -> tuple[float, float]:
    """Means of the light that facets with these normals and weights reflect and transmit."""
    reflectance = smooth_reflectance(toward, ratio)
    mirrored = 2.0 * toward * normal[:, 2] - cosine
    beyond = np.sqrt(np.maximum(1.0 - ratio * ratio * (1.0 - toward * toward), 0.0))
    bent = ratio * cosine - (ratio * toward - beyond) * normal[:, 2]
    reflected = np.where(mirrored > 0.0, share * reflectance * seen(mirrored), 0.0)
    passed = np.where(bent > 0.0, share * (1.0 - reflectance) * seen(bent), 0.0)
    return float(reflected.sum() / len(share)), float(passed.sum() / len(share))


def _seen(cosine: Numbers, alpha: float) -> Numbers:
    squared = np.maximum(cosine * cosine, 1e-12)
    return 2.0 / (1.0 + np.sqrt(1.0 + alpha * alpha * (1.0 - squared) / squared))


def _beckmann_seen(cosine: Numbers, alpha: float) -> Numbers:
    squared = np.clip(cosine * cosine, 1e-12, 1.0 - 1e-12)
    a = 1.0 / (alpha * np.sqrt((1.0 - squared) / squared))
    return np.where(a >= 1.6, 1.0, (3.535 * a + 2.181 * a * a) / (1.0 + 2.276 * a + 2.577 * a * a))


@lru_cache(maxsize=64)
def rough_coat(ior: float, alpha: float, distribution: Distribution) -> tuple[Float[NDArray, " terms"], float]:
    """Coefficients in ``2 c - 1`` of the difference in transmittance between a rough and a smooth coat, lowest power
    first; and the share of diffuse light from inside that a rough coat reflects.

    Args:
        ior: refractive index of the coat.
        alpha: roughness, positive.
        distribution: distribution of the facets.
    """
    nodes = np.asarray(cos(np.pi * (np.arange(TERMS) + 0.5) / TERMS))
    found = []
    for x in nodes:
        c = 0.5 * (float(x) + 1.0)
        smooth = 1.0 - float(smooth_reflectance(np.array(c), 1.0 / ior))
        found.append(rough_shares(c, 1.0 / ior, alpha, distribution)[1] - smooth)
    angle = np.pi * np.arange(TERMS)[:, None] * (np.arange(TERMS) + 0.5) / TERMS
    terms = (np.asarray(cos(angle)) * np.array(found)).sum(axis=1) * (2.0 / TERMS)
    terms[0] *= 0.5
    middles = (np.arange(32) + 0.5) / 32
    inner = sum(2.0 * c * rough_shares(float(c), ior, alpha, distribution)[0] for c in middles) / len(middles)
    return cheb2poly(terms), float(inner)
