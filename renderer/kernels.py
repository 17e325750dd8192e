"""Kernel entry points: index, load, call, store."""

from __future__ import annotations

import warp as wp

from renderer.camera import camera_ray, track_rotation, track_translation
from renderer.shading import radiance
from renderer.structs import SceneData, ViewData


@wp.kernel(enable_backward=False)
def shade_samples(
    scene: SceneData,
    view: ViewData,
    first: wp.int32,
    position: wp.array(dtype=wp.vec2),
    time_s: wp.array(dtype=wp.float64),
    color: wp.array(dtype=wp.vec3),
    rays: wp.array(dtype=wp.vec2i),
):
    """Shades the samples from ``first`` on; ``rays`` receives shadow and reflection rays of each."""
    i = first + wp.tid()
    origin, direction = camera_ray(scene, view, position[i], time_s[i])
    result, shadow_rays, reflection_rays = radiance(scene, view, time_s[i], origin, direction)
    color[i] = result
    rays[i] = wp.vec2i(shadow_rays, reflection_rays)


@wp.kernel(enable_backward=False)
def pose_tracks(
    scene: SceneData,
    view: ViewData,
    time_s: wp.float64,
    translation: wp.array(dtype=wp.vec3),
    rotation: wp.array(dtype=wp.quat),
):
    """Poses of all tracks at one time, to the bit those that samples find for themselves."""
    track = wp.tid()
    translation[track] = track_translation(scene, view, track, time_s)
    rotation[track] = track_rotation(scene, view, track, time_s)
