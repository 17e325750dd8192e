"""Pictures of tilings and fields put the right colour at the right place."""

from __future__ import annotations

import io
from fractions import Fraction

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image

from analysis.page.pictures import (
    AGE_MAP,
    NEVER,
    ColorScale,
    age_map,
    colour,
    density_map,
    enlarge,
    number,
    palette,
    picture_bytes,
    round_number,
    scale_strip,
    stored,
    tile_map,
    tiling_map,
)
from tests.analysis.builders import random_tiling, tiling
from tsar.morton import deinterleave, morton_to_raster
from tsar.types import Tiling

RATE, DENSITY = "inferno", "viridis"
OUTLINE = [90, 130, 150]


def corner(level: int, index: int) -> tuple[Fraction, Fraction]:
    """Upper left corner of a tile on the unit square."""
    x, y = (int(v) for v in deinterleave(torch.tensor(index)))
    return Fraction(x, 2**level), Fraction(y, 2**level)


def painted(tiles: Tiling, side: int) -> np.ndarray:
    """Slow: paints tile after tile the pixels whose centres lie in it, in exact arithmetic."""
    shown = np.full((side, side), -1)
    for tile, (level, index) in enumerate(zip(tiles.level.tolist(), tiles.index.tolist(), strict=True)):
        left, top = corner(level, index)
        for row in range(side):
            for column in range(side):
                x, y = Fraction(2 * column + 1, 2 * side) - left, Fraction(2 * row + 1, 2 * side) - top
                if 0 <= x < Fraction(1, 2**level) and 0 <= y < Fraction(1, 2**level):
                    assert shown[row, column] == -1
                    shown[row, column] = tile
    return shown


@given(st.integers(0, 10_000), st.integers(1, 4), st.sampled_from([1, 2, 3, 8, 12, 15, 16]))
def test_tile_map_agrees_with_painting(seed: int, level_max: int, side: int) -> None:
    """Also where a pixel's centre lies on the edge of a tile, and where tiles are finer than pixels."""
    tiles = random_tiling(seed, level_max)
    assert np.array_equal(tile_map(tiles, side), painted(tiles, side))


def test_colour_scale_is_logarithmic_and_clipped() -> None:
    found = colour(np.array([0.01, 0.25, 4.0, 64.0, 1e9]), (0.25, 64.0), RATE)
    assert np.array_equal(found, palette(RATE)[[0, 0, 128, 255, 255]])


def test_bytes_hold_values_to_two_percent_and_say_what_lacks() -> None:
    """Each byte has the colour of its value; 0 is what is not finite."""
    scale = ColorScale.of((0.01, 100.0), "volts", RATE)
    values = np.array([0.01, 0.3, 7.0, 100.0, 1e9, 0.0, np.inf])
    places = stored(values, scale.bounds)
    assert places.tolist()[::3] == [1, 255, 0] and places[4] == 255 and places[5] == 1
    read = 0.01 * 1e4 ** ((places[:4].astype(float) - 1) / 254)
    assert np.abs(np.log(read / values[:4])).max() < 0.02
    assert scale.colours()[0].tolist() == list(NEVER)
    assert np.abs(scale.colours()[places[:4]].astype(int) - colour(values[:4], scale.bounds, RATE)).max() <= 4


def test_a_fitted_scale_spans_the_data_between_round_numbers() -> None:
    scale = ColorScale.of((1.0, 1e5), "ms", AGE_MAP)
    ages = np.exp(np.random.default_rng(0).uniform(np.log(23.0), np.log(710.0), 100_000))
    counts = np.bincount(stored(ages, scale.bounds), minlength=256)
    fitted = scale.fitted(counts)
    assert fitted.shown == (20.0, 1000.0) and fitted.bounds == scale.bounds
    assert scale.fitted(np.bincount([0, 0], minlength=256)) == scale, "nothing is known"
    ramp = fitted.colours()
    assert (ramp[1] == palette(AGE_MAP)[0]).all() and (ramp[255] == palette(AGE_MAP)[255]).all()


@pytest.mark.parametrize(("value", "low", "high"), [(3.0, 2.0, 5.0), (10.0, 10.0, 10.0), (0.07, 0.05, 0.1)])
def test_round_number(value: float, low: float, high: float) -> None:
    found = round_number(value, up=False), round_number(value, up=True)
    assert found == pytest.approx((low, high))


