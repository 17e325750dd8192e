"""Analytic daylight: radiance of the sky, irradiance of the sun, and position of the sun.

Source: L. Hošek and A. Wilkie, "An Analytic Model for Full Spectral Sky-Dome Radiance", ACM Trans. Graph. 31 (4), 2012
(the sky, eq. 8 and its published coefficients); "Adding a Solar-Radiance Function to the Hošek–Wilkie Skylight Model",
IEEE CG&A 33 (3), 2013 (the sun, evaluated as in Mitsuba 3.9).
"""

from __future__ import annotations

import math
from datetime import UTC, datetime, timedelta
from functools import lru_cache, partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from scenes.arithmetic import arccos, arcsin, cos, exp, norm, power, product, sin
from scenes.canonical import DirectionalLight, EnvironmentLight, Matrix, SunSky
from scenes.loading import FileState, asset, state_of

SUN_DEG = 0.5358
"""Full angle of the sun's disk."""

MAP_HEIGHT = 256
"""Number of rows of a sky that is written as an image."""

_UNIT = 0.00936766
"""Factor from the radiance of the coefficients to that of Mitsuba 3 in W m⁻² sr⁻¹ nm⁻¹, as measured."""


def _tables() -> dict[str, NDArray[np.float64]]:
    """Coefficient tables, with turbidity 1 to 10 along the first axis of each."""
    path = asset("daylight/hosek_wilkie.npz")
    return _read_tables(path, state_of(path))


@lru_cache(maxsize=1)
def _read_tables(path: Path, state: FileState | None) -> dict[str, NDArray[np.float64]]:
    with np.load(path) as stored:
        return {name: stored[name].astype(np.float64) for name in stored.files}


def _between(table: NDArray[np.float64], at: float) -> NDArray[np.float64]:
    """Linear interpolation along the first axis, held at the ends."""
    at = min(max(at, 0.0), table.shape[0] - 1.0)
    low = min(int(at), table.shape[0] - 2)
    return table[low] + (at - low) * (table[low + 1] - table[low])


def _elevation_rad(light: SunSky) -> float:
    """Height of the sun above the horizon, radians, at least zero."""
    sun, up = (np.array(part) / norm(part) for part in (light.sun_direction, light.up))
    return max(arcsin(float(np.clip(product(sun, up), -1.0, 1.0))), 0.0)


def sky_radiance(light: SunSky, directions: NDArray[np.float64]) -> NDArray[np.float64]:
    """Radiance of the sky without the sun; black below the horizon.

    With ``θ`` the angle from the zenith and ``γ`` that from the sun, the radiance is the mean radiance times
    ``(1 + A e^(B / (cos θ + 0.01))) (C + D e^(E γ) + F cos² γ + G χ + I √(cos θ))`` where
    ``χ = (1 + cos² γ) / (1 + H² - 2 H cos γ)^1.5`` (Hošek and Wilkie 2012, eq. 8).

    Args:
        light: sun and sky; the turbidity is clamped to [1, 10] and the sun to the horizon.
        directions: ``(n, 3)`` unit vectors towards the sky.

    Returns:
        ``(n, 3)`` linear RGB, not negative.
    """
    tables, elevation = _tables(), _elevation_rad(light)
    x = power(elevation / (0.5 * math.pi), 1.0 / 3.0)
    weights = np.array([math.comb(5, n) * power(1.0 - x, 5 - n) * power(x, n) for n in range(6)])
    mixed = []
    for name in ("sky_radiance", "sky_shape"):
        of_albedo = _between(tables[name], light.turbidity - 1.0)
        of_height = _between(of_albedo, light.ground_albedo)
        mixed.append(product(weights, of_height.reshape(6, -1)).reshape(of_height.shape[1:]))
    a, b, c, d, e, f, g, i, h = mixed[1].T
    sun, up = (np.array(part) / norm(part) for part in (light.sun_direction, light.up))
    height = product(directions, up)[:, None]
    toward = np.clip(product(directions, sun), -1.0, 1.0)[:, None]
    above = np.maximum(height, 0.0)
    anisotropy = (1.0 + toward**2) / power(1.0 + h * h - 2.0 * h * toward, 1.5)
    horizon = 1.0 + a * exp(b / (above + 0.01))
    glow = c + d * exp(e * arccos(toward)) + f * toward**2 + g * anisotropy + i * np.sqrt(above)
    radiance = light.scale * _UNIT * mixed[0] * horizon * glow
    return np.where(height >= 0.0, np.maximum(radiance, 0.0), 0.0)


@lru_cache(maxsize=4)
def sky_map(light: SunSky, height: int = MAP_HEIGHT) -> EnvironmentLight:
    """The sky as an environment map of ``height`` rows and twice as many columns."""
    to_world = facing_up(light.up)
    polar = (np.arange(height) + 0.5) * math.pi / height
    around = (np.arange(2 * height) + 0.5) * math.pi / height
    sine = sin(polar)[:, None]
    local = np.stack(
        [
            sin(around) * sine,
            np.broadcast_to(cos(polar)[:, None], (height, 2 * height)),
            -cos(around) * sine,
        ],
        axis=-1,
    )
    world = product(local.reshape(-1, 3), to_world[:3, :3].T)
    image = sky_radiance(light, world).reshape(height, 2 * height, 3).astype(np.float32)
    return EnvironmentLight(image, to_world, source="sky")


def sun_light(light: SunSky) -> DirectionalLight:
    """The sun as a directional light with the width of its disk."""
    x = power(_elevation_rad(light) / (0.5 * math.pi), 1.0 / 3.0)
    of_height = _between(_tables()["sun_irradiance"], light.turbidity - 1.0)
    irradiance = light.scale * np.maximum(_between(of_height, x * (len(of_height) - 1)), 0.0)
    away = -np.array(light.sun_direction) / norm(light.sun_direction)
    return DirectionalLight((away[0], away[1], away[2]), (irradiance[0], irradiance[1], irradiance[2]), SUN_DEG)


def facing_up(up: tuple[float, float, float], axis: int = 1) -> Matrix:
    """A rotation that takes an axis (by default y) to ``up``; the identity if they coincide."""
    unit = np.array(up) / norm(up)
    matrix = np.eye(4)
    if np.array_equal(unit, np.eye(3)[axis]):
        return matrix
    first = np.eye(3)[int(np.abs(unit).argmin())]
    first = first - product(first, unit) * unit
    first /= norm(first)
    matrix[:3, axis] = unit
    matrix[:3, (axis + 1) % 3] = first
    matrix[:3, (axis + 2) % 3] = np.cross(unit, first)
    return matrix


def sun_at(
    date: tuple[int, int, int], hour: float, latitude_deg: float, longitude_deg: float, timezone: float
) -> tuple[float, float, float]:
    """Position of the sun, without atmospheric refraction.

    Args:
        date: year, month, day.
        hour: local time, hours with fractions.
        latitude_deg, longitude_deg: north and east are positive.
        timezone: offset from Greenwich, hours.

    Returns:
        Unit direction towards the sun: east, north, up.

    Raises:
        ValueError, OverflowError: the date or the time is invalid.
    """
    from astral import Observer
    from astral.sun import azimuth, elevation

    time = datetime(*date, tzinfo=UTC) + timedelta(hours=hour - timezone)
    place = Observer(latitude_deg, longitude_deg)
    around, height = (math.radians(f(place, time)) for f in (azimuth, partial(elevation, with_refraction=False)))
    return (
        cos(height) * sin(around),
        cos(height) * cos(around),
        sin(height),
    )
