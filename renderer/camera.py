"""Camera rays and rigid motion at a ray's own time."""

from __future__ import annotations

import warp as wp

from renderer.structs import SceneData, ViewData


@wp.func
def rotation_between(a: wp.quat, b: wp.quat, angle: wp.float32, fraction: wp.float32) -> wp.quat:
    """Spherical interpolation; ``angle`` lies between the quaternions, radians."""
    weight_a = 1.0 - fraction
    weight_b = fraction
    # below this the weights differ from the linear ones by less than float32 can tell
    if angle > 1.0e-3:
        inverse = 1.0 / wp.sin(angle)
        weight_a = wp.sin(weight_a * angle) * inverse
        weight_b = wp.sin(fraction * angle) * inverse
    return wp.normalize(a * weight_a + b * weight_b)


@wp.func
def track_key(scene: SceneData, track: wp.int32, time_s: wp.float64):
    """Indices of the keys around a time, and how far between them it lies; float64 keeps hours of animation exact."""
    record = scene.tracks[track]
    last = record.key_count - 1
    at = wp.clamp((time_s - record.start_s) / record.interval_s, wp.float64(0.0), wp.float64(last))
    index = wp.min(wp.int32(at), wp.max(last - 1, 0))
    first = record.first_key + index
    return first, wp.min(first + 1, record.first_key + last), at - wp.float64(index)


@wp.func
def track_translation(scene: SceneData, view: ViewData, track: wp.int32, time_s: wp.float64) -> wp.vec3:
    """Where a track's origin is; looked up where all samples of a launch share one time."""
    if view.single_time == 1:
        return view.pose_translation[track]
    first, second, fraction = track_key(scene, track, time_s)
    start = scene.key_translation[first]
    at = start + (scene.key_translation[second] - start) * fraction
    return wp.vec3(wp.float32(at[0]), wp.float32(at[1]), wp.float32(at[2]))


@wp.func
def track_rotation(scene: SceneData, view: ViewData, track: wp.int32, time_s: wp.float64) -> wp.quat:
    """How a track is turned, as :func:`track_translation`."""
    if view.single_time == 1:
        return view.pose_rotation[track]
    first, second, fraction = track_key(scene, track, time_s)
    return rotation_between(
        scene.key_rotation[first], scene.key_rotation[second], scene.key_angle[first], wp.float32(fraction)
    )


@wp.func
def camera_ray(scene: SceneData, view: ViewData, position: wp.vec2, time_s: wp.float64):
    """Origin and unit direction, in world space, of the ray through an image position in [0, 1)² from the top left."""
    local = wp.vec3(
        (2.0 * position[0] - 1.0) * view.tan_x,
        (1.0 - 2.0 * position[1]) * view.tan_y,
        -1.0,
    )
    origin = view.from_camera_offset
    direction = view.from_camera * local
    if view.camera_track != 0:
        rotation = track_rotation(scene, view, view.camera_track, time_s)
        origin = wp.quat_rotate(rotation, origin) + track_translation(scene, view, view.camera_track, time_s)
        direction = wp.quat_rotate(rotation, direction)
    return origin, wp.normalize(direction)
