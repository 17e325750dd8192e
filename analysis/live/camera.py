"""A camera that is driven: it looks round, goes where it is told, and rides with the scene's own camera or does not.

Its place is a rigid motion outside the scene's own placement of the camera, as a track is: of a camera that rides, in
the space of the scene's own track; of one that does not, in the world. State in, state out.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from scenes.arithmetic import norm, product, rotation_about
from scenes.retiming import Keys, after

Vector = Float64[NDArray, " 3"]

STEEPEST_RAD = np.radians(89.0)
"""Greatest angle of the line of sight to the horizon that the camera is turned to."""


@dataclass(frozen=True, eq=False)
class Drive:
    """Where the camera is, and how it goes on.

    Attributes:
        to_world: ``(4, 4)`` the scene's placement of the camera.
        translation, rotation: the motion outside it, ``(3,)`` and ``(4,)``, ``(x, y, z, w)``.
        up: unit vector about which it looks round, in the space of that motion.
        rides: whether the scene's own motion of its camera comes outside.
        velocity: to the right, up and ahead, scene units per second.
        turning: to the left and up, radians per second.
    """

    to_world: NDArray[np.float64]
    translation: Vector
    rotation: Float64[NDArray, " 4"]
    up: Vector
    rides: bool = True
    velocity: tuple[float, float, float] = (0.0, 0.0, 0.0)
    turning: tuple[float, float] = (0.0, 0.0)

    @property
    def eye(self) -> Vector:
        """Where it is."""
        return _turn(self).apply(self.to_world[:3, 3]) + self.translation

    @property
    def axes(self) -> tuple[Vector, Vector, Vector]:
        """Unit vectors to the right, up and ahead of the picture."""
        columns = _turn(self).apply(self.to_world[:3, :3].T)
        right, up, back = (column / norm(column) for column in columns)
        return right, up, -back

    @property
    def moves(self) -> bool:
        """Whether it goes or turns by itself."""
        return any(self.velocity) or any(self.turning)


def _turn(drive: Drive) -> Rotation:
    return Rotation.from_quat(drive.rotation)


def nearest_axis(direction: Vector) -> Vector:
    """The axis, of either sign, that a direction is nearest to."""
    axis, greatest = np.zeros(3), int(np.abs(direction).argmax())
    axis[greatest] = np.sign(direction[greatest])
    return axis


def at_rest(to_world: NDArray[np.float64]) -> Drive:
    """A camera where the scene puts it, which rides."""
    return Drive(to_world, np.zeros(3), np.array([0.0, 0.0, 0.0, 1.0]), nearest_axis(to_world[:3, 1]))


def turned(drive: Drive, left_rad: float, up_rad: float, distance: float = 0.0) -> Drive:
    """It looks further to the left and up: about its own place, or goes round what lies so far ahead of it.

    Args:
        drive: before.
        left_rad, up_rad: angles, radians. It is never turned beyond :data:`STEEPEST_RAD`.
        distance: ahead of it, to the point that stays in the middle, scene units.
    """
    right, _, ahead = drive.axes
    steep = float(np.arcsin(np.clip(product(ahead, drive.up), -1.0, 1.0)))
    up_rad = float(np.clip(steep + up_rad, min(-STEEPEST_RAD, steep), max(STEEPEST_RAD, steep))) - steep
    # about the horizontal, so that the horizon stays level
    level = np.cross(ahead, drive.up)
    level = level / norm(level) if norm(level) > 1e-9 else right
    pivot = drive.eye + distance * ahead
    turn = rotation_about(drive.up, left_rad) * rotation_about(level, up_rad)
    translation = turn.apply(drive.translation - pivot) + pivot
    return dataclasses.replace(drive, translation=translation, rotation=(turn * _turn(drive)).as_quat())


def moved(drive: Drive, by: tuple[float, float, float]) -> Drive:
    """It goes to the right, up and ahead, scene units."""
    shift = sum(step * axis for step, axis in zip(by, drive.axes, strict=True))
    return dataclasses.replace(drive, translation=drive.translation + shift)


def later(drive: Drive, seconds: float) -> Drive:
    """It goes on for so many seconds as it is told."""
    if any(drive.turning):
        drive = turned(drive, drive.turning[0] * seconds, drive.turning[1] * seconds)
    if any(drive.velocity):
        x, y, z = (speed * seconds for speed in drive.velocity)
        drive = moved(drive, (x, y, z))
    return drive


def riding(drive: Drive, own: Keys, rides: bool) -> Drive:
    """It begins to ride, or ends it, and stays where it is.

    Args:
        drive: before.
        own: the scene's own motion of its camera now, ``(3,)`` and ``(4,)``.
        rides: whether it is to ride.
    """
    if rides == drive.rides:
        return drive
    place, turn = own[0], Rotation.from_quat(own[1])
    changed = (place, own[1]) if drive.rides else (-turn.inv().apply(place), turn.inv().as_quat())
    first, second = ((a[None], b[None]) for a, b in (changed, (drive.translation, drive.rotation)))
    translation, rotation = after(first, second)
    found = dataclasses.replace(drive, translation=translation[0], rotation=rotation[0], rides=rides)
    return dataclasses.replace(found, up=nearest_axis(found.axes[1]))


def outside(rides: bool, own: Keys, inner: Keys) -> Keys:
    """The camera's whole motion outside its placement, ``(keys, ...)``.

    Args:
        rides: whether it rides.
        own: the scene's own motion of the camera.
        inner: where it is driven to at the same times, as :class:`Drive` has it.
    """
    return after(own, inner) if rides else inner
