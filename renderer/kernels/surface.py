"""The surface at a hit: position, normals, texture coordinates."""

from __future__ import annotations

import warp as wp

from renderer.kernels.camera import track_rotation, track_translation
from renderer.kernels.heightfield import relief_surface
from renderer.layout.features import Feature
from renderer.layout.kinds import Shape
from renderer.layout.sizes import EDGE_ON, OFFSET, PATCH_LEAST, RING_LEAST, SMOOTH_LEAST
from renderer.layout.structs import Hit, InstanceRecord, LocalSurface, SceneData, Surface, ViewData


@wp.func
def mesh_surface(scene: SceneData, record: InstanceRecord, hit: Hit) -> LocalSurface:
    """The hit face of a mesh, interpolated."""
    mesh = scene.meshes[record.mesh]
    face = scene.faces[mesh.first_face + hit.face]
    a = scene.vertices[mesh.first_vertex + face[0]]
    b = scene.vertices[mesh.first_vertex + face[1]]
    c = scene.vertices[mesh.first_vertex + face[2]]
    w = 1.0 - hit.u - hit.v
    local = LocalSurface()
    local.position = a * hit.u + b * hit.v + c * w
    local.tangent_u = b - a
    local.tangent_v = c - a
    # normalised at once: the normal of a tiny face in a large scene would underflow in float32
    local.geometric_normal = wp.normalize(wp.cross(local.tangent_u, local.tangent_v))
    local.normal = local.geometric_normal
    if mesh.first_normal >= 0:
        smooth = (
            scene.normals[mesh.first_normal + face[0]] * hit.u
            + scene.normals[mesh.first_normal + face[1]] * hit.v
            + scene.normals[mesh.first_normal + face[2]] * w
        )
        if wp.dot(smooth, smooth) > SMOOTH_LEAST:
            local.normal = smooth
    if mesh.first_uv >= 0:
        uv_a = scene.uvs[mesh.first_uv + face[0]]
        uv_b = scene.uvs[mesh.first_uv + face[1]]
        uv_c = scene.uvs[mesh.first_uv + face[2]]
        local.uv = uv_a * hit.u + uv_b * hit.v + uv_c * w
        p = uv_b - uv_a
        q = uv_c - uv_a
        local.uv_area = wp.abs(p[0] * q[1] - p[1] * q[0])
    return local


@wp.func
def sphere_surface(point: wp.vec3) -> LocalSurface:
    """The unit sphere; u is the angle about +z from +x, and v rises from -z to +z."""
    local = LocalSurface()
    p = wp.normalize(point)
    local.position = p
    local.geometric_normal = p
    local.normal = p
    turn = wp.atan2(p[1], p[0]) * (0.5 / wp.pi)
    local.uv = wp.vec2(turn - wp.floor(turn), 1.0 - wp.acos(wp.clamp(p[2], -1.0, 1.0)) / wp.pi)
    # away from the poles: tangents of unit length
    ring = wp.max(wp.sqrt(p[0] * p[0] + p[1] * p[1]), RING_LEAST)
    local.tangent_u = wp.vec3(-p[1], p[0], 0.0) / ring
    local.tangent_v = wp.cross(p, local.tangent_u)
    local.uv_area = 1.0 / (2.0 * wp.pi * wp.pi * ring)
    return local


@wp.func
def flat_surface(point: wp.vec3, axis: wp.int32, side: wp.float32) -> LocalSurface:
    """A face of the cube [-1, 1]³ with the normal ``side`` along ``axis``, or the plane z = 0 with axis 2; uv from the
    two other axes."""
    local = LocalSurface()
    normal = wp.vec3(0.0, 0.0, 0.0)
    normal[axis] = side
    local.geometric_normal = normal
    local.normal = normal
    first = (axis + 1) % 3
    second = (axis + 2) % 3
    local.position = point
    local.uv = wp.vec2(0.5 * point[first] + 0.5, 0.5 * point[second] + 0.5)
    tangent_u = wp.vec3(0.0, 0.0, 0.0)
    tangent_v = wp.vec3(0.0, 0.0, 0.0)
    tangent_u[first] = 2.0
    tangent_v[second] = 2.0
    local.tangent_u = tangent_u
    local.tangent_v = tangent_v
    local.uv_area = 1.0
    return local


