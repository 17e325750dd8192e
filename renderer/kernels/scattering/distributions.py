"""The microfacets of a surface, by the distribution that its material has."""

from __future__ import annotations

import warp as wp

from renderer.kernels.scattering.beckmann import beckmann_density, beckmann_normal, beckmann_seen
from renderer.kernels.scattering.facets import facet_density, seen_share, visible_density, visible_normal
from renderer.kernels.scattering.lobes import Lobes


@wp.func
def density_of(lobes: Lobes, cosine: wp.float32) -> wp.float32:
    """Density ``D`` of the facets' normals, as :func:`renderer.kernels.scattering.facets.facet_density`."""
    if lobes.beckmann != 0:
        return beckmann_density(lobes.alpha, cosine)
    return facet_density(lobes.alpha, cosine)


@wp.func
def masked(lobes: Lobes, cosine: wp.float32) -> wp.float32:
    """Masking ``G₁``, as :func:`renderer.kernels.scattering.facets.seen_share`."""
    if lobes.beckmann != 0:
        return beckmann_seen(lobes.alpha, cosine)
    return seen_share(lobes.alpha, cosine)


@wp.func
def normal_of(lobes: Lobes, outgoing: wp.vec3, point: wp.vec2) -> wp.vec3:
    """A facet's normal, sampled with :func:`normal_density`."""
    if lobes.beckmann != 0:
        return beckmann_normal(lobes.alpha, point)
    return visible_normal(lobes.alpha, outgoing, point)


@wp.func
def normal_density(lobes: Lobes, outgoing: wp.vec3, normal: wp.vec3) -> wp.float32:
    """Density of a sampled normal, per solid angle: by the visible area of the facets, or for those of Beckmann by
    their area."""
    if lobes.beckmann != 0:
        return beckmann_density(lobes.alpha, normal[2]) * wp.max(normal[2], 0.0)
    return visible_density(lobes.alpha, outgoing, normal)
