"""Phong reflection, as in the tree of rays: a diffuse part, a highlight, and a mirror with a separate weight."""

from __future__ import annotations

import warp as wp

from renderer.kernels.randomness import cone_direction
from renderer.kernels.scattering.lobes import (
    Chosen,
    Lobes,
    Response,
    brightness,
    cosine_direction,
    frame_about,
    mirrored,
)


@wp.func
def phong_shares(lobes: Lobes) -> wp.vec3:
    """Probabilities of the mirror, the highlight and the diffuse part."""
    shares = wp.vec3(brightness(lobes.through), brightness(lobes.specular), brightness(lobes.base))
    return shares / wp.max(shares[0] + shares[1] + shares[2], 1.0e-12)


@wp.func
def phong_response(lobes: Lobes, outgoing: wp.vec3, arriving: wp.vec3) -> Response:
    """``diffuse cos / pi + specular (e + 2) / (2 pi) cos_r^e``, with ``cos_r`` against the mirrored direction:
    :class:`scenes.canonical.Phong` without its mirror."""
    response = Response()
    if arriving[2] <= 0.0:
        return response
    shares = phong_shares(lobes)
    response.value = lobes.base * (arriving[2] / wp.pi)
    response.density = shares[2] * arriving[2] / wp.pi
    if shares[1] > 0.0:
        along = wp.vec3(-outgoing[0], -outgoing[1], outgoing[2])
        lobe = wp.pow(wp.max(wp.dot(along, arriving), 0.0), lobes.exponent) * (0.5 / wp.pi)
        response.value = response.value + lobes.specular * (lobe * (lobes.exponent + 2.0))
        response.density = response.density + shares[1] * lobe * (lobes.exponent + 1.0)
    return response


@wp.func
def mirror_chosen(lobes: Lobes, outgoing: wp.vec3, weight: wp.vec3, point: wp.vec2) -> Chosen:
    """The mirrored direction, or a direction in the cone about it."""
    chosen = Chosen()
    chosen.squeeze = 1.0
    chosen.direction = mirrored(outgoing, wp.vec3(0.0, 0.0, 1.0))
    if lobes.cos_spread < 1.0:
        chosen.direction = cone_direction(chosen.direction, lobes.cos_spread, point)
        chosen.direction[2] = wp.max(chosen.direction[2], 1.0e-4)
        chosen.direction = wp.normalize(chosen.direction)
    chosen.weight = weight
    return chosen


@wp.func
def phong_chosen(lobes: Lobes, outgoing: wp.vec3, choice: wp.float32, point: wp.vec2) -> Chosen:
    """A direction sampled from one of the three parts."""
    shares = phong_shares(lobes)
    if choice < shares[0]:
        return mirror_chosen(lobes, outgoing, lobes.through / shares[0], point)
    chosen = Chosen()
    chosen.squeeze = 1.0
    chosen.density = 1.0
    if choice < shares[0] + shares[1]:
        cosine = wp.pow(1.0 - point[0], 1.0 / (lobes.exponent + 1.0))
        ring = wp.sqrt(wp.max(1.0 - cosine * cosine, 0.0))
        turn = 2.0 * wp.pi * point[1]
        along = wp.vec3(-outgoing[0], -outgoing[1], outgoing[2])
        about = wp.vec3(ring * wp.cos(turn), ring * wp.sin(turn), cosine)
        chosen.direction = wp.transpose(frame_about(along)) * about
    else:
        chosen.direction = cosine_direction(point)
    return chosen
