"""Light that arrives at a point, without occlusion, and radiance from infinity."""

from __future__ import annotations

import warp as wp

from renderer.kernels.camera import track_rotation, track_translation
from renderer.kernels.randomness import cone_direction
from renderer.kernels.textures import image_bilinear_wrapped_around
from renderer.layout.features import Feature
from renderer.layout.kinds import LightKind
from renderer.layout.sizes import FAR, SHORT
from renderer.layout.structs import LightRecord, SceneData, ViewData


@wp.struct
class Arriving:
    """Unit direction towards a light, its irradiance on a surface that faces it, and the length of its shadow ray."""

    direction: wp.vec3
    irradiance: wp.vec3
    reach: wp.float32


@wp.func
def has_extent(record: LightRecord) -> wp.bool:
    """Whether a light spans more than one direction, so that :func:`arriving_light` samples one."""
    return record.kind != LightKind.POINT and record.kind != LightKind.DIRECTIONAL and record.kind != LightKind.SPOT


@wp.func
def from_point(record: LightRecord, position: wp.vec3) -> Arriving:
    """Point light: intensity over the squared distance."""
    light = Arriving()
    towards = record.place - position
    distance = wp.length(towards)
    light.direction = towards / distance
    light.irradiance = record.color / (distance * distance)
    light.reach = distance * SHORT
    return light


@wp.func
def from_spot(record: LightRecord, position: wp.vec3) -> Arriving:
    """Spot light: a point light whose intensity falls off by Hermite's ``3x² - 2x³`` in the cosine."""
    light = from_point(record, position)
    cosine = -wp.dot(light.direction, record.across)
    x = wp.clamp((cosine - record.cos_outer) / wp.max(record.cos_inner - record.cos_outer, 1.0e-7), 0.0, 1.0)
    light.irradiance = light.irradiance * (x * x * (3.0 - 2.0 * x))
    return light


@wp.func
def from_sun(record: LightRecord, sample: wp.vec2) -> Arriving:
    """Sun: a sampled direction in a disc of uniform radiance at infinity."""
    light = Arriving()
    light.direction = cone_direction(record.place, record.cos_inner, sample)
    light.irradiance = record.color
    light.reach = FAR
    return light


@wp.func
def from_quad(record: LightRecord, sample: wp.vec2, position: wp.vec3) -> Arriving:
    """A sampled point of a parallelogram that emits to one side: radiance times the solid angle that the whole area
    would have at that point."""
    light = Arriving()
    on_light = record.place + (2.0 * sample[0] - 1.0) * record.across + (2.0 * sample[1] - 1.0) * record.along
    towards = on_light - position
    squared = wp.max(wp.dot(towards, towards), 1.0e-30)
    distance = wp.sqrt(squared)
    light.direction = towards / distance
    area_normal = 4.0 * wp.cross(record.across, record.along)
    facing = -wp.dot(area_normal, light.direction)
    light.irradiance = record.color * (wp.max(facing, 0.0) / squared)
    light.reach = distance * SHORT
    return light


@wp.func
def from_sphere(record: LightRecord, sample: wp.vec2, position: wp.vec3) -> Arriving:
    """A sampled direction in the cone that a sphere subtends: radiance times the cone's solid angle; no light from
    inside."""
    light = Arriving()
    towards = record.place - position
    distance = wp.length(towards)
    if distance <= record.radius:
        return light
    sine = record.radius / distance
    cosine = wp.sqrt(wp.max((1.0 - sine) * (1.0 + sine), 0.0))
    narrow = sine * sine / (1.0 + cosine)  # 1 - cosine, without the cancellation of a far sphere
    light.direction = cone_direction(towards / distance, 1.0 - narrow, sample)
    light.irradiance = record.color * (2.0 * wp.pi * narrow)
    # the nearer intersection with the sphere, or the closest point where rounding makes the ray miss
    along = wp.dot(towards, light.direction)
    aside = towards - along * light.direction
    inside = wp.max(record.radius * record.radius - wp.dot(aside, aside), 0.0)
    light.reach = (along - wp.sqrt(inside)) * SHORT
    return light


@wp.func
def cell_of(chances: wp.array(dtype=wp.float32), count: wp.int32, x: wp.float32) -> wp.int32:
    """Index of the interval that contains ``x``, of ``count`` intervals between increasing limits from 0 to 1."""
    low = wp.int32(0)
    high = wp.int32(count)
    while high - low > 1:
        middle = (low + high) / 2
        if chances[middle] <= x:
            low = middle
        else:
            high = middle
    return low


