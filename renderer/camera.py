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
def track_pose(scene: SceneData, view: ViewData, track: wp.int32, time_s: wp.float64):
    """Translation and rotation of a track; the pose of all samples of a launch where they share one time."""
    if view.single_time == 1:
        return view.pose_translation[track], view.pose_rotation[track]
    record = scene.tracks[track]
    last = record.key_count - 1
    at = wp.clamp((time_s - record.start_s) / record.interval_s, wp.float64(0.0), wp.float64(last))
    index = wp.min(wp.int32(at), wp.max(last - 1, 0))
    fraction = at - wp.float64(index)
    first = record.first_key + index
    second = wp.min(first + 1, record.first_key + last)
    start = scene.key_translation[first]
    translation = start + (scene.key_translation[second] - start) * fraction
    rotation = rotation_between(
        scene.key_rotation[first], scene.key_rotation[second], scene.key_angle[first], wp.float32(fraction)
    )
    return wp.vec3(wp.float32(translation[0]), wp.float32(translation[1]), wp.float32(translation[2])), rotation


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
        translation, rotation = track_pose(scene, view, view.camera_track, time_s)
        origin = wp.quat_rotate(rotation, origin) + translation
        direction = wp.quat_rotate(rotation, direction)
    return origin, wp.normalize(direction)
