"""A dielectric coat over a diffuse base, smooth or rough.

The coat transmits light to the base and back; its internal reflections are summed. The transmittance of a rough coat is
that of a smooth one plus a polynomial (:mod:`renderer.tables.coats`).
"""

from __future__ import annotations

import warp as wp

from renderer.kernels.glass import dielectric_reflectance
from renderer.kernels.scattering.distributions import density_of, masked, normal_density, normal_of
from renderer.kernels.scattering.lobes import Chosen, Lobes, Response, brightness, cosine_direction, mirrored


@wp.func
def coat_chance(lobes: Lobes, reflectance: wp.float32) -> wp.float32:
    """Probability of sampling a direction from the coat."""
    coat = reflectance * brightness(lobes.specular)
    base = (1.0 - reflectance) * brightness(lobes.base)
    return coat / wp.max(coat + base, 1.0e-12)


@wp.func
def coat_passed(lobes: Lobes, cosine: wp.float32) -> wp.float32:
    """Transmittance of the coat for a direction with this cosine to the normal."""
    found = 1.0 - dielectric_reflectance(cosine, lobes.ratio)
    if lobes.alpha > 0.0:
        x = 2.0 * cosine - 1.0
        low = lobes.passed_low
        high = lobes.passed_high
        upper = high[0] + x * (high[1] + x * (high[2] + x * high[3]))
        found = found + low[0] + x * (low[1] + x * (low[2] + x * (low[3] + x * upper)))
    return wp.clamp(found, 0.0, 1.0)


@wp.func
def coated_response(lobes: Lobes, outgoing: wp.vec3, arriving: wp.vec3) -> Response:
    """``albedo T_o T_i ratio² cos / (pi (1 - inner))``, plus the facets of a rough coat."""
    response = Response()
    if arriving[2] <= 0.0 or outgoing[2] <= 0.0:
        return response
    reflectance = dielectric_reflectance(outgoing[2], lobes.ratio)
    let_in = coat_passed(lobes, arriving[2])
    chance = coat_chance(lobes, reflectance)
    passed = coat_passed(lobes, outgoing[2]) * let_in * lobes.ratio * lobes.ratio / (1.0 - lobes.inner)
    response.value = lobes.base * (passed * arriving[2] / wp.pi)
    response.density = (1.0 - chance) * arriving[2] / wp.pi
    if lobes.alpha > 0.0:
        half = wp.normalize(outgoing + arriving)
        toward = wp.dot(outgoing, half)
        shape = density_of(lobes, half[2]) * masked(lobes, outgoing[2])
        shape = shape * masked(lobes, arriving[2]) / (4.0 * outgoing[2])
        response.value = response.value + lobes.specular * (dielectric_reflectance(toward, lobes.ratio) * shape)
        choice = normal_density(lobes, outgoing, half) / wp.max(4.0 * toward, 1.0e-9)
        response.density = response.density + chance * choice
    return response


@wp.func
def coated_chosen(lobes: Lobes, outgoing: wp.vec3, choice: wp.float32, point: wp.vec2) -> Chosen:
    """A direction sampled from the coat or from the base."""
    chosen = Chosen()
    chosen.squeeze = 1.0
    reflectance = dielectric_reflectance(outgoing[2], lobes.ratio)
    chance = coat_chance(lobes, reflectance)
    if choice >= chance:
        chosen.density = 1.0
        chosen.direction = cosine_direction(point)
    elif lobes.alpha > 0.0:
        chosen.density = 1.0
        chosen.direction = mirrored(outgoing, normal_of(lobes, outgoing, point))
    else:
        chosen.direction = mirrored(outgoing, wp.vec3(0.0, 0.0, 1.0))
        chosen.weight = lobes.specular * (reflectance / chance)
    return chosen
