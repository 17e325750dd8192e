"""Perturbed shading normals: normal maps and bump maps."""

from __future__ import annotations

import warp as wp

from renderer.kernels.camera import track_rotation
from renderer.kernels.surface import local_surface
from renderer.kernels.textures import texture_color
from renderer.layout.features import Feature
from renderer.layout.kinds import Shape
from renderer.layout.scattering import ScatterRecord
from renderer.layout.sizes import EDGE_ON
from renderer.layout.structs import Hit, SceneData, Surface, ViewData


@wp.func
def along_uv(features: wp.int32, scene: SceneData, view: ViewData, time_s: wp.float64, hit: Hit, surface: Surface):
    """Derivatives of the world position by the two texture coordinates; zero where there are none."""
    record = scene.instances[hit.instance]
    local = local_surface(features, scene, record, hit, record.to_local * surface.in_track + record.to_local_offset)
    across = record.from_local * local.tangent_u
    along = record.from_local * local.tangent_v
    if (features & Feature.MESH) != 0 and record.shape == Shape.MESH:
        mesh = scene.meshes[record.mesh]
        first = wp.vec3(0.0, 0.0, 0.0)
        second = wp.vec3(0.0, 0.0, 0.0)
        if mesh.first_uv >= 0:
            face = scene.faces[mesh.first_face + hit.face]
            uv = scene.uvs[mesh.first_uv + face[0]]
            p = scene.uvs[mesh.first_uv + face[1]] - uv
            q = scene.uvs[mesh.first_uv + face[2]] - uv
            area = p[0] * q[1] - p[1] * q[0]
            if wp.abs(area) > 1.0e-20:
                first = (q[1] * across - p[1] * along) / area
                second = (p[0] * along - q[0] * across) / area
        across = first
        along = second
    elif (features & Feature.SPHERE) != 0 and record.shape == Shape.SPHERE:
        ring = wp.sqrt(wp.max(1.0 - local.position[2] * local.position[2], 1.0e-6))
        across = across * (2.0 * wp.pi * ring)
        along = along * wp.pi
    if (features & Feature.MOTION) != 0 and record.track != 0:
        rotation = track_rotation(scene, view, record.track, time_s)
        across = wp.quat_rotate(rotation, across)
        along = wp.quat_rotate(rotation, along)
    return across, along


@wp.func
def bent_normal(
    features: wp.int32,
    scene: SceneData,
    view: ViewData,
    time_s: wp.float64,
    record: ScatterRecord,
    hit: Hit,
    surface: Surface,
    direction: wp.vec3,
    footprint: wp.float32,
) -> wp.vec3:
    """The normal on the viewer's side from a normal map or a bump map; seen from behind, both are reversed."""
    across, along = along_uv(features, scene, view, time_s, hit, surface)
    normal = surface.normal
    side = wp.where(surface.inside, -1.0, 1.0)
    outer = side * normal
    across = across - wp.dot(across, outer) * outer
    if wp.dot(across, across) <= 0.0 or wp.dot(along, along) <= 0.0:
        return normal
    bent = outer
    if record.bumps != 0:
        texture = scene.textures[record.bend]
        step = 0.5 / wp.max(texture.texel_scale, 64.0)
        uv = surface.uv
        here = texture_color(features, scene, record.bend, uv, footprint)[0]
        right = texture_color(features, scene, record.bend, uv + wp.vec2(step, 0.0), footprint)[0]
        above = texture_color(features, scene, record.bend, uv + wp.vec2(0.0, step), footprint)[0]
        along = along - wp.dot(along, outer) * outer
        rise = record.bend_scale / step
        moved = wp.cross(across + (rise * (right - here)) * outer, along + (rise * (above - here)) * outer)
        if wp.dot(moved, outer) < 0.0:
            moved = -moved
        bent = wp.normalize(moved)
    else:
        mapped = 2.0 * texture_color(features, scene, record.bend, surface.uv, footprint) - wp.vec3(1.0, 1.0, 1.0)
        first = wp.normalize(across)
        second = wp.cross(outer, first)
        if wp.dot(second, along) < 0.0:
            second = -second
        bent = (record.bend_scale * mapped[0]) * first + (record.bend_scale * mapped[1]) * second + mapped[2] * outer
        bent = wp.normalize(bent)
    bent = side * bent
    # as with smooth normals: rotated back until it is edge-on to the viewer and on the side of the true surface
    if wp.dot(bent, surface.geometric_normal) < 0.0:
        bent = normal
    away = wp.dot(bent, direction)
    if away > -EDGE_ON:
        bent = wp.normalize(bent - (away + EDGE_ON) * direction)
    return bent
