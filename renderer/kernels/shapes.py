"""Intersection of rays with boxes, spheres, flat shapes and cubes, each in its own space."""

from __future__ import annotations

import warp as wp

from renderer.layout.sizes import FAR, SPHERE_SLACK, TINY


@wp.func
def reciprocal(direction: wp.vec3) -> wp.vec3:
    """Component-wise 1 / x, large but finite for zero, so that slab tests produce no NaN."""
    x = wp.where(wp.abs(direction[0]) > TINY, direction[0], TINY)
    y = wp.where(wp.abs(direction[1]) > TINY, direction[1], TINY)
    z = wp.where(wp.abs(direction[2]) > TINY, direction[2], TINY)
    return wp.vec3(1.0 / x, 1.0 / y, 1.0 / z)


@wp.func
def meets_box(origin: wp.vec3, inverse: wp.vec3, lower: wp.vec3, upper: wp.vec3, t_max: wp.float32) -> wp.bool:
    """Whether a ray passes through an axis-aligned box before ``t_max``."""
    a = wp.cw_mul(lower - origin, inverse)
    b = wp.cw_mul(upper - origin, inverse)
    near = wp.max(wp.max(wp.min(a[0], b[0]), wp.min(a[1], b[1])), wp.max(wp.min(a[2], b[2]), 0.0))
    far = wp.min(wp.min(wp.max(a[0], b[0]), wp.max(a[1], b[1])), wp.min(wp.max(a[2], b[2]), t_max))
    return near <= far


@wp.func
def sphere_distance(origin: wp.vec3, direction: wp.vec3) -> wp.float32:
    """Distance to the unit sphere along a unit direction, negative for a miss.

    Source: Haines, Günther and Akenine-Möller 2019, "Precision Improvements for Ray/Sphere Intersection".
    """
    b = wp.dot(origin, direction)
    nearest = origin - b * direction
    discriminant = 1.0 - wp.dot(nearest, nearest)
    if discriminant < 0.0:
        return -1.0
    c = wp.dot(origin, origin) - 1.0
    root = wp.sqrt(discriminant)
    if b > 0.0:
        far = -b - root  # both roots share this denominator; here the ray moves away from the centre
        t = c / far
        if t >= 0.0:
            return t
        return -1.0
    far = -b + root
    t = c / far
    if t >= 0.0:
        return t
    return far


@wp.func
def plane_distance(origin: wp.vec3, direction: wp.vec3, disk: wp.bool) -> wp.float32:
    """Distance to the unit disk or to the square [-1, 1]² at z = 0, negative for a miss."""
    if direction[2] == 0.0:
        return -1.0
    t = -origin[2] / direction[2]
    x = origin[0] + t * direction[0]
    y = origin[1] + t * direction[1]
    if disk:
        if x * x + y * y > 1.0:
            return -1.0
    elif wp.abs(x) > 1.0 or wp.abs(y) > 1.0:
        return -1.0
    return t


@wp.func
def cube_distance(origin: wp.vec3, direction: wp.vec3):
    """Distance to the cube [-1, 1]³, negative for a miss, and the face: its axis, plus 3 on the negative side."""
    inverse = reciprocal(direction)
    near = wp.float32(-FAR)
    far = wp.float32(FAR)
    near_face = wp.int32(0)
    far_face = wp.int32(0)
    for axis in range(3):
        a = (-1.0 - origin[axis]) * inverse[axis]
        b = (1.0 - origin[axis]) * inverse[axis]
        enter = wp.min(a, b)
        leave = wp.max(a, b)
        if enter > near:
            near = enter
            near_face = axis + wp.where(inverse[axis] > 0.0, 3, 0)
        if leave < far:
            far = leave
            far_face = axis + wp.where(inverse[axis] > 0.0, 0, 3)
    if near > far or far < 0.0:
        return -1.0, 0
    if near >= 0.0:
        return near, near_face
    return far, far_face


@wp.func
def misses_sphere(from_center: wp.vec3, direction: wp.vec3, radius: wp.float32, t_max: wp.float32) -> wp.bool:
    """Whether a ray from ``from_center``, relative to a sphere's centre, certainly stays outside the sphere up to
    ``t_max``."""
    b = wp.dot(from_center, direction)
    squared = wp.dot(from_center, from_center)
    if squared <= radius * radius:
        return False
    nearest = from_center - b * direction
    # the slack covers the rounding error of a distant origin
    return b > 0.0 or -b - radius > t_max or wp.dot(nearest, nearest) > radius * radius + SPHERE_SLACK * squared
