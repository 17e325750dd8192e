"""Transmittance and internal reflectance of dielectric coats.

Those of rough coats are means over the facets visible from a direction: of ``(1 - F) G₁``, and of ``F G₁`` from
inside. Light that meets several facets is lost, as in the reflection of rough surfaces here and in Mitsuba.

Source: Walter et al. 2007, "Microfacet Models for Refraction through Rough Surfaces"; Heitz 2018, "Sampling the GGX
Distribution of Visible Normals".
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from jaxtyping import Float
from numpy.polynomial.chebyshev import cheb2poly
from numpy.typing import NDArray

from scenes.arithmetic import cos, sin

TERMS = 8
"""Number of coefficients of the difference between a rough and a smooth coat."""

_SIDE = 64  # strata along each of two random numbers


def smooth_reflectance(cosine: NDArray[np.float64], ratio: float) -> NDArray[np.float64]:
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


def rough_shares(cosine: float, ratio: float, alpha: float) -> tuple[float, float]:
    """Shares of light along a direction that GGX facets reflect, and transmit, without further facets in its way.

    Args:
        cosine: cosine of the direction to the normal, in (0, 1).
        ratio: refractive index on this side over that beyond.
        alpha: roughness, positive.
    """
    x, y = (part.ravel() for part in np.meshgrid(*[(np.arange(_SIDE) + 0.5) / _SIDE] * 2))
    sine = np.sqrt(1.0 - cosine * cosine)
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
    normal = normal / np.linalg.norm(normal, axis=1, keepdims=True)
    toward = normal[:, 0] * sine + normal[:, 2] * cosine
    reflectance = smooth_reflectance(toward, ratio)
    mirrored = 2.0 * toward * normal[:, 2] - cosine
    beyond = np.sqrt(np.maximum(1.0 - ratio * ratio * (1.0 - toward * toward), 0.0))
    bent = ratio * cosine - (ratio * toward - beyond) * normal[:, 2]
    reflected = np.where(mirrored > 0.0, reflectance * _seen(mirrored, alpha), 0.0)
    passed = np.where(bent > 0.0, (1.0 - reflectance) * _seen(bent, alpha), 0.0)
    return float(reflected.sum() / len(x)), float(passed.sum() / len(x))


def _seen(cosine: NDArray[np.float64], alpha: float) -> NDArray[np.float64]:
    squared = np.maximum(cosine * cosine, 1e-12)
    return 2.0 / (1.0 + np.sqrt(1.0 + alpha * alpha * (1.0 - squared) / squared))


@lru_cache(maxsize=64)
def rough_coat(ior: float, alpha: float) -> tuple[Float[NDArray, " terms"], float]:
    """Coefficients in ``2 c - 1`` of the difference in transmittance between a rough and a smooth coat, lowest power
    first; and the share of diffuse light from inside that a rough coat reflects.

    Args:
        ior: refractive index of the coat.
        alpha: roughness, positive.
    """
    nodes = np.asarray(cos(np.pi * (np.arange(TERMS) + 0.5) / TERMS))
    found = []
    for x in nodes:
        c = 0.5 * (float(x) + 1.0)
        smooth = 1.0 - float(smooth_reflectance(np.array(c), 1.0 / ior))
        found.append(rough_shares(c, 1.0 / ior, alpha)[1] - smooth)
    angle = np.pi * np.arange(TERMS)[:, None] * (np.arange(TERMS) + 0.5) / TERMS
    terms = (np.asarray(cos(angle)) * np.array(found)).sum(axis=1) * (2.0 / TERMS)
    terms[0] *= 0.5
    middles = (np.arange(32) + 0.5) / 32
    inner = sum(2.0 * c * rough_shares(float(c), ior, alpha)[0] for c in middles) / len(middles)
    return cheb2poly(terms), float(inner)
