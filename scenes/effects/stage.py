"""Common parts of the scenes of effects: a floor, a few objects to place on it, and light. ``z`` is up."""

from __future__ import annotations

import numpy as np

from scenes.animation import camera_to_world
from scenes.canonical import (
    Camera,
    CheckerboardTexture,
    ConstantTexture,
    Cube,
    DirectionalLight,
    EnvironmentLight,
    Instance,
    Light,
    Material,
    Matrix,
    PerspectiveCamera,
    Phong,
    Rectangle,
    Rgb,
    Scene,
    Sphere,
)
from scenes.driving import sky

EYE, TARGET = (0.0, -9.0, 3.4), (0.0, 0.0, 1.0)
GREY, RED, BLUE = (0.55, 0.55, 0.55), (0.75, 0.12, 0.1), (0.12, 0.25, 0.7)
AMBIENT = (0.10, 0.11, 0.13)


def paint(color: Rgb, **more: float | Rgb) -> Phong:
    """A Phong material of one diffuse colour."""
    return Phong(ConstantTexture(color), **more)  # type: ignore[arg-type]


def placed(at: tuple[float, float, float], size: tuple[float, float, float] = (1.0, 1.0, 1.0)) -> Matrix:
    """A transform that scales and then translates."""
    matrix = np.diag([*size, 1.0])
    matrix[:3, 3] = at
    return matrix


def facing_down(at: tuple[float, float, float], half_x: float, half_y: float) -> Matrix:
    """The transform of a rectangle that faces the floor."""
    return placed(at, (half_x, -half_y, -1.0))


def floor(scale: float = 1.0) -> Instance:
    """A chequered square at ``z = 0``, 24 units wide; ``scale`` widens it and keeps the size of its squares."""
    squares = CheckerboardTexture(
        ConstantTexture((0.62, 0.60, 0.56)), ConstantTexture((0.30, 0.31, 0.34)), (24.0 * scale, 24.0 * scale)
    )
    return Instance(Rectangle(), Phong(squares), placed((0, 6, 0), (12 * scale, 12 * scale, 1)), name="floor")


def staged(*instances: Instance, lights: tuple[Light, ...] = (), camera: Camera | None = None, **more) -> Scene:
    """A scene of the floor and some instances in front of the haze; ``more`` is passed to :class:`Scene`."""
    camera = camera or PerspectiveCamera(camera_to_world(np.array(EYE), np.array(TARGET)), 38.0)
    return Scene(camera, (floor(), *instances), lights, ambient=AMBIENT, background=haze(), **more)


def haze() -> EnvironmentLight:
    """A gradient as background: dark below, bright at the horizon, blue above."""
    heights = np.linspace(1.0, -1.0, 64)[:, None, None]
    above = np.array([0.75, 0.82, 0.9]) + np.clip(heights, 0.0, 1.0) * np.array([-0.55, -0.42, -0.15])
    return EnvironmentLight(np.where(heights > 0.0, above, 0.25).astype(np.float32), sky.sky().to_world)


def lamp(at: tuple[float, float, float], half: float, radiance: float) -> Instance:
    """A square lamp, twice ``half`` wide, that shines down."""
    emission = (radiance, 0.95 * radiance, 0.85 * radiance)
    return Instance(Rectangle(), paint(GREY), facing_down(at, half, half), name="lamp", emission=emission)


SUN = DirectionalLight((0.5, 0.6, -1.0), (2.4, 2.3, 2.0))


def pair(left: Material, right: Material) -> tuple[Instance, ...]:
    """A ball and a box side by side."""
    turned = placed((1.5, 0.5, 0.9), (0.9, 0.9, 0.9))
    turned[:2, :2] = 0.9 * np.array([[0.87, -0.5], [0.5, 0.87]])
    return (
        Instance(Sphere(1.0), left, placed((-1.5, 0.0, 1.0)), name="ball"),
        Instance(Cube(), right, turned, name="box"),
    )
