"""Analytic daylight against Mitsuba's, and the picture of a sky against its formula."""

from __future__ import annotations

import math
from itertools import product

import numpy as np
import pytest

from scenes.canonical import SunSky
from scenes.daylight import facing_up, sky_map, sky_radiance, sun_at, sun_light


def unit(*parts: float) -> np.ndarray:
    return np.array(parts) / np.linalg.norm(parts)


def mitsuba():
    found = pytest.importorskip("mitsuba")
    found.set_variant("scalar_rgb")
    return found


def peer_radiance(mi, emitter, directions: np.ndarray) -> np.ndarray:
    found = []
    for direction in directions:
        surface = mi.SurfaceInteraction3f()
        surface.wi = -mi.Vector3f(direction.tolist())
        found.append(np.array(emitter.eval(surface)).ravel())
    return np.array(found)


@pytest.mark.parametrize(
    ("turbidity", "sun", "up", "albedo"),
    [
        (3.0, (1.0, 0.0, 1.0), (0.0, 0.0, 1.0), 0.15),
        (1.0, (0.0, 0.2, 1.0), (0.0, 0.0, 1.0), 0.0),
        (9.6, (0.5, 0.3, 0.05), (0.0, 0.0, 1.0), 0.8),
        (4.2, (0.3, 0.8, 0.2), (0.0, 1.0, 0.0), 0.3),
    ],
)
def test_the_sky_is_that_of_mitsuba(turbidity: float, sun, up, albedo: float) -> None:
    mi = mitsuba()
    light = SunSky(tuple(unit(*sun)), turbidity, 2.0, "sky", up, albedo)
    emitter = mi.load_dict(
        {
            "type": "sunsky",
            "turbidity": turbidity,
            "sun_direction": list(light.sun_direction),
            "to_world": mi.ScalarTransform4f(facing_up(up, 2)),
            "sun_scale": 0.0,
            "sky_scale": 2.0,
            "albedo": {"type": "rgb", "value": albedo},
        }
    )
    directions = np.random.default_rng(5).normal(size=(64, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    ours, other = sky_radiance(light, directions), peer_radiance(mi, emitter, directions)
    assert (ours.max(axis=1) > 0.0).sum() > 10
    np.testing.assert_allclose(ours, other, rtol=1e-4, atol=1e-6)


@pytest.mark.parametrize(("turbidity", "height_deg"), list(product((1.0, 3.0, 6.5), (5.0, 20.0, 45.0, 90.0))))
def test_the_sun_is_that_of_mitsuba(turbidity: float, height_deg: float) -> None:
    """Its radiance averaged over the disk, times the disk's solid angle."""
    mi = mitsuba()
    height = math.radians(height_deg)
    sun = np.array([math.cos(height), 0.0, math.sin(height)])
    emitter = mi.load_dict({"type": "sunsky", "turbidity": turbidity, "sun_direction": sun.tolist(), "sky_scale": 0.0})
    half = math.radians(0.5358) / 2.0
    edge = half * np.sqrt((np.arange(16) + 0.5) / 16)
    around = np.arange(8) * math.pi / 4
    across, above = np.array([0.0, 1.0, 0.0]), np.cross(sun, [0.0, 1.0, 0.0])
    offsets = np.cos(around)[:, None] * across + np.sin(around)[:, None] * above
    directions = (np.cos(edge)[:, None, None] * sun + np.sin(edge)[:, None, None] * offsets).reshape(-1, 3)
    expected = peer_radiance(mi, emitter, directions).mean(axis=0) * 2.0 * math.pi * (1.0 - math.cos(half))
    found = np.array(sun_light(SunSky(tuple(sun), turbidity, part="sun")).irradiance)
    np.testing.assert_allclose(found, np.maximum(expected, 0.0), rtol=0.03, atol=2e-3)


def test_where_the_sun_stands() -> None:
    """Mitsuba's frame has x to the south and y to the west."""
    mi = mitsuba()
    for date, hour in (((2010, 7, 10), 15.0), ((2010, 1, 5), 9.5), ((2012, 3, 20), 12.0), ((2005, 11, 2), 16.2)):
        given = dict(zip(("year", "month", "day", "hour"), (*date, hour), strict=True))
        other = np.array(mi.traverse(mi.load_dict({"type": "sunsky", **given}))["sun_direction"]).ravel()
        east, north, up = sun_at(date, hour, 35.6894, 139.6917, 9.0)
        np.testing.assert_allclose([-north, -east, up], other, atol=1e-3)


def test_noon_at_the_equator_on_the_equinox_is_overhead() -> None:
    assert sun_at((2010, 3, 20), 12.12, 0.0, 0.0, 0.0)[2] > math.cos(math.radians(1.0))


@pytest.mark.parametrize("up", [(0.0, 1.0, 0.0), (0.0, 0.0, 1.0), (0.6, 0.0, 0.8)])
def test_a_map_is_the_sky(up) -> None:
    """Looked up in the direction that the canonical scene gives each texel."""
    light = SunSky(tuple(unit(0.3, 0.5, 0.7)), 4.0, 1.0, "sky", up, 0.2)
    made = sky_map(light, 32)
    rows, columns = np.array([[3, 10, 20], [5, 40, 63]])
    polar, around = (rows + 0.5) * math.pi / 32, (columns + 0.5) * math.pi / 32
    local = np.stack([np.sin(around) * np.sin(polar), np.cos(polar), -np.cos(around) * np.sin(polar)], axis=1)
    world = local @ made.to_world[:3, :3].T
    np.testing.assert_allclose(made.image[rows, columns], sky_radiance(light, world), rtol=1e-5)
    assert (made.image[20] == 0.0).all() and (made.image[3] > 0.0).all()  # black below the horizon


def test_extremes_stay_finite() -> None:
    """A sun below the horizon, and air beyond the data."""
    for turbidity, height in product((0.0, 1.0, 10.0, 50.0), (-1.0, 0.0, 1e-9, 1.0)):
        light = SunSky((math.sqrt(max(0.0, 1.0 - height**2)), 0.0, height), turbidity)
        image = sky_map(light, 16).image
        assert np.isfinite(image).all() and (image >= 0.0).all()
        assert np.isfinite(sun_light(light).irradiance).all() and min(sun_light(light).irradiance) >= 0.0
