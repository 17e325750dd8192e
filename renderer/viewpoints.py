"""Camera and poses at one time, for the reprojection of hits."""

from __future__ import annotations

from typing import Literal

import numpy as np
import torch
from numpy.typing import NDArray

from renderer.layout.kinds import CameraKind
from renderer.layout.structs import ViewData
from renderer.tables.buffers import SceneBuffers
from scenes.arithmetic import inverse, product
from tsar.types import Viewpoint

_KINDS: dict[int, Literal["perspective", "parallel", "panorama"]] = {
    CameraKind.PERSPECTIVE: "perspective",
    CameraKind.PARALLEL: "parallel",
    CameraKind.PANORAMA: "panorama",
}


def viewpoint_of(buffers: SceneBuffers, view: ViewData, time_s: float) -> Viewpoint:
    """The poses that a launch at one time uses, in double precision.

    Args:
        buffers: the scene.
        view: camera, with the poses of all tracks at ``time_s``.
        time_s: animation time, seconds.
    """
    rotation = _matrices(view.pose_rotation.numpy().astype(np.float64))
    translation = view.pose_translation.numpy().astype(np.float64)
    turned, place = rotation[view.camera_track], translation[view.camera_track]
    from_camera = product(turned, np.array(view.from_camera, np.float64).reshape(3, 3))
    offset = product(turned, np.array(view.from_camera_offset, np.float64)) + place
    to_camera = inverse(from_camera)
    return Viewpoint(
        time_s,
        buffers.track_of_instance,
        torch.from_numpy(rotation),
        torch.from_numpy(translation),
        torch.from_numpy(to_camera),
        torch.from_numpy(-product(to_camera, offset)),
        _KINDS[view.kind],
        view.tan_x,
        view.tan_y,
    )


def _matrices(quaternions: NDArray[np.float64]) -> NDArray[np.float64]:
    """Rotation matrices ``(n, 3, 3)`` of quaternions ``(n, 4)``, ``(x, y, z, w)``, as kernels apply them:
    ``v (2 w² - 1) + 2 w (a × v) + 2 a (a · v)`` with the vector part ``a``."""
    x, y, z, w = quaternions.T
    none = np.zeros_like(w)
    across = np.stack([none, -z, y, z, none, -x, -y, x, none], axis=-1).reshape(-1, 3, 3)
    axis = quaternions[:, :3]
    along = axis[:, :, None] * axis[:, None, :]
    return (2.0 * w * w - 1.0)[:, None, None] * np.eye(3) + 2.0 * w[:, None, None] * across + 2.0 * along
