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


@wp.func
def every_second_bit(code: wp.int32) -> wp.int32:
    """Bits 0, 2, 4 and 6 of a Morton code, side by side."""
    return (code & 1) | ((code >> 1) & 2) | ((code >> 2) & 4) | ((code >> 3) & 8)


@wp.kernel(enable_backward=False)
def render_pixels(
    scene: SceneData,
    view: ViewData,
    first: wp.int32,
    samples: wp.int32,
    time_s: wp.float64,
    image: wp.array2d(dtype=wp.vec3),
):
    """Renders pixels, each the mean of a regular grid of ``samples`` squared samples, ``first`` counted like threads:
    along the Morton curve within blocks of 16 x 16 pixels, those by rows."""
    pixel = first + wp.tid()
    height = image.shape[0]
    width = image.shape[1]
    columns = (width + 15) / 16
    column = ((pixel / 256) % columns) * 16 + every_second_bit(pixel % 256)
    row = ((pixel / 256) / columns) * 16 + every_second_bit((pixel % 256) >> 1)
    if column < width and row < height:
        total = wp.vec3(0.0, 0.0, 0.0)
        for y in range(samples):
            for x in range(samples):
                position = wp.vec2(
                    (wp.float32(column * samples + x) + 0.5) / wp.float32(width * samples),
                    (wp.float32(row * samples + y) + 0.5) / wp.float32(height * samples),
                )
                origin, direction = camera_ray(scene, view, position, time_s)
                result, _shadow_rays, _reflection_rays = radiance(scene, view, time_s, origin, direction)
                total = total + result
        image[row, column] = total * (1.0 / wp.float32(samples * samples))


@wp.kernel(enable_backward=False)
def pose_tracks(
    scene: SceneData,
    view: ViewData,
    translation: wp.array(dtype=wp.vec3),
    rotation: wp.array(dtype=wp.quat),
    time_s: wp.float64,
):
    """Poses of all tracks at one time, to the bit those that samples find for themselves."""
    track = wp.tid()
    translation[track] = track_translation(scene, view, track, time_s)
    rotation[track] = track_rotation(scene, view, track, time_s)
