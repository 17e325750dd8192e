"""The record of a scene's camera for kernels."""

from __future__ import annotations

import math

import numpy as np
import warp as wp

from renderer.layout.kinds import CameraKind
from renderer.layout.structs import ViewData
from renderer.tables.checks import check_affine, check_finite
from renderer.tables.tracks import TrackTable
from scenes.arithmetic import tan
from scenes.canonical import EnvironmentCamera, OrthographicCamera, PerspectiveCamera, Scene, SceneError

ViewingCamera = PerspectiveCamera | OrthographicCamera | EnvironmentCamera


def check_camera(scene: Scene) -> ViewingCamera:
    """The camera of a scene.

    Raises:
        SceneError: if the kind of camera is not supported, or its values cannot be used.
    """
    camera = scene.camera
    name = type(camera).__name__
    if not isinstance(camera, ViewingCamera):
        raise SceneError(f"camera {name} is not supported yet, expected {ViewingCamera}")
    if isinstance(camera, PerspectiveCamera):
        check_finite((camera.lens_radius, camera.focal_distance), "PerspectiveCamera.lens_radius, focal_distance")
        if camera.shift != (0.0, 0.0):
            raise SceneError(
                f"PerspectiveCamera.shift: expected none, as the renderer supports none, got {camera.shift}"
            )
    if isinstance(camera, OrthographicCamera) and not 0.0 < camera.half_width < math.inf:
        raise SceneError(f"OrthographicCamera.half_width: expected a positive number, got {camera.half_width}")
    check_affine(camera.to_world, f"{name}.to_world")
    return camera


def camera_view(camera: ViewingCamera, tracks: TrackTable, aspect: float, footprint_px: float) -> ViewData:
    """The camera's record for samples of many times.

    Args:
        camera: from :func:`check_camera`.
        tracks: tracks of the scene.
        aspect: width over height of the picture.
        footprint_px: number of pixels along its shorter axis for which textures are filtered.
    """
    view = ViewData()
    to_world = np.asarray(camera.to_world, np.float64)
    view.from_camera = wp.mat33(*to_world[:3, :3].astype(np.float32).reshape(-1).tolist())
    view.from_camera_offset = wp.vec3(*to_world[:3, 3].tolist())
    view.camera_track = tracks.add(getattr(camera, "track", None))
    half = 1.0
    if isinstance(camera, PerspectiveCamera):
        view.kind = CameraKind.PERSPECTIVE
        half = tan(math.radians(camera.fov_deg) / 2.0)
        view.spread = 2.0 * half / footprint_px
        view.lens_radius, view.focal_distance = camera.lens_radius, camera.focal_distance
    elif isinstance(camera, OrthographicCamera):
        view.kind = CameraKind.PARALLEL
        half = camera.half_width
        view.width = 2.0 * half / footprint_px
    else:
        view.kind = CameraKind.PANORAMA
        view.spread = math.pi / footprint_px
    view.tan_x, view.tan_y = half * max(aspect, 1.0), half * max(1.0 / aspect, 1.0)
    return view
