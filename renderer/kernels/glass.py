"""Dielectrics: Snell's law and Fresnel's equations, and the secondary rays of glass."""

from __future__ import annotations

import warp as wp

from renderer.kernels.textures import texture_color
from renderer.layout.structs import MaterialRecord, SceneData, Surface


@wp.struct
class Sent:
    """Weights of the rays along the two perfect directions of a surface, and the direction of the refracted one."""

    reflection: wp.vec3
    refraction: wp.vec3
    through: wp.vec3  # direction of the refracted ray


@wp.func
def dielectric_reflectance(cosine: wp.float32, ratio: wp.float32) -> wp.float32:
    """Unpolarised reflectance of a dielectric; 1 beyond the critical angle.

    ``cosine`` is the cosine of the incident angle; ``ratio`` is the refractive index on the incident side over that on
    the other side. With ``beyond = sqrt(1 - ratio² (1 - cosine²))`` the amplitudes are
    ``(ratio cosine - beyond) / (ratio cosine + beyond)`` and ``(cosine - ratio beyond) / (cosine + ratio beyond)``; the
    reflectance is the mean of their squares.
    """
    squared = ratio * ratio * wp.max(1.0 - cosine * cosine, 0.0)
    if squared >= 1.0:
        return 1.0
    beyond = wp.sqrt(1.0 - squared)
    # amplitudes perpendicular and parallel to the plane of incidence (Born and Wolf, sec. 1.5.2)
    across = (ratio * cosine - beyond) / (ratio * cosine + beyond)
    within = (cosine - ratio * beyond) / (cosine + ratio * beyond)
    return wp.min(0.5 * (across * across + within * within), 1.0)


@wp.func
def refracted(direction: wp.vec3, normal: wp.vec3, cosine: wp.float32, ratio: wp.float32) -> wp.vec3:
    """Unit direction of the refracted ray (Snell's law), for a ray below the critical angle."""
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
    """Weights from Fresnel's equations; for ``thin`` panes the reflections between their faces are summed."""
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
        # radiance scales with the square of the index (Veach 1997, eq. 5.2)
        scale = ratio * ratio
    sent.reflection = texture_color(features, scene, material.mirror, surface.uv, footprint) * reflectance
    passed = (1.0 - reflectance) * scale
    sent.refraction = texture_color(features, scene, material.transmission, surface.uv, footprint) * passed
    return sent
