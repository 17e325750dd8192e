"""Records that kinds of surfaces share, and the frame of directions."""

from __future__ import annotations

import warp as wp


@wp.struct
class Lobes:
    """Scattering parameters of a point of a surface, with all textures evaluated."""

    kind: wp.int32
    base: wp.vec3
    specular: wp.vec3
    through: wp.vec3
    alpha: wp.float32
    rough: wp.vec2
    metallic: wp.float32
    clear: wp.float32
    clear_alpha: wp.float32
    ratio: wp.float32  # refractive index on the viewer's side over that beyond
    thin: wp.int32
    eta: wp.vec3
    k: wp.vec3
    beckmann: wp.int32
    inner: wp.float32
    passed_low: wp.vec4
    passed_high: wp.vec4
    exponent: wp.float32
    cos_spread: wp.float32


@wp.struct
class Response:
    """Scattering function times cosine, and the sampling density per solid angle."""

    value: wp.vec3
    density: wp.float32


@wp.struct
class Chosen:
    """A sampled direction of incident light.

    ``weight`` is the response over the density where ``density`` is positive. Without a density the direction is
    perfect, or lies in a cone for which lights are not sampled. ``passes`` marks light that continues undeflected, as
    through a hole; ``squeeze`` is the squared ratio of refractive indices by which radiance was multiplied.
    """

    direction: wp.vec3
    weight: wp.vec3
    density: wp.float32
    passes: wp.bool
    squeeze: wp.float32


@wp.func
def frame_about(axis: wp.vec3) -> wp.mat33:
    """Rows of an orthonormal frame whose z axis is a unit vector.

    Source: Duff et al. 2017, "Building an Orthonormal Basis, Revisited".
    """
    sign = wp.where(axis[2] >= 0.0, 1.0, -1.0)
    a = -1.0 / (sign + axis[2])
    b = axis[0] * axis[1] * a
    return wp.mat33(
        1.0 + sign * axis[0] * axis[0] * a, sign * b, -sign * axis[0],
        b, sign + axis[1] * axis[1] * a, -axis[1],
        axis[0], axis[1], axis[2],
    )  # fmt: skip


@wp.func
def cosine_direction(point: wp.vec2) -> wp.vec3:
    """A direction above the surface with the density ``cos / pi``."""
    radius = wp.sqrt(point[0])
    turn = 2.0 * wp.pi * point[1]
    return wp.vec3(radius * wp.cos(turn), radius * wp.sin(turn), wp.sqrt(wp.max(1.0 - point[0], 0.0)))


@wp.func
def mirrored(outgoing: wp.vec3, normal: wp.vec3) -> wp.vec3:
    """A direction reflected about a normal."""
    return 2.0 * wp.dot(outgoing, normal) * normal - outgoing


@wp.func
def brightness(color: wp.vec3) -> wp.float32:
    """Mean of the channels, from which the probabilities of lobes are computed."""
    return (color[0] + color[1] + color[2]) / 3.0
