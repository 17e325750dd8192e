"""A four-door saloon: the lofted body cut into paint, glass, lamps and trim, on four wheels that spin.

Car frame as in :mod:`scenes.driving.body`. All parts except the wheels move together; each wheel has its own motion.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache

import numpy as np
from scipy.spatial.transform import Rotation

from scenes.animation import UP, Path, Times, attached, sample_track
from scenes.arithmetic import arctan, hypot, rotation_about
from scenes.canonical import ConstantTexture, Instance, Material, Mesh, Phong, Rgb
from scenes.driving.body import (
    ARCH_RADIUS_M,
    AXLE_HEIGHT_M,
    FRONT_AXLE_M,
    HUB_OFFSET_M,
    REAR_AXLE_M,
    belt_at,
    shell,
    top_at,
    wheel_housing,
)
from scenes.driving.cutting import carve
from scenes.driving.meshing import Array, SurfaceMesh, box, ellipsoid, join, lathe, mirrored_y, moved, transformed, tube
from scenes.driving.wheel import RADIUS_M, brake, caliper, rim, tyre

WHEELS = tuple((axle, side) for axle in (FRONT_AXLE_M, REAR_AXLE_M) for side in (1.0, -1.0))

Field = Callable[[Array], Array]


def _material(color: Rgb, gloss: float = 0.0, exponent: float = 40.0, mirror: tuple[float, float] = (0.0, 0.0)):
    return Phong(ConstantTexture(color), (gloss, gloss, gloss), exponent, 1.0, *mirror)


MATERIALS: dict[str, Material] = {
    "paint": _material((0.36, 0.012, 0.014), 0.25, 180.0, (0.045, 0.85)),
    "glass": _material((0.012, 0.014, 0.015), 0.2, 400.0, (0.07, 0.95)),
    "trim": _material((0.018, 0.018, 0.019), 0.04, 12.0, (0.01, 0.15)),
    "chrome": Phong(
        ConstantTexture((0.05, 0.05, 0.05)), (0.4, 0.4, 0.4), 200.0, 1.0, 0.55, 0.9, 5.0, (0.9, 0.91, 0.93)
    ),
    "head lamp": _material((0.22, 0.23, 0.25), 0.5, 200.0, (0.30, 0.9)),
    "tail lamp": _material((0.10, 0.002, 0.002), 0.4, 120.0, (0.08, 0.8)),
    "plate": _material((0.62, 0.62, 0.58), 0.05, 30.0),
    "tyre": _material((0.022, 0.022, 0.023), 0.03, 8.0),
    "rim": Phong(
        ConstantTexture((0.30, 0.30, 0.31)), (0.35, 0.35, 0.36), 60.0, 1.0, 0.18, 0.6, 5.0, (0.95, 0.95, 0.97)
    ),
    "brake": _material((0.16, 0.15, 0.15), 0.2, 20.0, (0.05, 0.2)),
    "caliper": _material((0.45, 0.30, 0.02), 0.2, 40.0),
}


def _above(height: Callable[[Array], Array] | float, gap: float = 0.0) -> Field:
    """Negative above a height, or above a line over x raised by ``gap``."""
    if callable(height):
        return lambda p: height(p[:, 0]) + gap - p[:, 2]
    return lambda p: height + gap - p[:, 2]


def _below(height: Callable[[Array], Array] | float, gap: float = 0.0) -> Field:
    over = _above(height, gap)
    return lambda p: -over(p)


def _ahead(x: float, lean: float = 0.0) -> Field:
    """Negative ahead of ``x``; the line leans back by ``lean`` metres per metre above z = 0.9."""
    return lambda p: x - lean * (p[:, 2] - 0.9) - p[:, 0]


def _behind(x: float, lean: float = 0.0) -> Field:
    ahead = _ahead(x, lean)
    return lambda p: -ahead(p)


def _off_centre(y: float) -> Field:
    """Negative further than ``y`` from the middle plane."""
    return lambda p: y - np.abs(p[:, 1])


def _central(y: float) -> Field:
    return lambda p: np.abs(p[:, 1]) - y


def _wheel_arch(axle: float) -> Field:
    return lambda p: hypot(p[:, 0] - axle, p[:, 2] - AXLE_HEIGHT_M) - ARCH_RADIUS_M


def _regions() -> list[tuple[str, list[Field]]]:
    """Regions that are cut out of the shell, in order, each with the name of its part."""
    cuts: list[tuple[str, list[Field]]] = [
        ("", [_wheel_arch(axle), _off_centre(0.5)]) for axle in (FRONT_AXLE_M, REAR_AXLE_M)
    ]
    window = [_above(belt_at, 0.035), _below(top_at, -0.120), _off_centre(0.40)]
    cuts.append(("glass", [*window, _behind(0.90), _ahead(-0.02, 0.10)]))
    cuts.append(("glass", [*window, _behind(-0.09, 0.10), _ahead(-1.02, -0.35)]))
    screen = [_above(belt_at, 0.055), _central(0.665)]
    cuts.append(("glass", [*screen, _ahead(0.40), _behind(1.02), lambda p: np.abs(p[:, 1]) - _screen_half(p[:, 2])]))
    cuts.append(("glass", [*screen, _behind(-0.98), _ahead(-1.60), lambda p: np.abs(p[:, 1]) - _screen_half(p[:, 2])]))
    nose, tail = _ahead(1.55), _behind(-1.75)
    cuts.append(("head lamp", [nose, _off_centre(0.47), _above(lambda x: 0.655 - 0.10 * (x - 1.9)), _below(0.735)]))
    cuts.append(("trim", [nose, _central(0.36), _above(0.525), _below(0.665)]))
    cuts.append(("trim", [nose, _central(0.60), _above(0.265), _below(0.385)]))
    cuts.append(("tail lamp", [tail, _off_centre(0.42), _above(0.775), _below(0.895)]))
    cuts.append(("trim", [_behind(-1.6), _central(0.62), _below(0.36)]))
    cuts.append(("trim", [_below(0.235)]))
    for x, lean in ((0.93, -0.10), (-0.055, 0.04), (-0.98, 0.22)):  # gaps around the doors
        cuts.append(
            ("trim", [_ahead(x - 0.005, lean), _behind(x + 0.005, lean), _below(belt_at, 0.035), _off_centre(0.6)])
        )
    cuts.append(("trim", [_below(0.30), _above(0.288), _ahead(-0.90), _behind(0.96), _off_centre(0.6)]))
    return cuts


def _screen_half(z: Array) -> Array:
    """Half width of the front and rear screens at a height."""
    return np.interp(z, [0.95, 1.40], [0.70, 0.47])


@lru_cache(maxsize=1)
def body_parts() -> dict[str, Mesh]:
    """All parts fixed to the body, one mesh per material."""
    parts: dict[str, list[SurfaceMesh]] = {name: [] for name in MATERIALS}
    rest = shell()
    for name, fields in _regions():
        piece, rest = carve(rest, *fields)
        if name:
            parts[name].append(piece)
    parts["paint"].append(rest)
    for axle, side in WHEELS:
        parts["trim"].append(wheel_housing(side, axle))
        holder = moved(caliper(), (axle, HUB_OFFSET_M, AXLE_HEIGHT_M))
        parts["caliper"].append(holder if side > 0 else mirrored_y(holder))
    parts["trim"].append(box((-1.9, -0.5, 0.19), (1.9, 0.5, 0.30)))  # closes the floor between the wheels
    for name, surface in _details():
        parts[name] += [surface, mirrored_y(surface)]
    parts["plate"].append(box((2.24, -0.26, 0.41), (2.262, 0.26, 0.51)))
    parts["plate"].append(box((-2.262, -0.26, 0.60), (-2.24, 0.26, 0.71)))
    return {name: join(pieces).mesh(name) for name, pieces in parts.items() if pieces}


def _details() -> list[tuple[str, SurfaceMesh]]:
    """Small parts of the left side; the right side mirrors them."""
    handle = [("chrome", ellipsoid((x, 0.905, 0.80), (0.085, 0.022, 0.014), 8, 12)) for x in (0.12, -0.80)]
    pipe = lathe(np.array([[0.030, 0.0], [0.036, 0.0], [0.036, 0.16]])[::-1], 16)
    upright = rotation_about(UP, np.pi / 2.0).as_matrix()
    return [
        *handle,
        ("paint", ellipsoid((0.66, 1.00, 0.985), (0.075, 0.105, 0.068))),
        ("chrome", ellipsoid((0.600, 1.00, 0.985), (0.022, 0.085, 0.052))),
        ("trim", tube((0.66, 0.85, 0.93), (0.66, 0.95, 0.965), 0.022, 0.018)),
        ("chrome", transformed(pipe, upright, (-1.95, 0.50, 0.262))),
        ("trim", tube((2.10, 0.02, 0.60), (2.10, 0.355, 0.60), 0.05, 0.05)),
        ("chrome", tube((2.205, 0.0, 0.668), (2.165, 0.375, 0.668), 0.012, 0.010)),
        ("chrome", tube((-2.235, 0.0, 0.758), (-2.16, 0.62, 0.758), 0.010, 0.008)),
    ]


def instances(path: Path, start_s: float, end_s: float, interval_s: float = 1.0 / 240.0) -> list[Instance]:
    """The car on its path, with steering front wheels and rolling wheels.

    Wheels roll by the distance that the ground passes along the car. No wheel slips on straights, and rear wheels do
    not slip in bends; the roll of the front wheels neglects their steering angle.

    Args:
        path: path of the point between the axles, on the ground.
        start_s, end_s: animated time span, seconds; poses are held outside it.
        interval_s: time between keys, seconds.
    """
    body_track = sample_track(path.pose, start_s, end_s, interval_s)
    placed = [Instance(mesh, MATERIALS[name], track=body_track, name=name) for name, mesh in body_parts().items()]
    for axle, side in WHEELS:
        turn = _wheel_turn(path, steered=axle == FRONT_AXLE_M, side=side)
        hub = np.array([axle, side * HUB_OFFSET_M, AXLE_HEIGHT_M])
        track = sample_track(attached(path.pose, hub, turn), start_s, end_s, interval_s)
        for mesh, name in ((tyre(), "tyre"), (rim(), "rim"), (brake(), "brake")):
            placed.append(Instance(mesh, MATERIALS[name], track=track, name=f"{name} {axle:+.0f} {side:+.0f}"))
    return placed


def _wheel_turn(path: Path, steered: bool, side: float) -> Callable[[Times], Rotation]:
    """Orientation of a wheel in the car's frame: steering about z, rolling about the axle, with the outer side
    outwards."""
    outward = rotation_about(UP, 0.0 if side > 0 else np.pi)

    def turn(time_s: Times) -> Rotation:
        distance = path.distance(time_s)
        steer = arctan(path.curvature(distance) * (FRONT_AXLE_M - REAR_AXLE_M)) * steered
        # in a bend the path of the inner wheel is shorter
        rolled = distance - side * HUB_OFFSET_M * (path.heading(distance) - path.heading_rad)
        return rotation_about(UP, steer) * rotation_about((0.0, 1.0, 0.0), rolled / RADIUS_M) * outward

    return turn
