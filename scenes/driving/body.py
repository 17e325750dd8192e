"""The car's body as one lofted surface.

Car frame: ``+x`` ahead, ``+y`` left, ``+z`` up, with the ground at ``z = 0`` and the origin between the axles; metres.
The loft is a family of sections, each a cubic B-spline from the top centre line around the left side to the bottom
centre line. It is closed by rounded ends and then bent: swept back towards the corners, raked in side view, flared over
the wheels.
"""

from __future__ import annotations

import numpy as np
from scipy.interpolate import BSpline, PchipInterpolator

from scenes.arithmetic import cos, exp, hypot, power, sin
from scenes.driving.meshing import Array, SurfaceMesh, from_faces, grid, join, mirrored_y, smooth_normals
from scenes.driving.wheel import RADIUS_M

FRONT_AXLE_M = 1.38
REAR_AXLE_M = -1.34
AXLE_HEIGHT_M = RADIUS_M
HUB_OFFSET_M = 0.785
ARCH_RADIUS_M = 0.392

_STATIONS = 96
_SECTION_SAMPLES = 46
_END_RINGS = 7
_CAP_RINGS = 8
_END_RADIUS = 0.10

# Outlines along the car: pairs of (x, value), from tail to nose.
_TOP = (
    (-2.25, 0.98), (-2.12, 1.030), (-1.95, 1.045), (-1.74, 1.055), (-1.62, 1.075), (-1.45, 1.155), (-1.15, 1.300),
    (-0.98, 1.365), (-0.70, 1.412), (-0.30, 1.434), (0.0, 1.425), (0.20, 1.392), (0.34, 1.345), (0.60, 1.205),
    (0.88, 1.055), (0.99, 1.000), (1.10, 0.975), (1.40, 0.938), (1.75, 0.880), (2.02, 0.815), (2.25, 0.725),
)  # fmt: skip
_BELT = (
    (-2.25, 0.90), (-2.0, 0.945), (-1.6, 0.965), (-1.2, 0.962), (-0.6, 0.945), (0.2, 0.922), (0.8, 0.898), (1.2, 0.868),
    (1.6, 0.825), (1.95, 0.765), (2.25, 0.68),
)  # fmt: skip
_WIDTH = (
    (-2.25, 0.835), (-2.0, 0.865), (-1.6, 0.895), (-1.3, 0.903), (-0.8, 0.897), (0.0, 0.893), (0.8, 0.896),
    (1.3, 0.902), (1.7, 0.893), (2.0, 0.868), (2.25, 0.825),
)  # fmt: skip
_BOTTOM = (
    (-2.25, 0.36), (-2.05, 0.285), (-1.75, 0.23), (-1.2, 0.195), (0.0, 0.185), (1.2, 0.185), (1.8, 0.19), (2.1, 0.205),
    (2.25, 0.23),
)  # fmt: skip


def _outline(table: tuple[tuple[float, float], ...], x: Array) -> Array:
    knots, values = np.array(table).T
    return PchipInterpolator(knots, values)(x)


def top_at(x: Array) -> Array:
    """Height of the centre line at ``x``, metres."""
    return _outline(_TOP, x)


def belt_at(x: Array) -> Array:
    """Height of the line below the side windows at ``x``, metres."""
    return _outline(_BELT, x)


def _stations() -> Array:
    """Positions of the sections: uniform, but denser over the windscreens, whose edges bend most."""
    x = np.linspace(-2.25 + _END_RADIUS, 2.25 - _END_RADIUS, 1200)
    density = 1.0 + 0.5 * exp(-(((x - 0.6) / 0.5) ** 2)) + 0.5 * exp(-(((x + 1.35) / 0.4) ** 2))
    share = np.cumsum(density)
    return np.interp(np.linspace(share[0], share[-1], _STATIONS), share, x)


def _controls(x: Array) -> Array:
    """Control points ``(stations, controls, 2)``, (y, z) from the top centre line to the bottom one."""
    top, belt, width, bottom = (_outline(table, x) for table in (_TOP, _BELT, _WIDTH, _BOTTOM))
    height = top - belt
    cabin = np.clip((height - 0.14) / 0.22, 0.0, 1.0)
    cabin = cabin * cabin * (3.0 - 2.0 * cabin)
    shoulder = width - 0.050
    rail_y = shoulder - 0.085 - 0.41 * power(np.maximum(height - 0.09, 0.0), 0.9)
    rail_z = top - 0.040 - 0.030 * cabin

    def on_side(share: float) -> tuple[Array, Array]:
        bulge = 0.022 * cabin * sin(np.pi * share)
        return rail_y + share * (shoulder - rail_y) + bulge, rail_z + share * (belt + 0.012 - rail_z) + 0.4 * bulge

    zero = np.zeros_like(x)
    middle = 0.5 * (belt + bottom)
    points = [
        (zero, top), (0.38 * rail_y, top), (0.72 * rail_y, top - 0.010), (0.93 * rail_y, rail_z + 0.026),
        (rail_y, rail_z), on_side(0.22), on_side(0.55), on_side(0.85), on_side(1.0), (shoulder + 0.006, belt),
        (shoulder + 0.032, belt - 0.018), (shoulder + 0.040, belt - 0.075), (width - 0.010, belt - 0.115),
        (width, middle + 0.06), (width - 0.006, middle - 0.05), (width - 0.024, bottom + 0.21),
        (width - 0.034, bottom + 0.15), (width - 0.030, bottom + 0.06), (width - 0.040, bottom + 0.012),
        (width - 0.085, bottom), (width - 0.30, bottom), (zero, bottom),
    ]  # fmt: skip
    return np.stack([np.stack(np.broadcast_arrays(y, z), -1) for y, z in points], axis=1)


