"""Light that arrives at a point, before occlusion, and radiance from infinity."""

from __future__ import annotations

import warp as wp

from renderer.structs import LIGHT_POINT, SceneData
from renderer.textures import image_bilinear_wrapped_around

_POINT = wp.constant(LIGHT_POINT)
_FAR = wp.constant(1.0e30)
# a shadow ray ends just short of its light, so that a lamp's own shape at that place does not count as an occluder
_SHORT = wp.constant(0.9999)


@wp.func
def arriving_light(scene: SceneData, light: wp.int32, position: wp.vec3):
    """Unit direction towards a light, its irradiance on a surface facing it, and how far its shadow ray reaches."""
    record = scene.lights[light]
    if record.kind == _POINT:
        towards = record.place - position
        distance = wp.length(towards)
        direction = towards / distance
        return direction, record.color / (distance * distance), distance * _SHORT
    return record.place, record.color, _FAR


@wp.func
def environment_radiance(scene: SceneData, direction: wp.vec3) -> wp.vec3:
    """Radiance from infinity along a unit world direction."""
    if scene.environment_level < 0:
        return wp.vec3(0.0, 0.0, 0.0)
    local = wp.normalize(scene.environment_to_map * direction)
    u = wp.atan2(local[0], -local[2]) * (0.5 / wp.pi)
    v = wp.acos(wp.clamp(local[1], -1.0, 1.0)) * (1.0 / wp.pi)
    return image_bilinear_wrapped_around(scene, scene.environment_level, u, v) * scene.environment_scale