@wp.func
def map_radiance(scene: SceneData, level: wp.int32, to_map: wp.mat33, scale: wp.float32, direction: wp.vec3) -> wp.vec3:
    """Radiance of a latitude–longitude map along a unit world direction."""
    local = wp.normalize(to_map * direction)
    u = wp.atan2(local[0], -local[2]) * (0.5 / wp.pi)
    v = wp.acos(wp.clamp(local[1], -1.0, 1.0)) * (1.0 / wp.pi)
    return image_bilinear_wrapped_around(scene, level, u, v) * scale


@wp.func
def from_environment(scene: SceneData, sample: wp.vec2) -> Arriving:
    """A direction of the environment, sampled by the brightness of its texels: radiance over the density of the
    choice."""
    light = Arriving()
    height = scene.lighting_columns.shape[0]
    width = scene.lighting_columns.shape[1] - 1
    row = cell_of(scene.lighting_rows, height, sample[1])
    columns = scene.lighting_columns[row]
    column = cell_of(columns, width, sample[0])
    row_chance = scene.lighting_rows[row + 1] - scene.lighting_rows[row]
    column_chance = columns[column + 1] - columns[column]
    if row_chance <= 0.0 or column_chance <= 0.0:
        return light
    u = (wp.float32(column) + (sample[0] - columns[column]) / column_chance) / wp.float32(width)
    v = (wp.float32(row) + (sample[1] - scene.lighting_rows[row]) / row_chance) / wp.float32(height)
    polar = wp.pi * v
    turn = 2.0 * wp.pi * u
    local = wp.vec3(wp.sin(turn) * wp.sin(polar), wp.cos(polar), -wp.cos(turn) * wp.sin(polar))
    # the transpose of the rotation takes directions from the map to the world
    light.direction = wp.normalize(wp.transpose(scene.lighting_to_map) * local)
    solid_angle = 2.0 * wp.pi * wp.pi * wp.sin(polar)  # that of the whole map, if every texel were as wide as this one
    density = row_chance * column_chance * wp.float32(width * height)
    radiance = map_radiance(scene, scene.lighting_level, scene.lighting_to_map, scene.lighting_scale, light.direction)
    light.irradiance = radiance * (solid_angle / density)
    light.reach = FAR
    return light


@wp.func
def arriving_light(
    features: wp.int32,
    scene: SceneData,
    view: ViewData,
    time_s: wp.float64,
    record: LightRecord,
    sample: wp.vec2,
    position: wp.vec3,
) -> Arriving:
    """The light from one direction towards a light source.

    For a light with an extent, ``sample`` in [0, 1)² selects a point. The irradiance is scaled so that its mean over
    uniform samples, each weighted by its cosine, is that of the light.
    """
    if (features & Feature.POINT) != 0 and record.kind == LightKind.POINT:
        return from_point(record, position)
    if (features & Feature.SPOT) != 0 and record.kind == LightKind.SPOT:
        return from_spot(record, position)
    if (features & Feature.SUN_DISC) != 0 and record.kind == LightKind.SUN_DISC:
        return from_sun(record, sample)
    if (features & Feature.ENVIRONMENT) != 0 and record.kind == LightKind.ENVIRONMENT:
        return from_environment(scene, sample)
    light = Arriving()
    if (features & Feature.DIRECTIONAL) != 0 and record.kind == LightKind.DIRECTIONAL:
        light.direction = record.place
        light.irradiance = record.color
        light.reach = FAR
    if (features & (Feature.QUAD | Feature.SPHERE_LIGHT)) != 0 and (
        record.kind == LightKind.QUAD or record.kind == LightKind.SPHERE
    ):
        start = wp.vec3(position[0], position[1], position[2])
        rotation = wp.quat(0.0, 0.0, 0.0, 1.0)
        moves = (features & Feature.MOTION) != 0 and record.track != 0
        if moves:
            rotation = track_rotation(scene, view, record.track, time_s)
            start = wp.quat_rotate_inv(rotation, position - track_translation(scene, view, record.track, time_s))
        if (features & Feature.QUAD) != 0 and record.kind == LightKind.QUAD:
            light = from_quad(record, sample, start)
        if (features & Feature.SPHERE_LIGHT) != 0 and record.kind == LightKind.SPHERE:
            light = from_sphere(record, sample, start)
        if moves:
            light.direction = wp.quat_rotate(rotation, light.direction)
    return light


@wp.func
def environment_radiance(features: wp.int32, scene: SceneData, direction: wp.vec3) -> wp.vec3:
    """Radiance from infinity along a unit world direction."""
    if (features & Feature.SKY) == 0 or scene.environment_level < 0:
        return wp.vec3(0.0, 0.0, 0.0)
    return map_radiance(scene, scene.environment_level, scene.environment_to_map, scene.environment_scale, direction)
