"""Isotropic microfacets with the distribution of Trowbridge and Reitz (GGX).

Masking and shadowing follow Smith, in the separable form.

Source: Walter et al. 2007, "Microfacet Models for Refraction through Rough Surfaces"; Heitz 2018, "Sampling the GGX
Distribution of Visible Normals".
"""

from __future__ import annotations

import warp as wp


@wp.func
def facet_density(alpha: wp.float32, cosine: wp.float32) -> wp.float32:
    """Density ``D`` of the facets' normals at a cosine to the surface normal: area of facets per solid angle and area
    of the surface."""
    a = alpha * alpha
    b = (a - 1.0) * cosine * cosine + 1.0
    return a / wp.max(wp.pi * b * b, 1.0e-20)


@wp.func
def seen_share(alpha: wp.float32, cosine: wp.float32) -> wp.float32:
    """Masking ``G₁``: share of the facets that are not hidden along a direction."""
    squared = wp.max(cosine * cosine, 1.0e-12)
    tangent = (1.0 - squared) / squared
    return 2.0 / (1.0 + wp.sqrt(1.0 + alpha * alpha * wp.max(tangent, 0.0)))


@wp.func
def visible_density(alpha: wp.float32, outgoing: wp.vec3, normal: wp.vec3) -> wp.float32:
    """Density of :func:`visible_normal`, per solid angle of the normal."""
    toward = wp.max(wp.dot(outgoing, normal), 0.0)
    return seen_share(alpha, outgoing[2]) * toward * facet_density(alpha, normal[2]) / wp.max(outgoing[2], 1.0e-6)


@wp.func
def visible_normal(alpha: wp.float32, outgoing: wp.vec3, point: wp.vec2) -> wp.vec3:
    """A facet's normal, sampled by the visible area of the facets from a direction above the surface."""
    stretched = wp.normalize(wp.vec3(alpha * outgoing[0], alpha * outgoing[1], outgoing[2]))
    squared = stretched[0] * stretched[0] + stretched[1] * stretched[1]
    first = wp.vec3(1.0, 0.0, 0.0)
    if squared > 1.0e-14:
        first = wp.vec3(-stretched[1], stretched[0], 0.0) / wp.sqrt(squared)
    second = wp.cross(stretched, first)
    radius = wp.sqrt(point[0])
    turn = 2.0 * wp.pi * point[1]
    x = radius * wp.cos(turn)
    y = radius * wp.sin(turn)
    share = 0.5 * (1.0 + stretched[2])
    y = (1.0 - share) * wp.sqrt(wp.max(1.0 - x * x, 0.0)) + share * y
    z = wp.sqrt(wp.max(1.0 - x * x - y * y, 0.0))
    normal = x * first + y * second + z * stretched
    return wp.normalize(wp.vec3(alpha * normal[0], alpha * normal[1], wp.max(normal[2], 1.0e-6)))


@wp.func
def schlick(straight: wp.vec3, cosine: wp.float32) -> wp.vec3:
    """Schlick's approximation of the reflectance, ``F₀ + (1 - F₀) (1 - cos)⁵`` (Schlick 1994)."""
    away = wp.clamp(1.0 - cosine, 0.0, 1.0)
    share = away * away * away * away * away
    return straight + (wp.vec3(1.0, 1.0, 1.0) - straight) * share
