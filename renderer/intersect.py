"""Rays against instances: nearest hit and occlusion."""

from __future__ import annotations

import warp as wp

from renderer.camera import track_rotation, track_translation
from renderer.features import Feature
from renderer.heightfield import relief_distance
from renderer.structs import (
    SHAPE_CUBE,
    SHAPE_DISK,
    SHAPE_MESH,
    SHAPE_RECTANGLE,
    SHAPE_RELIEF,
    SHAPE_SPHERE,
    Hit,
    InstanceRecord,
    SceneData,
    ViewData,
)

_MESH = wp.constant(SHAPE_MESH)
_SPHERE = wp.constant(SHAPE_SPHERE)
_DISK = wp.constant(SHAPE_DISK)
_RECTANGLE = wp.constant(SHAPE_RECTANGLE)
_CUBE = wp.constant(SHAPE_CUBE)
_RELIEF = wp.constant(SHAPE_RELIEF)
_HAS_MESH = wp.constant(int(Feature.MESH))
_HAS_SPHERE = wp.constant(int(Feature.SPHERE))
_HAS_FLAT = wp.constant(int(Feature.FLAT))
_HAS_CUBE = wp.constant(int(Feature.CUBE))
_HAS_RELIEF = wp.constant(int(Feature.HEIGHT_FIELD))
_HAS_MOTION = wp.constant(int(Feature.MOTION))
_HAS_WARP_TREES = wp.constant(int(Feature.WARP_TREES))

_TINY = wp.constant(1.0e-20)


# On a GPU no mesh comes without a tree of Warp's, so that this is never called there.
_NATIVE = """
#if defined(__CUDACC__) || defined(__CUDA_ARCH__) || defined(__CUDACC_RTC__)
    return wp::vec4(-1.0f, 0.0f, 0.0f, 0.0f);
#else
    packets::RayHit hit;
    const bool found = packets::single_ray<{any}>(scene, mesh, start, towards, reach, (long long*)work.data, hit);
    return wp::vec4(found ? hit.t : -1.0f, hit.u, hit.v, __builtin_bit_cast(float, hit.face));
#endif
"""


@wp.func_native(_NATIVE.replace("{any}", "false"))
def nearest_in_mesh(
    scene: SceneData,
    mesh: wp.int32,
    start: wp.vec3,
    towards: wp.vec3,
    reach: wp.float32,
    work: wp.array(dtype=wp.int64),
) -> wp.vec4: ...


@wp.func_native(_NATIVE.replace("{any}", "true"))
def any_in_mesh(
    scene: SceneData,
    mesh: wp.int32,
    start: wp.vec3,
    towards: wp.vec3,
    reach: wp.float32,
    work: wp.array(dtype=wp.int64),
) -> wp.vec4: ...


