"""A road wheel as lathed profiles and five lofted spokes.

Wheel frame: the axle is the y axis, the outer side faces ``+y``, and the origin is the centre of the tyre; metres.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from scenes.arithmetic import cos, sin
from scenes.canonical import Mesh
from scenes.driving.meshing import Array, SurfaceMesh, extrude, grid, join, lathe, smooth_normals, transformed

RADIUS_M = 0.335
SPOKES = 5

_RIM_RADIUS = 0.245
_SEGMENTS = 60


def _turn(angle: float) -> Array:
    """Rotation ``(3, 3)`` about the axle."""
    c, s = cos(angle), sin(angle)
    return np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])


@lru_cache(maxsize=1)
def tyre() -> Mesh:
    """Tread with three grooves, rounded shoulders, bulging side walls, open towards the rim."""
    wall = [(_RIM_RADIUS - 0.004, 0.094), (0.258, 0.108), (0.275, 0.1165), (0.295, 0.116), (0.313, 0.1075)]
    shoulder = [(0.324, 0.0985), (RADIUS_M - 0.005, 0.091), (RADIUS_M - 0.001, 0.083)]
    groove = []
    for center in (0.046, 0.0):
        groove += [(RADIUS_M, center + 0.0065), (RADIUS_M - 0.007, center + 0.0045)]
        groove += [(RADIUS_M - 0.007, center - 0.0045), (RADIUS_M, center - 0.0065)]
    upper = np.array([*wall, *shoulder, *groove[:6]])
    lower = upper[::-1] * np.array([1.0, -1.0])
    return lathe(np.concatenate([upper, lower])[::-1], _SEGMENTS, crease_deg=30.0).mesh("tyre")


def _spoke() -> SurfaceMesh:
    """One spoke along ``+z``: a bevelled, slightly dished bar that widens towards hub and rim."""
    along = np.linspace(0.0, 1.0, 9)
    radius = 0.052 + along * (_RIM_RADIUS - 0.016 - 0.052)
    half_width = 0.0235 - 0.004 * sin(np.pi * along) + 0.012 * (along * along * along)
    face = 0.070 + 0.022 * along - 0.014 * sin(np.pi * along)
    depth = 0.052 - 0.018 * along
    # section in (sideways, axial): a flat outer face with bevelled edges, narrower at the back
    section = np.array(
        [(-0.62, 0.0), (0.62, 0.0), (0.9, -0.10), (1.0, -0.28), (0.8, -1.0), (-0.8, -1.0), (-1.0, -0.28), (-0.9, -0.10)]
    )
    section = np.concatenate([section, section[:1]])
    points = np.empty((len(along), len(section), 3))
    points[..., 0] = half_width[:, None] * section[:, 0]
    points[..., 1] = face[:, None] + depth[:, None] * section[:, 1]
    points[..., 2] = radius[:, None]
    bar = join([grid(points[:, i : i + 2]) for i in range(len(section) - 1)])
    return SurfaceMesh(bar.vertices, bar.faces, smooth_normals(bar.vertices, bar.faces), bar.uvs)


def _nut(angle: float) -> SurfaceMesh:
    """A hexagonal wheel nut on the hub."""
    turn = np.linspace(0.0, 2.0 * np.pi, 7)[:-1]
    head = extrude(0.0105 * np.stack([cos(turn), sin(turn)], -1), 0.0, 0.018)
    lay = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])  # z to y
    return transformed(transformed(head, lay, (0.0, 0.064, 0.042)), _turn(angle))


@lru_cache(maxsize=1)
def rim() -> Mesh:
    """Barrel with a lip on both sides, hub with cap and nuts, five spokes with open gaps between them."""
    inner = _RIM_RADIUS - 0.016
    barrel = np.array(
        [
            (inner - 0.012, -0.098), (inner - 0.012, -0.06), (inner - 0.004, 0.0), (inner, 0.075),
            (inner + 0.004, 0.094), (_RIM_RADIUS - 0.007, 0.099), (_RIM_RADIUS + 0.002, 0.099),
            (_RIM_RADIUS + 0.004, 0.094),
        ]
    )  # fmt: skip
    # facing the axle, so the profile runs down; the lip then faces outwards
    lip = lathe(barrel[::-1], _SEGMENTS, crease_deg=50.0)
    back = lathe(np.array([(inner - 0.012, -0.098), (_RIM_RADIUS, -0.104)]), _SEGMENTS // 2)
    profile = [(0.062, -0.02), (0.064, 0.058), (0.058, 0.067), (0.031, 0.069), (0.029, 0.076), (0.02, 0.080)]
    hub = lathe(np.array([*profile, (0.0, 0.081)]), 30, crease_deg=45.0)
    step = 2.0 * np.pi / SPOKES
    parts = [lip, back, hub]
    for index in range(SPOKES):
        parts += [transformed(_spoke(), _turn(index * step)), _nut((index + 0.5) * step)]
    return join(parts).mesh("rim")


@lru_cache(maxsize=1)
def brake() -> Mesh:
    """Brake disc with its hat, behind the spokes; it closes the wheel towards the car."""
    disc = np.array([(0.0, 0.022), (0.075, 0.022), (0.078, 0.006), (0.168, 0.006), (0.168, -0.016), (0.0, -0.016)])
    return lathe(disc[::-1], 40).mesh("brake disc")


def caliper() -> SurfaceMesh:
    """A caliper that clasps the disc behind the axle (towards ``-x``); it does not turn with the wheel."""
    turn = np.radians(np.linspace(-32.0, 32.0, 8))
    inside, outside = 0.118, 0.186
    arc = np.stack([-cos(turn), sin(turn)], -1)
    section = np.array(
        [(outside, -0.035), (outside, 0.026), (outside - 0.01, 0.036), (inside, 0.036), (inside, -0.035)]
    )
    section = np.concatenate([section, section[:1]])
    points = np.empty((len(turn), len(section), 3))
    points[..., 0] = arc[:, :1] * section[:, 0]
    points[..., 2] = arc[:, 1:] * section[:, 0]
    points[..., 1] = section[:, 1]
    sides = [grid(points[:, i : i + 2]) for i in range(len(section) - 1)]
    caps = []
    for end, order in ((0, slice(None, None, -1)), (-1, slice(None))):
        ring = points[end, :-1][order]
        caps.append(grid(np.stack([np.stack([ring[0], ring[1]]), np.stack([ring[4], ring[2]])])))
    return join([*sides, *caps])
