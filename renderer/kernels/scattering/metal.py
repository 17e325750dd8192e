"""Metals: microfacets with a complex refractive index."""

from __future__ import annotations

import warp as wp

from renderer.kernels.scattering.distributions import density_of, masked, normal_density
from renderer.kernels.scattering.lobes import Lobes, Response


@wp.func
def conductor_reflectance(cosine: wp.float32, eta: wp.float32, k: wp.float32) -> wp.float32:
    """Unpolarised reflectance of a conductor with the index ``eta + i k`` (Born and Wolf, sec. 14.2)."""
    c = wp.clamp(cosine, 0.0, 1.0)
    s = 1.0 - c * c
    inner = eta * eta - k * k - s
    root = wp.sqrt(inner * inner + 4.0 * eta * eta * k * k)
    a = wp.sqrt(wp.max(0.5 * (root + inner), 0.0))
    across = (root + c * c - 2.0 * a * c) / (root + c * c + 2.0 * a * c)
    other = c * c * root + s * s
    within = across * (other - 2.0 * a * c * s) / wp.max(other + 2.0 * a * c * s, 1.0e-20)
    return 0.5 * (across + within)


@wp.func
def metal_reflectance(lobes: Lobes, cosine: wp.float32) -> wp.vec3:
    """Reflectance of each channel."""
    found = wp.vec3(
        conductor_reflectance(cosine, lobes.eta[0], lobes.k[0]),
        conductor_reflectance(cosine, lobes.eta[1], lobes.k[1]),
        conductor_reflectance(cosine, lobes.eta[2], lobes.k[2]),
    )
    return wp.cw_mul(found, lobes.specular)


@wp.func
def metal_response(lobes: Lobes, outgoing: wp.vec3, arriving: wp.vec3) -> Response:
    """``F D G / (4 cos_o)`` of the facets halfway between both directions, with the cosine of the outgoing one."""
    response = Response()
    if arriving[2] <= 0.0 or outgoing[2] <= 0.0:
        return response
    half = wp.normalize(outgoing + arriving)
    toward = wp.dot(outgoing, half)
    choice = wp.max(4.0 * toward, 1.0e-9)
    shape = density_of(lobes, half[2]) * masked(lobes, outgoing[2])
    shape = shape * masked(lobes, arriving[2]) / (4.0 * outgoing[2])
    response.value = metal_reflectance(lobes, toward) * shape
    response.density = normal_density(lobes, outgoing, half) / choice
    return response
