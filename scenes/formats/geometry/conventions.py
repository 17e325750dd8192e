"""Conventions that several formats share, and their relation to those of the canonical scene."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence

import numpy as np

from scenes.arithmetic import arctan, norm, tan
from scenes.canonical import Camera, EnvironmentCamera, Film, Instance, OrthographicCamera, PerspectiveCamera
from scenes.canonical.values import Matrix
from scenes.formats.geometry.orientation import scales_evenly
from scenes.formats.geometry.transform_stack import track_times
from scenes.formats.losses import LossReport

_UNIT = 1e-6
"""Difference from 1 up to which an axis has the length 1."""

FAR = 1e6
"""Focal distance of a camera whose file gives none, scene units."""

MAP_AXES = np.array([[0.0, 0.0, -1.0, 0.0], [1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]])
"""Transform from the canonical axes of environment maps to those of PBRT and LuxRender: ``p = (-z, x, y)``."""


def aspect_of(film: Film) -> tuple[float, float]:
    """Width and height of a film in units of its shorter side."""
    shorter = min(film.width_px, film.height_px)
    return film.width_px / shorter, film.height_px / shorter


def with_unit_axes(camera: Camera, where: str, report: LossReport) -> Camera:
    """The camera that shows the same with axes of length 1, which Mitsuba 3, glTF and USD demand.

    Its lens, its focus and the size of its picture are scaled instead. A parallel picture of another aspect than the
    film stays stretched by its transform.
    """
    across, up, along = (norm(camera.to_world[:3, axis]) for axis in range(3))
    if max(abs(size - 1.0) for size in (across, up, along)) <= _UNIT:
        return camera
    if isinstance(camera, OrthographicCamera):
        if abs(across - up) > _UNIT * across:
            return camera
        return dataclasses.replace(camera, to_world=_unit(camera.to_world), half_width=camera.half_width * across)
    if isinstance(camera, EnvironmentCamera) and scales_evenly(camera.to_world[:3, :3]):
        return EnvironmentCamera(_unit(camera.to_world))
    if not isinstance(camera, PerspectiveCamera):
        return camera
    if abs(across - up) > _UNIT * across:
        report.add(where, "a camera whose transform stretches its picture", "the scale across it")
    slope = tan(math.radians(camera.fov_deg) / 2.0) * across / along
    return dataclasses.replace(
        camera,
        to_world=_unit(camera.to_world),
        fov_deg=camera.fov_deg if across == along else math.degrees(2.0 * arctan(slope)),
        lens_radius=camera.lens_radius * across,
        focal_distance=camera.focal_distance if camera.focal_distance == FAR else camera.focal_distance * along,
    )


def _unit(placed: Matrix) -> Matrix:
    """A transform with axes of length 1."""
    made = placed.copy()
    for axis in range(3):
        made[:3, axis] /= norm(placed[:3, axis])
    return made


def turned_map(placed: Matrix) -> Matrix:
    """The transform of an environment map, which has no place and, unless it is stretched, no size."""
    made = _unit(placed) if scales_evenly(placed[:3, :3]) else placed.copy()
    made[:3, 3] = 0.0
    return made


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