@wp.func
def reciprocal(direction: wp.vec3) -> wp.vec3:
    """Component-wise 1 / x, large but finite for zero so that slab tests meet no NaN."""
    x = wp.where(wp.abs(direction[0]) > _TINY, direction[0], _TINY)
    y = wp.where(wp.abs(direction[1]) > _TINY, direction[1], _TINY)
    z = wp.where(wp.abs(direction[2]) > _TINY, direction[2], _TINY)
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
    """Distance to the unit sphere along a unit direction, negative for none.

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
    """Distance to the unit disk or to the square [-1, 1]² at z = 0, negative for none."""
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
    """Distance to the cube [-1, 1]³ (negative for none) and its face: axis, plus 3 for the negative side."""
    inverse = reciprocal(direction)
    near = wp.float32(-1.0e30)
    far = wp.float32(1.0e30)
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
    """Whether a ray that starts at ``from_center`` surely stays outside a sphere up to ``t_max``."""
    b = wp.dot(from_center, direction)
    squared = wp.dot(from_center, from_center)
    if squared <= radius * radius:
        return False
    nearest = from_center - b * direction
    # the slack covers what rounding takes from a far start
    return b > 0.0 or -b - radius > t_max or wp.dot(nearest, nearest) > radius * radius + 4.0e-6 * squared


@wp.func
def meet_instance(
    features: wp.int32,
    scene: SceneData,
    view: ViewData,
    record: InstanceRecord,
    origin: wp.vec3,
    direction: wp.vec3,
    t_max: wp.float32,
) -> Hit:
    """Nearest hit of a ray in track space with one instance, before ``t_max``; ``instance`` is 0 for a hit."""
    hit = Hit()
    hit.instance = -1
    start = record.to_local * origin + record.to_local_offset
    towards = record.to_local * direction
    stretch = wp.length(towards)
    towards = towards / stretch
    reach = t_max * stretch
    t = wp.float32(-1.0)
    if (features & _HAS_MESH) != 0 and record.shape == _MESH:
        if (features & _HAS_WARP_TREES) != 0 and scene.meshes[record.mesh].id != wp.uint64(0):
            query = wp.mesh_query_ray(scene.meshes[record.mesh].id, start, towards, reach)
            if query.result:
                t = query.t
                hit.u = query.u
                hit.v = query.v
                hit.face = query.face
        else:
            found = nearest_in_mesh(scene, record.mesh, start, towards, reach, view.work)
            t = found[0]
            hit.u = found[1]
            hit.v = found[2]
            hit.face = wp.cast(found[3], wp.int32)
    elif (features & _HAS_SPHERE) != 0 and record.shape == _SPHERE:
        t = sphere_distance(start, towards)
    elif (features & _HAS_FLAT) != 0 and (record.shape == _DISK or record.shape == _RECTANGLE):
        t = plane_distance(start, towards, record.shape == _DISK)
    elif (features & _HAS_RELIEF) != 0 and record.shape == _RELIEF:
        t = relief_distance(scene, record, start, towards, reach)
    elif (features & _HAS_CUBE) != 0 and record.shape == _CUBE:
        distance, face = cube_distance(start, towards)
        t = distance
        hit.face = face
    if t >= 0.0 and t < reach:
        hit.instance = 0
        hit.t = t / stretch
    return hit


@wp.func
def instance_blocks(
    features: wp.int32,
    scene: SceneData,
    view: ViewData,
    record: InstanceRecord,
    origin: wp.vec3,
    direction: wp.vec3,
    t_max: wp.float32,
) -> wp.bool:
    """Whether an instance lies along a ray in track space before ``t_max``; any hit will do."""
    if (features & _HAS_MESH) != 0 and record.shape == _MESH:
        start = record.to_local * origin + record.to_local_offset
        towards = record.to_local * direction
        stretch = wp.length(towards)
        reach = t_max * stretch
        if (features & _HAS_WARP_TREES) != 0 and scene.meshes[record.mesh].id != wp.uint64(0):
            return wp.mesh_query_ray_anyhit(scene.meshes[record.mesh].id, start, towards / stretch, reach)
        found = any_in_mesh(scene, record.mesh, start, towards / stretch, reach, view.work)
        return found[0] >= 0.0
    hit = meet_instance(features, scene, view, record, origin, direction, t_max)
    return hit.instance == 0


@wp.func
def closest_hit(
    features: wp.int32,
    scene: SceneData,
    view: ViewData,
    time_s: wp.float64,
    origin: wp.vec3,
    direction: wp.vec3,
    t_max: wp.float32,
) -> Hit:
    """Nearest hit of a world ray of unit direction with any instance."""
    best = Hit()
    best.instance = -1
    best.t = t_max
    for g in range(scene.group_count):
        group = scene.groups[g]
        start = wp.vec3(origin[0], origin[1], origin[2])
        towards = wp.vec3(direction[0], direction[1], direction[2])
        missed = wp.bool(False)
        if (features & _HAS_MOTION) != 0 and group.track != 0:
            start = origin - track_translation(scene, view, group.track, time_s)
            missed = misses_sphere(start, direction, group.radius, best.t)
            if not missed:
                rotation = track_rotation(scene, view, group.track, time_s)
                start = wp.quat_rotate_inv(rotation, start)
                towards = wp.quat_rotate_inv(rotation, direction)
        if not missed:
            inverse = reciprocal(towards)
            index = wp.int32(group.first)
            while index < group.end:
                node = scene.nodes[index]
                index = index + 1
                if not meets_box(start, inverse, node.lower, node.upper, best.t):
                    index = node.skip
                elif node.instance >= 0:
                    hit = meet_instance(features, scene, view, scene.instances[node.instance], start, towards, best.t)
                    if hit.instance == 0:
                        best = hit
                        best.instance = node.instance
    return best


@wp.func
def occluded(
    features: wp.int32,
    scene: SceneData,
    view: ViewData,
    time_s: wp.float64,
    origin: wp.vec3,
    direction: wp.vec3,
    t_max: wp.float32,
) -> wp.bool:
    """Whether anything lies along a world ray before ``t_max``."""
    for g in range(scene.group_count):
        group = scene.groups[g]
        start = wp.vec3(origin[0], origin[1], origin[2])
        towards = wp.vec3(direction[0], direction[1], direction[2])
        missed = wp.bool(False)
        if (features & _HAS_MOTION) != 0 and group.track != 0:
            start = origin - track_translation(scene, view, group.track, time_s)
            missed = misses_sphere(start, direction, group.radius, t_max)
            if not missed:
                rotation = track_rotation(scene, view, group.track, time_s)
                start = wp.quat_rotate_inv(rotation, start)
                towards = wp.quat_rotate_inv(rotation, direction)
        if not missed:
            inverse = reciprocal(towards)
            index = wp.int32(group.first)
            while index < group.end:
                node = scene.nodes[index]
                index = index + 1
                if not meets_box(start, inverse, node.lower, node.upper, t_max):
                    index = node.skip
                elif node.instance >= 0:
                    if instance_blocks(features, scene, view, scene.instances[node.instance], start, towards, t_max):
                        return True
    return False
