"""Diffuse surfaces: Lambertian ones and rough ones."""

from __future__ import annotations

import warp as wp

from renderer.kernels.scattering.lobes import Lobes, Response


@wp.func
def diffuse_response(lobes: Lobes, outgoing: wp.vec3, arriving: wp.vec3) -> Response:
    """``albedo / pi (A + B max(0, cos dphi) sin a tan b)`` times the cosine; A is 1 and B is 0 for a Lambertian
    surface.

    Source: Oren and Nayar 1994, "Generalization of Lambert's Reflectance Model", eq. 30.
    """
    response = Response()
    if arriving[2] <= 0.0 or outgoing[2] <= 0.0:
        return response
    factor = lobes.rough[0]
    if lobes.rough[1] > 0.0:
        sines = wp.sqrt(wp.max((1.0 - arriving[2] * arriving[2]) * (1.0 - outgoing[2] * outgoing[2]), 0.0))
        if sines > 1.0e-6:
            across = arriving[0] * outgoing[0] + arriving[1] * outgoing[1]
            # cos dphi sin a tan b = (across / sines) sines / the greater cosine
            factor = factor + lobes.rough[1] * wp.max(across, 0.0) / wp.max(arriving[2], outgoing[2])
    response.value = lobes.base * (factor * arriving[2] / wp.pi)
    response.density = arriving[2] / wp.pi
    return response