@wp.func
def local_surface(
    features: wp.int32, scene: SceneData, record: InstanceRecord, hit: Hit, point: wp.vec3
) -> LocalSurface:
    """The hit in the unit space of its shape; ``point`` is the hit point along the ray, which is projected onto the
    shape."""
    if (features & Feature.MESH) != 0 and record.shape == Shape.MESH:
        return mesh_surface(scene, record, hit)
    if (features & Feature.SPHERE) != 0 and record.shape == Shape.SPHERE:
        return sphere_surface(point)
    if (features & Feature.HEIGHT_FIELD) != 0 and record.shape == Shape.RELIEF:
        return relief_surface(scene, record, hit, point)
    if (features & Feature.FLAT) != 0 and (record.shape == Shape.DISK or record.shape == Shape.RECTANGLE):
        return flat_surface(wp.vec3(point[0], point[1], 0.0), 2, 1.0)
    axis = hit.face % 3
    side = wp.where(hit.face < 3, 1.0, -1.0)
    snapped = wp.vec3(point[0], point[1], point[2])
    snapped[axis] = side
    return flat_surface(snapped, axis, side)


@wp.func
def facing(normal: wp.vec3, direction: wp.vec3) -> wp.vec3:
    """A normal flipped against a direction."""
    if wp.dot(normal, direction) > 0.0:
        return -normal
    return normal


@wp.func
def greatest(v: wp.vec3) -> wp.float32:
    """Greatest absolute component."""
    return wp.max(wp.max(wp.abs(v[0]), wp.abs(v[1])), wp.abs(v[2]))


@wp.func
def surface_at(
    features: wp.int32,
    scene: SceneData,
    view: ViewData,
    time_s: wp.float64,
    hit: Hit,
    origin: wp.vec3,
    direction: wp.vec3,
) -> Surface:
    """World-space surface at the hit of a world ray."""
    record = scene.instances[hit.instance]
    translation = wp.vec3(0.0, 0.0, 0.0)
    rotation = wp.quat(0.0, 0.0, 0.0, 1.0)
    point = origin + hit.t * direction
    if (features & Feature.MOTION) != 0 and record.track != 0:
        translation = track_translation(scene, view, record.track, time_s)
        rotation = track_rotation(scene, view, record.track, time_s)
        point = wp.quat_rotate_inv(rotation, point - translation)
    local = local_surface(features, scene, record, hit, record.to_local * point + record.to_local_offset)
    to_local_transposed = wp.transpose(record.to_local)
    geometric = to_local_transposed * local.geometric_normal
    shading = to_local_transposed * local.normal
    patch = wp.length(wp.cross(record.from_local * local.tangent_u, record.from_local * local.tangent_v))
    position = record.from_local * local.position + record.from_local_offset
    magnitude = record.extent
    if (features & Feature.MOTION) != 0 and record.track != 0:
        magnitude = magnitude + greatest(position) + greatest(translation)
        position = wp.quat_rotate(rotation, position) + translation
        geometric = wp.quat_rotate(rotation, geometric)
        shading = wp.quat_rotate(rotation, shading)
    surface = Surface()
    surface.position = position
    surface.in_track = point
    surface.inside = wp.dot(geometric, direction) > 0.0
    surface.geometric_normal = facing(wp.normalize(geometric), direction)
    shading = wp.normalize(shading)
    if wp.dot(shading, surface.geometric_normal) < 0.0:
        shading = -shading
    # a smooth normal that faces away from the viewer is rotated back until it is edge-on
    away = wp.dot(shading, direction)
    if away > -EDGE_ON:
        shading = wp.normalize(shading - (away + EDGE_ON) * direction)
    surface.normal = shading
    surface.uv = local.uv
    surface.uv_density = wp.sqrt(local.uv_area / wp.max(patch, PATCH_LEAST))
    surface.offset = (magnitude + greatest(position)) * OFFSET
    surface.emission = record.emission
    surface.material = record.material
    if record.material < 0:
        surface.material = scene.face_materials[scene.meshes[record.mesh].first_material + hit.face]
    return surface
