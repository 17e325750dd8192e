"""Camera rays, and rigid motion at the time of each ray."""

from __future__ import annotations

import warp as wp

from renderer.kernels.randomness import PURPOSE_LENS, draw_2d
from renderer.layout.features import Feature
from renderer.layout.kinds import CameraKind
from renderer.layout.sizes import SLERP_ANGLE_LEAST
from renderer.layout.structs import Draw, SceneData, ViewData


@wp.func
def rotation_between(a: wp.quat, b: wp.quat, angle: wp.float32, fraction: wp.float32) -> wp.quat:
    """Spherical linear interpolation; ``angle`` is the angle between the quaternions, radians."""
    weight_a = 1.0 - fraction
    weight_b = fraction
    if angle > SLERP_ANGLE_LEAST:
        inverse = 1.0 / wp.sin(angle)
        weight_a = wp.sin(weight_a * angle) * inverse
        weight_b = wp.sin(fraction * angle) * inverse
    return wp.normalize(a * weight_a + b * weight_b)


@wp.func
def track_key(scene: SceneData, track: wp.int32, time_s: wp.float64):
    """Indices of the keys around a time, and its fraction between them; float64 keeps hours of animation exact."""
    record = scene.tracks[track]
    last = record.key_count - 1
    at = wp.clamp((time_s - record.start_s) / record.interval_s, wp.float64(0.0), wp.float64(last))
    index = wp.min(wp.int32(at), wp.max(last - 1, 0))
    first = record.first_key + index
    return first, wp.min(first + 1, record.first_key + last), at - wp.float64(index)


@wp.func
def track_translation(scene: SceneData, view: ViewData, track: wp.int32, time_s: wp.float64) -> wp.vec3:
    """Translation of a track at a time; looked up where all samples of a launch share one time."""
    if view.single_time == 1:
        return view.pose_translation[track]
    first, second, fraction = track_key(scene, track, time_s)
    start = scene.key_translation[first]
    at = start + (scene.key_translation[second] - start) * fraction
    return wp.vec3(wp.float32(at[0]), wp.float32(at[1]), wp.float32(at[2]))


@wp.func
def track_rotation(scene: SceneData, view: ViewData, track: wp.int32, time_s: wp.float64) -> wp.quat:
    """Rotation of a track at a time; see :func:`track_translation`."""
    if view.single_time == 1:
        return view.pose_rotation[track]
    first, second, fraction = track_key(scene, track, time_s)
    return rotation_between(
        scene.key_rotation[first], scene.key_rotation[second], scene.key_angle[first], wp.float32(fraction)
    )


@wp.func
def camera_ray(features: wp.int32, scene: SceneData, view: ViewData, draw: Draw, position: wp.vec2, time_s: wp.float64):
    """Origin and unit direction, in world space, of a ray through an image position in [0, 1)² from the top left.

    With a lens the ray starts at a point on it and meets the ray of the pinhole in the focal plane.
    """
    x = (2.0 * position[0] - 1.0) * view.tan_x
    y = (1.0 - 2.0 * position[1]) * view.tan_y
    start = wp.vec3(0.0, 0.0, 0.0)
    towards = wp.vec3(x, y, -1.0)
    if (features & Feature.LENS) != 0 and view.lens_radius > 0.0:
        sample = draw_2d(draw, PURPOSE_LENS)
        radius = view.lens_radius * wp.sqrt(sample[0])
        turn = 2.0 * wp.pi * sample[1]
        start = wp.vec3(radius * wp.cos(turn), radius * wp.sin(turn), 0.0)
        towards = view.focal_distance * towards - start
    if (features & Feature.PARALLEL) != 0 and view.kind == CameraKind.PARALLEL:
        start = wp.vec3(x, y, 0.0)
        towards = wp.vec3(0.0, 0.0, -1.0)
    if (features & Feature.PANORAMA) != 0 and view.kind == CameraKind.PANORAMA:
        turn = 2.0 * wp.pi * (position[0] - 0.5)
        polar = wp.pi * position[1]
        towards = wp.vec3(wp.sin(turn) * wp.sin(polar), wp.cos(polar), -wp.cos(turn) * wp.sin(polar))
    origin = view.from_camera * start + view.from_camera_offset
    direction = view.from_camera * towards
    if (features & Feature.MOTION) != 0 and view.camera_track != 0:
        rotation = track_rotation(scene, view, view.camera_track, time_s)
        origin = wp.quat_rotate(rotation, origin) + track_translation(scene, view, view.camera_track, time_s)
        direction = wp.quat_rotate(rotation, direction)
    return origin, wp.normalize(direction)
