"""Poses in the layout of the filter's native code (``surfels::Poses``)."""

from __future__ import annotations

import torch

from renderer.compute.launching import address
from renderer.stages.sizes import POSE_NUMBERS
from tsar.types import Viewpoint


def pose_words(view: Viewpoint | None) -> tuple[int, int, float, float]:
    """A view, which the caller keeps alive, as arguments of a launch; zeros without a view."""
    if view is None:
        return 0, 0, 1.0, 1.0
    rows = view.rows
    return address("rows", rows, torch.float64, len(rows) * POSE_NUMBERS), len(rows), view.tan_x, view.tan_y
