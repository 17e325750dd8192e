"""Conventions that several formats share, and their relation to those of the canonical scene."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from scenes.canonical import Camera, Film, Instance
from scenes.formats.geometry.transform_stack import track_times

FAR = 1e6
"""Focal distance of a camera whose file gives none, scene units."""

MAP_AXES = np.array([[0.0, 0.0, -1.0, 0.0], [1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]])
"""Transform from the canonical axes of environment maps to those of PBRT and LuxRender: ``p = (-z, x, y)``."""


def aspect_of(film: Film) -> tuple[float, float]:
    """Width and height of a film in units of its shorter side."""
    shorter = min(film.width_px, film.height_px)
    return film.width_px / shorter, film.height_px / shorter


def duration_s(camera: Camera, instances: Sequence[Instance]) -> float:
    """End of the last motion, seconds; 0 if nothing moves."""
    tracks = [getattr(camera, "track", None), *(instance.track for instance in instances)]
    return max((track_times(track)[-1] for track in tracks if track is not None), default=0.0)


def first_row_below(
    scale: tuple[float, float], offset: tuple[float, float]
) -> tuple[tuple[float, float], tuple[float, float]]:
    """Scale and offset of texture coordinates for images whose first row is at ``v = 0`` instead of ``v = 1``.

    That is the convention of LuxRender and Mitsuba. The function is its own inverse.
    """
    return (scale[0], -scale[1]), (offset[0], 1.0 - offset[1])
