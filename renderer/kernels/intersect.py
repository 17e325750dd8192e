"""Rays against instances: nearest hit and occlusion."""

from __future__ import annotations

import warp as wp

from renderer.compute.native_code import module_options
from renderer.kernels.camera import track_rotation, track_translation
from renderer.kernels.heightfield import relief_distance
from renderer.kernels.shapes import cube_distance, meets_box, misses_sphere, plane_distance, reciprocal, sphere_distance
from renderer.layout import sizes
from renderer.layout.features import Feature
from renderer.layout.kinds import Shape
from renderer.layout.sizes import LIT
from renderer.layout.structs import GroupRecord, Hit, InstanceRecord, SceneData, ViewData

MODULE_OPTIONS = module_options("structures.h", given=sizes.GIVEN)
"""Options of a module whose kernels call functions of this one."""

# On a GPU every mesh has a tree of Warp's, so this is never called there.
_NATIVE = """
#if defined(__CUDACC__) || defined(__CUDA_ARCH__) || defined(__CUDACC_RTC__)
    return wp::vec4(-1.0f, 0.0f, 0.0f, 0.0f);
#else
    return packets::meet_mesh_alone<{any}>(scene, mesh, start, towards, reach, (long long*)work.data);
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
    if (features & Feature.MESH) != 0 and record.shape == Shape.MESH:
        if (features & Feature.WARP_TREES) != 0 and scene.meshes[record.mesh].id != wp.uint64(0):
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
    elif (features & Feature.SPHERE) != 0 and record.shape == Shape.SPHERE:
        t = sphere_distance(start, towards)
    elif (features & Feature.FLAT) != 0 and (record.shape == Shape.DISK or record.shape == Shape.RECTANGLE):
        t = plane_distance(start, towards, record.shape == Shape.DISK)
    elif (features & Feature.HEIGHT_FIELD) != 0 and record.shape == Shape.RELIEF:
        t = relief_distance(scene, record, start, towards, reach)
    elif (features & Feature.CUBE) != 0 and record.shape == Shape.CUBE:
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
    """Whether a ray in track space hits an instance before ``t_max``; any hit suffices."""
    if (features & Feature.MESH) != 0 and record.shape == Shape.MESH:
        start = record.to_local * origin + record.to_local_offset
        towards = record.to_local * direction
        stretch = wp.length(towards)
        reach = t_max * stretch
        if (features & Feature.WARP_TREES) != 0 and scene.meshes[record.mesh].id != wp.uint64(0):
            return wp.mesh_query_ray_anyhit(scene.meshes[record.mesh].id, start, towards / stretch, reach)
        found = any_in_mesh(scene, record.mesh, start, towards / stretch, reach, view.work)
        return found[0] >= 0.0
    hit = meet_instance(features, scene, view, record, origin, direction, t_max)
    return hit.instance == 0


@wp.func
def in_group(
    features: wp.int32,
    scene: SceneData,
    view: ViewData,
    group: GroupRecord,
    time_s: wp.float64,
    origin: wp.vec3,
    direction: wp.vec3,
    t_max: wp.float32,
):
    """Whether a world ray misses a whole group before ``t_max``; otherwise also its origin and direction in the space
    of the group's track."""
    start = wp.vec3(origin[0], origin[1], origin[2])
    towards = wp.vec3(direction[0], direction[1], direction[2])
    missed = wp.bool(False)
    if (features & Feature.MOTION) != 0 and group.track != 0:
        start = origin - track_translation(scene, view, group.track, time_s)
        missed = misses_sphere(start, direction, group.radius, t_max)
        if not missed:
            rotation = track_rotation(scene, view, group.track, time_s)
            start = wp.quat_rotate_inv(rotation, start)
            towards = wp.quat_rotate_inv(rotation, direction)
    return missed, start, towards


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
        missed, start, towards = in_group(features, scene, view, group, time_s, origin, direction, best.t)
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
def occluder(
    features: wp.int32,
    scene: SceneData,
    view: ViewData,
    time_s: wp.float64,
    origin: wp.vec3,
    direction: wp.vec3,
    t_max: wp.float32,
) -> wp.int32:
    """The first instance, in the order of the groups and their nodes, that a world ray hits before ``t_max``; ``LIT``
    for none."""
    for g in range(scene.group_count):
        group = scene.groups[g]
        missed, start, towards = in_group(features, scene, view, group, time_s, origin, direction, t_max)
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
                        return node.instance
    return LIT
