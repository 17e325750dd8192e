"""The contents of a model file."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from scenes.arithmetic import arctan, norm, tan
from scenes.canonical import Film, Instance, Light, Matrix, OrthographicCamera, PerspectiveCamera
from scenes.viewing import Up

_SIDE_PX = 512
_ASPECT_MOST = 16.0


@dataclass(frozen=True, eq=False)
class ModelCamera:
    """A camera of a file.

    Attributes:
        camera: camera in the file's coordinate system.
        aspect: width of its picture over the height.
    """

    camera: PerspectiveCamera | OrthographicCamera
    aspect: float = 1.0

    @property
    def film(self) -> Film:
        """A film of the camera's aspect, between 1/16 and 16, whose shorter side has 512 pixels."""
        aspect = min(max(self.aspect, 1.0 / _ASPECT_MOST), _ASPECT_MOST)
        return Film(round(_SIDE_PX * max(aspect, 1.0)), round(_SIDE_PX * max(1.0 / aspect, 1.0)))


@dataclass(frozen=True, eq=False)
class Model:
    """The contents of a file, in its coordinate system.

    Attributes:
        parts: instances, each with one material; lamps with an area are among them.
        lights: lights without an area, and environments.
        cameras: cameras by name, in the order of the file.
        up: upward axis, where the file names it.
        posed: whether parts of it change other than by rigid motion, and are as at the time for which it was read.
    """

    parts: tuple[Instance, ...]
    lights: tuple[Light, ...] = ()
    cameras: Mapping[str, ModelCamera] = field(default_factory=dict)
    up: Up | None = None
    posed: bool = False

    @property
    def lit(self) -> bool:
        """Whether the file has lights."""
        return bool(self.lights) or any(part.emission is not None for part in self.parts)


def unscaled(matrix: Matrix) -> Matrix:
    """A transform without its scale, for cameras, which have none; the axes keep their directions."""
    found = matrix.copy()
    found[:3, :3] /= np.maximum(np.linalg.norm(matrix[:3, :3], axis=0, keepdims=True), 1e-300)
    return found


def axis_of(matrix: Matrix, axis: int, sign: float = -1.0) -> tuple[float, float, float]:
    """The direction of an axis of a transform, a unit vector."""
    along = sign * matrix[:3, axis]
    x, y, z = (float(part) for part in along / max(float(norm(along)), 1e-300))
    return x, y, z


def shorter_fov_deg(height_fov_rad: float, aspect: float) -> float:
    """The field of view along the shorter side of a picture, degrees, from that along its height."""
    if aspect < 1.0:
        height_fov_rad = 2.0 * float(arctan(aspect * tan(height_fov_rad / 2.0)))
    return min(max(math.degrees(height_fov_rad), 1e-3), 179.0)
