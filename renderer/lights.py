"""Light that arrives at a point, before occlusion, and radiance from infinity."""

from __future__ import annotations

import warp as wp

from renderer.features import Feature
from renderer.structs import LIGHT_DIRECTIONAL, LIGHT_POINT, LIGHT_SPOT, LightRecord, SceneData, ViewData
from renderer.textures import image_bilinear_wrapped_around

_POINT = wp.constant(LIGHT_POINT)
_DIRECTIONAL = wp.constant(LIGHT_DIRECTIONAL)
_SPOT = wp.constant(LIGHT_SPOT)
_HAS_POINT = wp.constant(int(Feature.POINT))
_HAS_SKY = wp.constant(int(Feature.SKY))
_FAR = wp.constant(1.0e30)
# a shadow ray ends just short of its light, so that a lamp's own shape at that place does not count as an occluder
_SHORT = wp.constant(0.9999)


@wp.func
def has_extent(record: LightRecord) -> wp.bool:
    """Whether a light is seen in more than one direction, of which :func:`arriving_light` takes one."""
    return record.kind != _POINT and record.kind != _DIRECTIONAL and record.kind != _SPOT


@wp.func
def arriving_light(
    features: wp.int32,
    scene: SceneData,
    view: ViewData,
    time_s: wp.float64,
    record: LightRecord,
    sample: wp.vec2,
    position: wp.vec3,
):
    """Unit direction towards a light, its irradiance on a surface facing it, and how far its shadow ray reaches.

    Of a light with an extent ``sample``, in [0, 1)², picks a point; the irradiance is then such that its mean over
    even samples, weighed by the cosine of each, is the light's.
    """
    if (features & _HAS_POINT) != 0 and record.kind == _POINT:
        towards = record.place - position
        distance = wp.length(towards)
        direction = towards / distance
        return direction, record.color / (distance * distance), distance * _SHORT
    return record.place, record.color, _FAR


@wp.func
def environment_radiance(features: wp.int32, scene: SceneData, direction: wp.vec3) -> wp.vec3:
    """Radiance from infinity along a unit world direction."""
    if (features & _HAS_SKY) == 0 or scene.environment_level < 0:
        return wp.vec3(0.0, 0.0, 0.0)
    local = wp.normalize(scene.environment_to_map * direction)
    u = wp.atan2(local[0], -local[2]) * (0.5 / wp.pi)
    v = wp.acos(wp.clamp(local[1], -1.0, 1.0)) * (1.0 / wp.pi)
    return image_bilinear_wrapped_around(scene, scene.environment_level, u, v) * scene.environment_scale
