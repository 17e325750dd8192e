"""Isotropic microfacets with the distribution of Beckmann and Spizzichino.

Deviation: masking is the rational approximation that other renderers use, too, and normals are sampled by their own
density, not by their visible area.

Source: Walter et al. 2007, "Microfacet Models for Refraction through Rough Surfaces", eqs 25, 27 and 28.
"""

from __future__ import annotations

import warp as wp


@wp.func
def beckmann_density(alpha: wp.float32, cosine: wp.float32) -> wp.float32:
    """Density ``D`` of the facets' normals, as :func:`renderer.kernels.scattering.facets.facet_density`."""
    squared = wp.max(cosine * cosine, 1.0e-8)
    a = alpha * alpha
    return wp.exp((squared - 1.0) / (squared * a)) / (wp.pi * a * squared * squared)


@wp.func
def beckmann_seen(alpha: wp.float32, cosine: wp.float32) -> wp.float32:
    """Masking ``G₁``, as :func:`renderer.kernels.scattering.facets.seen_share`."""
    squared = wp.max(cosine * cosine, 1.0e-12)
    steep = wp.sqrt(wp.max((1.0 - squared) / squared, 0.0)) * alpha
    if steep * 1.6 <= 1.0:
        return 1.0
    a = 1.0 / steep
    return (3.535 * a + 2.181 * a * a) / (1.0 + 2.276 * a + 2.577 * a * a)


@wp.func
def beckmann_normal(alpha: wp.float32, point: wp.vec2) -> wp.vec3:
    """A facet's normal, sampled with the density ``D cos``."""
    steep = -alpha * alpha * wp.log(wp.max(1.0 - point[0], 1.0e-12))
    cosine = 1.0 / wp.sqrt(1.0 + steep)
    sine = wp.sqrt(wp.max(1.0 - cosine * cosine, 0.0))
    turn = 2.0 * wp.pi * point[1]
    return wp.vec3(sine * wp.cos(turn), sine * wp.sin(turn), cosine)