def _sections(x: Array) -> Array:
    """Points ``(stations, samples, 2)``, (y, z) on the sections."""
    controls = _controls(x)
    count = controls.shape[1]
    knots = np.concatenate([np.zeros(3), np.linspace(0.0, 1.0, count - 2), np.ones(3)])
    spline = BSpline(knots, controls.transpose(1, 0, 2), 3)
    # flat roof and floor need fewer points than the sides
    share = np.linspace(0.0, 1.0, _SECTION_SAMPLES)
    return spline(share).transpose(1, 0, 2)


def _end(section: Array, x: float, side: float) -> list[Array]:
    """Rings ``(samples, 3)`` that round off an end and close it; ``side`` is +1 at the nose.

    Rings shrink towards the centre of the section, not along its normals, which would fold at tight corners.
    """
    middle = np.array([0.0, 0.5 * (section[:, 1].min() + section[:, 1].max())])
    reach = np.array([section[:, 0].max(), 0.5 * np.ptp(section[:, 1])])
    rings = []
    for angle in np.linspace(0.0, np.pi / 2.0, _END_RINGS + 1)[1:]:
        ring = middle + (section - middle) * (1.0 - _END_RADIUS * (1.0 - cos(angle)) / reach)
        rings.append(np.insert(ring, 0, x + side * _END_RADIUS * sin(angle), axis=1))
    edge = rings[-1]
    along = np.linspace(0.0, 1.0, len(edge))[:, None]
    spine = edge[0] + along * (edge[-1] - edge[0])
    for share in np.linspace(0.0, 1.0, _CAP_RINGS + 1)[1:]:
        rings.append(edge + share * (spine - edge))
    return rings


def _bend(points: Array) -> Array:
    """Sweeps corners back, rakes nose and tail in side view, and flares the sides over the wheels."""
    x, y, z = np.moveaxis(points, -1, 0)
    sweep = np.interp(x, [-2.25, -1.6, -0.9, -0.2, 0.9, 1.7, 2.25], [-0.19, -0.12, -0.05, 0.0, 0.10, 0.17, 0.30])
    bent = x - sweep * power(np.abs(y / 0.9), 2.2)
    nose = np.clip((x - 1.75) / 0.5, 0.0, 1.0) ** 2
    tail = np.clip((-1.75 - x) / 0.5, 0.0, 1.0) ** 2

    def beyond(distance: Array) -> Array:
        return np.maximum(distance, 0.0) ** 2

    bent = bent - nose * (0.10 * beyond((z - 0.52) / 0.25) + 0.07 * beyond((0.42 - z) / 0.2))
    bent = bent + tail * (0.05 * beyond((z - 0.75) / 0.25) + 0.10 * beyond((0.52 - z) / 0.2))
    flare = np.zeros_like(x)
    for axle in (FRONT_AXLE_M, REAR_AXLE_M):
        away = hypot(bent - axle, z - AXLE_HEIGHT_M)
        flare = np.maximum(flare, exp(-(((away - ARCH_RADIUS_M) / 0.10) ** 2)))
    outer = np.clip((y - 0.55) / 0.2, 0.0, 1.0)
    return np.stack([bent, y + 0.020 * flare * outer, z], -1)


def shell() -> SurfaceMesh:
    """The whole closed body, before parts are cut out."""
    x = _stations()
    sections = _sections(x)
    middle = [np.insert(section, 0, at, axis=1) for section, at in zip(sections, x, strict=True)]
    tail = _end(sections[0], float(x[0]), -1.0)[::-1]
    nose = _end(sections[-1], float(x[-1]), 1.0)
    left = grid(_bend(np.stack([*tail, *middle, *nose])))
    both = join([left, mirrored_y(left)])
    return SurfaceMesh(both.vertices, both.faces, smooth_normals(both.vertices, both.faces, 1e-5), both.uvs)


def wheel_housing(side: float, axle: float) -> SurfaceMesh:
    """Liner around one wheel: an arch from the body's skin inwards, closed by a wall, facing the wheel."""
    angle = np.linspace(np.radians(-25.0), np.radians(205.0), 30)
    ring = np.stack([axle + ARCH_RADIUS_M * cos(angle), AXLE_HEIGHT_M + ARCH_RADIUS_M * sin(angle)], -1)
    ring[:, 1] = np.maximum(ring[:, 1], 0.20)
    depth = np.array([0.50, 0.70, 0.868])
    net = np.empty((len(ring), len(depth), 3))
    net[..., 0], net[..., 2] = ring[:, :1], ring[:, 1:]
    net[..., 1] = depth
    arch = grid(net[:, ::-1])
    center = np.array([[axle, 0.50, 0.30]])
    wall = np.concatenate([np.insert(ring, 1, 0.50, axis=1), center])
    index = np.arange(len(ring) - 1)
    fan = from_faces(wall, np.stack([np.full_like(index, len(ring)), index + 1, index], -1))
    liner = join([arch, fan])
    return liner if side > 0.0 else mirrored_y(liner)
