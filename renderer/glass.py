"""Dielectrics: Snell's law and Fresnel's equations."""

from __future__ import annotations

import warp as wp


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
