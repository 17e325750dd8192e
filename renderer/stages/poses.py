"""Poses in the layout of the filter's native code (``surfels::Poses``)."""

from __future__ import annotations

import torch
from torch import Tensor

from renderer.compute.launching import address
from renderer.stages.sizes import POSE_NUMBERS
from tsar.projection import to_camera
from tsar.types import Viewpoint


def rows_of(view: Viewpoint) -> Tensor:
    """Matrix and offset from each instance's track to the camera, ``(instances + 1, 12)`` float64; the last row is for
    directions."""
    matrix, offset = to_camera(view)
    return torch.cat((matrix.reshape(-1, 9), offset), dim=1).contiguous()


def pose_words(rows: Tensor | None, view: Viewpoint | None) -> tuple[int, int, float, float]:
    """A view as arguments of a launch; zeros without a view."""
    if rows is None or view is None:
        return 0, 0, 1.0, 1.0
    return address("rows", rows, torch.float64, len(rows) * POSE_NUMBERS), len(rows), view.tan_x, view.tan_y
