"""The metallic-roughness surface of glTF, with a clear coat.

Source: Khronos Group, "glTF 2.0 specification", appendix B; extension KHR_materials_clearcoat.
"""

from __future__ import annotations

import warp as wp

from renderer.kernels.scattering.facets import facet_density, schlick, seen_share, visible_density, visible_normal
from renderer.kernels.scattering.lobes import Chosen, Lobes, Response, brightness, cosine_direction, mirrored


@wp.func
def straight_reflectance(lobes: Lobes) -> wp.vec3:
    """Reflectance at normal incidence: that of the refractive index, or the colour of a metal."""
    straight = wp.pow((1.0 - lobes.ratio) / (1.0 + lobes.ratio), 2.0)
    return wp.vec3(straight, straight, straight) * (1.0 - lobes.metallic) + lobes.base * lobes.metallic


@wp.func
def clear_reflectance(lobes: Lobes, outgoing: wp.vec3) -> wp.float32:
    """Share of light that the clear coat reflects."""
    return lobes.clear * schlick(wp.vec3(0.04, 0.04, 0.04), outgoing[2])[0]


@wp.func
def metallic_shares(lobes: Lobes, outgoing: wp.vec3) -> wp.vec3:
    """Probabilities of the clear coat, the facets and the diffuse part."""
    clear = clear_reflectance(lobes, outgoing)
    facets = brightness(schlick(straight_reflectance(lobes), outgoing[2])) * (1.0 - clear)
    diffuse = brightness(lobes.base) * (1.0 - lobes.metallic) * (1.0 - clear)
    return wp.vec3(clear, facets, diffuse) / wp.max(clear + facets + diffuse, 1.0e-12)


@wp.func
def metallic_response(lobes: Lobes, outgoing: wp.vec3, arriving: wp.vec3) -> Response:
    """``((1 - F) diffuse / pi + F D G / (4 cos_i cos_o)) cos_i``, attenuated by the clear coat, plus the coat's own
    response."""
    response = Response()
    if arriving[2] <= 0.0 or outgoing[2] <= 0.0:
        return response
    half = wp.normalize(outgoing + arriving)
    toward = wp.dot(outgoing, half)
    shares = metallic_shares(lobes, outgoing)
    clear = clear_reflectance(lobes, outgoing)
    reflected = schlick(straight_reflectance(lobes), toward)
    shape = facet_density(lobes.alpha, half[2]) * seen_share(lobes.alpha, outgoing[2])
    shape = shape * seen_share(lobes.alpha, arriving[2]) / (4.0 * outgoing[2])
    below = wp.cw_mul(wp.vec3(1.0, 1.0, 1.0) - reflected, lobes.base) * ((1.0 - lobes.metallic) * arriving[2] / wp.pi)
    response.value = (below + reflected * shape) * (1.0 - clear)
    choice = wp.max(4.0 * toward, 1.0e-9)
    response.density = shares[2] * arriving[2] / wp.pi
    response.density = response.density + shares[1] * visible_density(lobes.alpha, outgoing, half) / choice
    if lobes.clear > 0.0:
        alpha = lobes.clear_alpha
        coat = facet_density(alpha, half[2]) * seen_share(alpha, outgoing[2]) * seen_share(alpha, arriving[2])
        coat = clear * coat / (4.0 * outgoing[2])
        response.value = response.value + wp.vec3(coat, coat, coat)
        response.density = response.density + shares[0] * visible_density(alpha, outgoing, half) / choice
    return response


@wp.func
def metallic_chosen(lobes: Lobes, outgoing: wp.vec3, choice: wp.float32, point: wp.vec2) -> Chosen:
    """A direction sampled from one of the three parts."""
    chosen = Chosen()
    chosen.squeeze = 1.0
    chosen.density = 1.0
    shares = metallic_shares(lobes, outgoing)
    if choice < shares[0]:
        chosen.direction = mirrored(outgoing, visible_normal(lobes.clear_alpha, outgoing, point))
    elif choice < shares[0] + shares[1]:
        chosen.direction = mirrored(outgoing, visible_normal(lobes.alpha, outgoing, point))
    else:
        chosen.direction = cosine_direction(point)
    return chosen