def quadrant_field(values: tuple[float, float, float, float], side: int = 8) -> torch.Tensor:
    """A field in Morton order: upper left, upper right, lower left, lower right."""
    return torch.tensor(values, dtype=torch.float64).repeat_interleave(side * side // 4)


def test_tiling_image_has_colours_where_the_tiles_are() -> None:
    bounds, tiles = (1 / 64, 1.0), tiling(*((1, i) for i in range(4)))
    image = tiling_map(tiles, quadrant_field((1 / 64, 1.0, 0.125, 1 / 64)), 32, bounds).pixels()
    low, middle, high = palette(RATE)[[0, 128, 255]]
    assert image.shape == (32, 32, 3) and image.dtype == np.uint8
    for rows, columns, expected in (
        (slice(0, 16), slice(0, 16), low),
        (slice(0, 16), slice(17, 32), high),
        (slice(17, 32), slice(0, 16), middle),
        (slice(17, 32), slice(17, 32), low),
    ):
        assert (image[rows, columns] == expected).all(), (rows, columns)
    assert (image[16, :] == OUTLINE).all() and (image[:, 16] == OUTLINE).all()


@given(st.integers(0, 10_000), st.integers(1, 4))
def test_tiling_image_shows_the_mean_over_each_tile(seed: int, field_level: int) -> None:
    """Tiles are coarser or finer than the elements of the field, which may be as small as two by two."""
    side, tiles = 32, random_tiling(seed)
    field = torch.from_numpy(np.exp(np.random.default_rng(seed).uniform(np.log(1 / 64), 0.0, 4**field_level)))
    image, shown = tiling_map(tiles, field, side), tile_map(tiles, side)
    elements = field.numpy()[np.argsort(morton_to_raster(2**field_level).numpy())]
    raster = elements.reshape(2**field_level, -1).repeat(side >> field_level, 0).repeat(side >> field_level, 1)
    mean = np.bincount(shown.ravel(), raster.ravel()) / np.bincount(shown.ravel())
    inside = image.places > 0
    expected = [stored(mean * factor, (1 / 64, 1.0))[shown] for factor in (1 - 1e-9, 1 + 1e-9)]
    assert ((image.places == expected[0]) | (image.places == expected[1]))[inside].all()
    edge = np.zeros_like(inside)
    edge[:, 1:] |= shown[:, 1:] != shown[:, :-1]
    edge[1:] |= shown[1:] != shown[:-1]
    assert np.array_equal(edge, ~inside)


@given(st.integers(0, 7), st.integers(0, 7), st.sampled_from([8, 24]))
def test_density_image_is_in_raster_order(x: int, y: int, side: int) -> None:
    """One element stands out: ``x`` takes the even bits of its Morton index, columns run to the right, rows down."""
    index = sum(((x >> bit & 1) << 2 * bit) + ((y >> bit & 1) << 2 * bit + 1) for bit in range(3))
    field = torch.full((64,), 0.25)
    field[index] = 64.0
    image, size = enlarge(density_map(field, (0.25, 64.0), "").pixels(), side), side // 8
    expected = np.broadcast_to(palette(DENSITY)[0], (side, side, 3)).copy()
    expected[y * size : (y + 1) * size, x * size : (x + 1) * size] = palette(DENSITY)[255]
    assert np.array_equal(image, expected)


def test_age_image_is_in_raster_order_and_says_where_nothing_was_sampled() -> None:
    """At 2 s, samples of 1.99, 1.9 and 1 s are 10, 100 and 1000 ms old; what lies beyond the scale is at its end."""
    newest_s = torch.tensor([[1.99, 1.9, 1.0], [-torch.inf, -50.0, 2.0]], dtype=torch.float64)
    image = age_map(newest_s, 2.0, (0.01, 1.0)).pixels()
    low, middle, high = palette(AGE_MAP)[[0, 128, 255]].tolist()
    assert image.tolist() == [[low, middle, high], [list(NEVER), high, low]]
    assert not any(list(NEVER) == ink for ink in palette(AGE_MAP).tolist())


def test_pictures_are_exact_or_near() -> None:
    """Lossy pictures: colours stay in their places, also beside a sharp edge of colour."""
    ramp = np.linspace(0, 255, 64).astype(np.uint8)
    pixels = np.stack((*np.meshgrid(ramp, ramp), np.full((64, 64), 90, np.uint8)), -1)
    pixels[20:30, 20:40] = (255, 0, 0)
    exact, near = (picture_bytes(pixels, one) for one in (True, False))
    assert np.array_equal(np.asarray(Image.open(io.BytesIO(exact))), pixels)
    apart = np.abs(np.asarray(Image.open(io.BytesIO(near))).astype(int) - pixels)
    assert 0.0 < apart.mean() < 1.5 and np.percentile(apart, 99) < 8
    grey = pixels[..., 0]
    assert np.array_equal(np.asarray(Image.open(io.BytesIO(picture_bytes(grey, True))))[..., 0], grey)


def test_enlarge() -> None:
    image = np.random.default_rng(0).integers(0, 256, (4, 4, 3), dtype=np.uint8)
    assert np.array_equal(enlarge(image, 4), image)
    assert np.array_equal(enlarge(image, 12), np.kron(image, np.ones((3, 3, 1), np.uint8)))
    means = image.astype(float).reshape(2, 2, 2, 2, 3).mean((1, 3))
    assert np.abs(enlarge(image, 2) - means).max() <= 1.0
    assert enlarge(image, 7).shape == (7, 7, 3)


@pytest.mark.parametrize("width", [96, 250])
def test_a_scale_is_a_strip_of_its_own(width: int) -> None:
    scale = ColorScale.of((1 / 64, 1.0), "refreshes per cycle", RATE)
    shown = scale_strip(width, 24, scale, (235, 235, 235), (24, 24, 24))
    assert shown.shape == (24, width, 3) and (shown != 24).any()
    margin = max(4, width // 40)
    bar = shown[3, margin:-margin].astype(int)
    nearest = np.abs(bar[:, None] - palette(RATE)[None]).sum(-1).argmin(1)
    assert (nearest[0], nearest[-1]) == (0, 255) and (np.diff(nearest) >= 0).all(), "the least on the left"


@pytest.mark.parametrize(
    ("value", "text"),
    [(1 / 64, "1/64"), (1 / 3, "1/3"), (0.3, "0.3"), (1.0, "1"), (64.0, "64"), (0.015, "0.015"), (1000.0, "1000")],
)
def test_number(value: float, text: str) -> None:
    assert number(value) == text
