"""Glass along paths: smooth, thin, spread over a cone, or rough."""

from __future__ import annotations

import warp as wp

from renderer.kernels.glass import dielectric_reflectance
from renderer.kernels.randomness import cone_direction
from renderer.kernels.scattering.distributions import density_of, masked, normal_density, normal_of
from renderer.kernels.scattering.lobes import Chosen, Lobes, Response, mirrored


@wp.func
def bent(outgoing: wp.vec3, normal: wp.vec3, cosine: wp.float32, ratio: wp.float32) -> wp.vec3:
    """Direction beyond a facet from which light along ``outgoing`` comes (Snell's law)."""
    beyond = wp.sqrt(wp.max(1.0 - ratio * ratio * (1.0 - cosine * cosine), 0.0))
    return wp.normalize((ratio * cosine - beyond) * normal - ratio * outgoing)


@wp.func
def pane_reflectance(reflectance: wp.float32) -> wp.float32:
    """Reflectance ``2 r / (1 + r)`` of a pane: the sum of the reflections between its faces."""
    return 2.0 * reflectance / (1.0 + reflectance)


@wp.func
def glass_response(lobes: Lobes, outgoing: wp.vec3, arriving: wp.vec3) -> Response:
    """Response of rough glass by reflection and refraction; smooth glass has none.

    Source: Walter et al. 2007, eqs 20 and 21.
    """
    response = Response()
    if lobes.alpha <= 0.0 or lobes.thin != 0 or outgoing[2] <= 0.0 or arriving[2] == 0.0:
        return response
    ratio = lobes.ratio
    up = arriving[2] > 0.0
    half = outgoing + arriving
    if not up:
        half = ratio * outgoing + arriving
    if half[2] < 0.0:
        half = -half
    half = wp.normalize(half)
    toward = wp.dot(outgoing, half)
    beside = wp.dot(arriving, half)
    if toward <= 0.0 or (up and beside <= 0.0) or (not up and beside >= 0.0):
        return response
    reflectance = dielectric_reflectance(toward, ratio)
    shape = density_of(lobes, half[2]) * masked(lobes, outgoing[2])
    shape = shape * masked(lobes, wp.abs(arriving[2])) / outgoing[2]
    choice = normal_density(lobes, outgoing, half)
    if up:
        response.value = lobes.specular * (reflectance * shape * 0.25)
        response.density = reflectance * choice / (4.0 * beside)
        return response
    # ``ratio`` is the index on the viewer's side over that beyond; radiance scales with its square
    root = ratio * toward + beside
    spread = wp.abs(beside) / wp.max(root * root, 1.0e-12)
    response.value = lobes.through * ((1.0 - reflectance) * shape * toward * spread * ratio * ratio)
    response.density = (1.0 - reflectance) * choice * spread
    return response


@wp.func
def glass_chosen(lobes: Lobes, outgoing: wp.vec3, choice: wp.float32, point: wp.vec2) -> Chosen:
    """Reflection or refraction, sampled by Fresnel's reflectance."""
    chosen = Chosen()
    chosen.squeeze = 1.0
    normal = wp.vec3(0.0, 0.0, 1.0)
    rough = lobes.alpha > 0.0 and lobes.thin == 0
    if rough:
        normal = normal_of(lobes, outgoing, point)
        chosen.density = 1.0
    cosine = wp.dot(outgoing, normal)
    reflectance = dielectric_reflectance(cosine, lobes.ratio)
    if lobes.thin != 0:
        reflectance = pane_reflectance(reflectance)
    if choice < reflectance:
        chosen.direction = mirrored(outgoing, normal)
        chosen.weight = lobes.specular
    elif lobes.thin != 0:
        chosen.direction = -outgoing
        chosen.weight = lobes.through
        chosen.passes = lobes.cos_spread == 1.0
    else:
        chosen.direction = bent(outgoing, normal, cosine, lobes.ratio)
        chosen.squeeze = lobes.ratio * lobes.ratio
        chosen.weight = lobes.through * chosen.squeeze
    # light that a steep facet sends to the wrong side is lost, as is light scattered by several facets
    if rough and (choice < reflectance) != (chosen.direction[2] > 0.0):
        chosen.density = 0.0
        chosen.weight = wp.vec3(0.0, 0.0, 0.0)
    if lobes.cos_spread < 1.0 and not rough:
        side = wp.where(chosen.direction[2] > 0.0, 1.0, -1.0)
        chosen.direction = cone_direction(chosen.direction, lobes.cos_spread, point)
        chosen.direction[2] = side * wp.max(side * chosen.direction[2], 1.0e-4)
        chosen.direction = wp.normalize(chosen.direction)
    return chosen
