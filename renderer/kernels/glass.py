"""Dielectrics: Snell's law and Fresnel's equations, and what a surface of glass sends on."""

from __future__ import annotations

import warp as wp

from renderer.kernels.textures import texture_color
from renderer.layout.structs import MaterialRecord, SceneData, Surface


@wp.struct
class Sent:
    """What leaves a surface along the two perfect directions: what each ray is weighed with."""

    reflection: wp.vec3
    refraction: wp.vec3
    through: wp.vec3  # direction of the refracted ray


@wp.func
def dielectric_reflectance(cosine: wp.float32, ratio: wp.float32) -> wp.float32:
    """Unpolarised reflectance of a dielectric; 1 beyond the critical angle.

    ``cosine`` is that of the arriving ray against the normal on its side; ``ratio`` is the index on the arriving side
    over that beyond.
    """
    squared = ratio * ratio * wp.max(1.0 - cosine * cosine, 0.0)
    if squared >= 1.0:
        return 1.0
    beyond = wp.sqrt(1.0 - squared)
    # amplitudes across and in the plane of incidence (Born and Wolf, sec. 1.5.2), divided by the index beyond
    across = (ratio * cosine - beyond) / (ratio * cosine + beyond)
    within = (cosine - ratio * beyond) / (cosine + ratio * beyond)
    return wp.min(0.5 * (across * across + within * within), 1.0)


@wp.func
def refracted(direction: wp.vec3, normal: wp.vec3, cosine: wp.float32, ratio: wp.float32) -> wp.vec3:
    """Unit direction beyond a surface (Snell's law), for a ray below the critical angle."""
    squared = ratio * ratio * wp.max(1.0 - cosine * cosine, 0.0)
    beyond = wp.sqrt(wp.max(1.0 - squared, 0.0))
    return wp.normalize(ratio * direction + (ratio * cosine - beyond) * normal)


@wp.func
def sent_by_glass(
    features: wp.int32,
    scene: SceneData,
    surface: Surface,
    material: MaterialRecord,
    cosine: wp.float32,
    footprint: wp.float32,
    direction: wp.vec3,
) -> Sent:
    """The shares of Fresnel's equations; ``thin`` panes sum the reflections between their faces."""
    sent = Sent()
    ratio = 1.0 / material.ior
    if surface.inside and material.thin == 0:
        ratio = material.ior
    reflectance = dielectric_reflectance(cosine, ratio)
    sent.through = direction
    scale = wp.float32(1.0)
    if material.thin != 0:
        reflectance = 2.0 * reflectance / (1.0 + reflectance)
    elif reflectance < 1.0:
        sent.through = refracted(direction, surface.normal, cosine, ratio)
        # radiance is squeezed into, or let out of, the smaller solid angle inside (Veach 1997, eq. 5.2)
        scale = ratio * ratio
    sent.reflection = texture_color(features, scene, material.mirror, surface.uv, footprint) * reflectance
    passed = (1.0 - reflectance) * scale
    sent.refraction = texture_color(features, scene, material.transmission, surface.uv, footprint) * passed
    return sent
