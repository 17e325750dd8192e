"""Meshes for shapes that the canonical scene lacks: quadrics and parts of spheres and disks."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from scenes.arithmetic import arccos, cos, hypot, product, sin
from scenes.canonical import Mesh
from scenes.formats.geometry.orientation import area_normals

AROUND, ALONG = 64, 16
"""Number of quadrilaterals in a full turn, and along a curved profile."""

Profile = Callable[[NDArray[np.float64]], tuple[NDArray[np.float64], NDArray[np.float64]]]


def revolved(profile: Profile, along: int, turn_deg: float = 360.0, source: str = "", full: int = AROUND) -> Mesh:
    """The surface that a profile sweeps about the z axis, u along the turn and v along the profile.

    Args:
        profile: radius and z at parameters from 0 to 1.
        along: number of quadrilaterals along the profile.
        turn_deg: angle of the turn, from +x towards +y.
        source: name for messages.
        full: number of quadrilaterals in a full turn.
    """
    around = max(3, math.ceil(full * turn_deg / 360.0))
    u, v = np.meshgrid(np.linspace(0.0, 1.0, around + 1), np.linspace(0.0, 1.0, along + 1))
    phi = np.radians(turn_deg) * u
    radius, z = profile(v)
    step = 1e-4
    (r0, z0), (r1, z1) = profile(np.clip(v - step, 0.0, 1.0)), profile(np.clip(v + step, 0.0, 1.0))
    # the derivatives by u and v span the surface; their cross product points outwards as in PBRT's quadrics
    dr, dz = r1 - r0, z1 - z0
    normal = np.stack([dz * cos(phi), dz * sin(phi), -dr], axis=-1)
    normal /= np.maximum(np.linalg.norm(normal, axis=-1, keepdims=True), 1e-12)
    points = np.stack([radius * cos(phi), radius * sin(phi), z], axis=-1)
    row = np.arange(along)[:, None] * (around + 1) + np.arange(around)
    a, b, c, d = (part.ravel() for part in (row, row + 1, row + around + 2, row + around + 1))
    faces = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
    corners = points.reshape(-1, 3)[faces]
    size = np.linalg.norm(area_normals(corners), axis=1)
    return Mesh(
        points.reshape(-1, 3).astype(np.float32),
        faces[size > 1e-12 * size.max()].astype(np.int32),
        normal.reshape(-1, 3).astype(np.float32),
        np.stack([u, v], axis=-1).reshape(-1, 2).astype(np.float32),
        source,
    )


def cylinder(radius: float, z_min: float, z_max: float, turn_deg: float = 360.0) -> Mesh:
    """An open cylinder about z."""
    return revolved(lambda v: (np.full_like(v, radius), z_min + (z_max - z_min) * v), 1, turn_deg, "cylinder")


def cone(radius: float, height: float, turn_deg: float = 360.0) -> Mesh:
    """An open cone with its tip at ``height``."""
    return revolved(lambda v: (radius * (1.0 - v), height * v), 1, turn_deg, "cone")


def paraboloid(radius: float, z_min: float, z_max: float, turn_deg: float = 360.0) -> Mesh:
    """``z = z_max (r / radius)²`` between two heights."""

    def profile(v: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        z = z_min + (z_max - z_min) * v
        return radius * np.sqrt(np.maximum(z / z_max, 0.0)), z

    return revolved(profile, ALONG, turn_deg, "paraboloid")


def hyperboloid(p1: NDArray[np.float64], p2: NDArray[np.float64], turn_deg: float = 360.0) -> Mesh:
    """The surface that the segment between two points sweeps."""

    def profile(v: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        p = p1 + v[..., None] * (p2 - p1)
        return hypot(p[..., 0], p[..., 1]), p[..., 2]

    return revolved(profile, ALONG, turn_deg, "hyperboloid")


def partial_sphere(radius: float, z_min: float, z_max: float, turn_deg: float = 360.0) -> Mesh:
    """The part of a sphere between two heights."""
    low, high = (arccos(min(1.0, max(-1.0, z / radius))) for z in (z_min, z_max))

    def profile(v: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        theta = low + (high - low) * v
        return radius * sin(theta), radius * cos(theta)

    return revolved(profile, 2 * ALONG, turn_deg, "sphere")


@lru_cache(maxsize=1)
def lamp_sphere() -> Mesh:
    """224 triangles with the area of a sphere of radius 1; LuxCore samples the light of at most 256 triangles."""

    def profile(v: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        return sin(math.pi * v), -cos(math.pi * v)

    unit = revolved(profile, 8, source="sphere", full=16)
    scale = math.sqrt(4.0 * math.pi / area(unit))
    return Mesh((unit.vertices * np.float32(scale)), unit.faces, unit.normals, unit.uvs, unit.source)


def area(mesh: Mesh, axes: NDArray[np.float64] | None = None) -> float:
    """Total area of the triangles, after a linear map ``(3, 3)`` if one is given."""
    corners = mesh.vertices[mesh.faces].astype(np.float64)
    placed = corners if axes is None else product(corners, axes.T)
    return 0.5 * float(np.linalg.norm(area_normals(placed), axis=1).sum())


def ring(radius: float, inner: float, height: float, turn_deg: float = 360.0) -> Mesh:
    """A disk with a hole, or part of one, facing +z."""
    return revolved(lambda v: (inner + (radius - inner) * (1.0 - v), np.full_like(v, height)), 1, turn_deg, "disk")
