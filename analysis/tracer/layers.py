"""Layers of a picture that the scene alone decides, for EXR files."""

from __future__ import annotations

import numpy as np
import torch
from numpy.typing import NDArray

from renderer.guides import render_guides
from renderer.trace import Renderer
from tsar.projection import project


def scene_layers(
    renderer: Renderer, width_px: int, height_px: int, time_s: float, step_s: float
) -> dict[str, NDArray[np.floating] | NDArray[np.integer]]:
    """The layers of a picture that the scene alone decides, by the names of :func:`renderer.film.layers.write_layers`.

    Args:
        renderer: the scene.
        width_px, height_px: size of the picture.
        time_s: animation time, seconds.
        step_s: time over which motion is measured, seconds.

    Returns:
        Those of :class:`renderer.guides.Guides` but the points; and ``motion``, ``(h, w, 2)``: pixels, to the right
        and down, by which the surface at a pixel's centre moves in the picture during the step.
    """
    found = render_guides(renderer, width_px, height_px, time_s)
    number, point = torch.from_numpy(found.instance), torch.from_numpy(found.point)
    views = (renderer.viewpoint(at, width_px / height_px) for at in (time_s, time_s + step_s))
    before, after = (project(view, number, point)[0] for view in views)
    motion = ((after - before) * torch.tensor([width_px, height_px])).numpy()
    return {
        "depth": found.depth,
        "normal": found.normal,
        "albedo": found.albedo,
        "instance": found.instance,
        "motion": motion,
    }
