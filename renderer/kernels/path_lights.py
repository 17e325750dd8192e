"""Lights along paths: densities of light sampling, weights of the two ways to a light, and transmittance of shadow
rays."""

from __future__ import annotations

import warp as wp

from renderer.kernels.camera import track_rotation, track_translation
from renderer.kernels.glass import dielectric_reflectance
from renderer.kernels.intersect import closest_hit, occluder
from renderer.kernels.scattering.glass import pane_reflectance
from renderer.kernels.surface import surface_at
from renderer.kernels.textures import texture_color
from renderer.layout.features import Feature
from renderer.layout.kinds import LightKind, ScatterKind
from renderer.layout.path_sizes import PASSED_MOST
from renderer.layout.scattering import ScatterRecord
from renderer.layout.sizes import LIT
from renderer.layout.structs import SceneData, Surface, ViewData


@wp.func
def preferred(own: wp.float32, other: wp.float32) -> wp.float32:
    """Weight of a direction that was sampled in one of two ways, by the power heuristic ``own² / (own² + other²)``.

    Source: Veach 1997, "Robust Monte Carlo Methods for Light Transport Simulation", sec. 9.2.4.
    """
    if own <= 0.0:
        return 0.0
    ratio = other / own
    return 1.0 / (1.0 + ratio * ratio)


@wp.func
def sky_density(scene: SceneData, direction: wp.vec3) -> wp.float32:
    """Density, per solid angle, with which a world direction into the environment is sampled as a light."""
    local = wp.normalize(scene.lighting_to_map * direction)
    height = scene.lighting_columns.shape[0]
    width = scene.lighting_columns.shape[1] - 1
    turn = wp.atan2(local[0], -local[2]) * (0.5 / wp.pi)
    polar = wp.acos(wp.clamp(local[1], -1.0, 1.0))
    column = wp.clamp(wp.int32((turn - wp.floor(turn)) * wp.float32(width)), 0, width - 1)
    row = wp.clamp(wp.int32(polar / wp.pi * wp.float32(height)), 0, height - 1)
    columns = scene.lighting_columns[row]
    chance = (scene.lighting_rows[row + 1] - scene.lighting_rows[row]) * (columns[column + 1] - columns[column])
    sine = wp.sqrt(wp.max(1.0 - local[1] * local[1], 1.0e-12))
    return chance * wp.float32(width * height) / (2.0 * wp.pi * wp.pi * sine)


@wp.func
def lamp_density(
    features: wp.int32,
    scene: SceneData,
    view: ViewData,
    time_s: wp.float64,
    light: wp.int32,
    origin: wp.vec3,
    direction: wp.vec3,
    surface: Surface,
) -> wp.float32:
    """Density, per solid angle, with which the direction from a point to a point of a rectangle or sphere is sampled as
    a light."""
    record = scene.lights[light]
    if (features & Feature.QUAD) != 0 and record.kind == LightKind.QUAD:
        way = surface.position - origin
        facing = wp.abs(wp.dot(4.0 * wp.cross(record.across, record.along), wp.normalize(way)))
        if (features & Feature.MOTION) != 0 and record.track != 0:
            facing = 4.0 * wp.length(wp.cross(record.across, record.along))
            facing = facing * wp.abs(wp.dot(surface.geometric_normal, wp.normalize(way)))
        return wp.dot(way, way) / wp.max(facing, 1.0e-20)
    if (features & Feature.SPHERE_LIGHT) != 0 and record.kind == LightKind.SPHERE:
        center = record.place
        if (features & Feature.MOTION) != 0 and record.track != 0:
            center = wp.quat_rotate(track_rotation(scene, view, record.track, time_s), record.place)
            center = center + track_translation(scene, view, record.track, time_s)
        distance = wp.length(center - origin)
        if distance > record.radius:
            sine = record.radius / distance
            cosine = wp.sqrt(wp.max((1.0 - sine) * (1.0 + sine), 0.0))
            return (1.0 + cosine) / (2.0 * wp.pi * sine * sine)
    return 0.0


@wp.func
def opacity_at(
    features: wp.int32, scene: SceneData, record: ScatterRecord, surface: Surface, footprint: wp.float32
) -> wp.float32:
    """Share of light that a surface stops; 0 in a hole."""
    if record.opacity < 0:
        return 1.0
    opacity = texture_color(features, scene, record.opacity, surface.uv, footprint)[0]
    if record.cutoff >= 0.0:
        return wp.where(opacity < record.cutoff, 0.0, 1.0)
    return wp.clamp(opacity, 0.0, 1.0)


@wp.func
def let_through(
    features: wp.int32,
    scene: SceneData,
    view: ViewData,
    time_s: wp.float64,
    origin: wp.vec3,
    direction: wp.vec3,
    reach: wp.float32,
) -> wp.vec3:
    """Transmittance of a shadow ray: 1 or 0, unless it passes holes or clear panes."""
    shut = wp.vec3(0.0, 0.0, 0.0)
    share = wp.vec3(1.0, 1.0, 1.0)
    if (features & Feature.PASSING) == 0:
        if occluder(features, scene, view, time_s, origin, direction, reach) == LIT:
            return share
        return shut
    start = wp.vec3(origin[0], origin[1], origin[2])
    left = wp.float32(reach)
    steps = wp.int32(0)
    while steps < PASSED_MOST:
        steps = steps + 1
        hit = closest_hit(features, scene, view, time_s, start, direction, left)
        if hit.instance < 0:
            return share
        surface = surface_at(features, scene, view, time_s, hit, start, direction)
        record = scene.scattering[surface.material]
        opacity = opacity_at(features, scene, record, surface, 0.0)
        passed = wp.vec3(1.0, 1.0, 1.0) * (1.0 - opacity)
        if record.kind == ScatterKind.GLASS and record.thin != 0 and opacity > 0.0:
            if scene.materials[surface.material].cos_spread == 1.0:
                cosine = wp.abs(wp.dot(surface.normal, direction))
                clear = 1.0 - pane_reflectance(dielectric_reflectance(cosine, 1.0 / record.ior))
                tint = texture_color(features, scene, record.base, surface.uv, 0.0)
                passed = passed + tint * (opacity * clear)
        share = wp.cw_mul(share, passed)
        if wp.max(share) <= 0.0:
            return shut
        start = surface.position - surface.offset * surface.geometric_normal
        left = left - hit.t
    return shut
