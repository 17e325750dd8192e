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
    age_image,
    colour,
    density_image,
    enlarge,
    number,
    palette,
    tile_map,
    tiling_image,
    webp_bytes,
    with_scale,
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


def quadrant_field(values: tuple[float, float, float, float], side: int = 8) -> torch.Tensor:
    """A field in Morton order: upper left, upper right, lower left, lower right."""
    return torch.tensor(values, dtype=torch.float64).repeat_interleave(side * side // 4)


def test_tiling_image_has_colours_where_the_tiles_are() -> None:
    bounds, tiles = (1 / 64, 1.0), tiling(*((1, i) for i in range(4)))
    image = tiling_image(tiles, quadrant_field((1 / 64, 1.0, 0.125, 1 / 64)), 32, bounds)
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
    image, shown = tiling_image(tiles, field, side), tile_map(tiles, side)
    elements = field.numpy()[np.argsort(morton_to_raster(2**field_level).numpy())]
    raster = elements.reshape(2**field_level, -1).repeat(side >> field_level, 0).repeat(side >> field_level, 1)
    mean = np.bincount(shown.ravel(), raster.ravel()) / np.bincount(shown.ravel())
    inside = (image != OUTLINE).any(-1)
    expected = [colour(mean * factor, (1 / 64, 1.0), RATE)[shown] for factor in (1 - 1e-9, 1 + 1e-9)]
    assert ((image == expected[0]).all(-1) | (image == expected[1]).all(-1))[inside].all()
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
    image, size = density_image(field, (0.25, 64.0), side), side // 8
    expected = np.broadcast_to(palette(DENSITY)[0], (side, side, 3)).copy()
    expected[y * size : (y + 1) * size, x * size : (x + 1) * size] = palette(DENSITY)[255]
    assert np.array_equal(image, expected)


def test_age_image_is_in_raster_order_and_says_where_nothing_was_sampled() -> None:
    """At 2 s, samples of 1.99, 1.9 and 1 s are 10, 100 and 1000 ms old; what lies beyond the scale is at its end."""
    newest_s = torch.tensor([[1.99, 1.9, 1.0], [-torch.inf, -50.0, 2.0]], dtype=torch.float64)
    image = age_image(torch.cat((newest_s, newest_s[:1])), 2.0, (0.01, 1.0), 6)
    low, middle, high = palette(AGE_MAP)[[0, 128, 255]].tolist()
    assert image[::2, ::2].tolist() == [[low, middle, high], [list(NEVER), high, low], [low, middle, high]]
    assert np.array_equal(image, image[::2, ::2].repeat(2, 0).repeat(2, 1))
    assert not any(list(NEVER) == ink for ink in palette(AGE_MAP).tolist())


def test_webp_is_exact_or_near() -> None:
    ramp = np.linspace(0, 255, 64).astype(np.uint8)
    pixels = np.stack((*np.meshgrid(ramp, ramp), np.full((64, 64), 90, np.uint8)), -1)
    exact, near = (webp_bytes(pixels, lossless) for lossless in (True, False))
    assert np.array_equal(np.asarray(Image.open(io.BytesIO(exact))), pixels)
    assert 0.0 < np.abs(np.asarray(Image.open(io.BytesIO(near))).astype(int) - pixels).mean() < 3.0


def test_enlarge() -> None:
    image = np.random.default_rng(0).integers(0, 256, (4, 4, 3), dtype=np.uint8)
    assert np.array_equal(enlarge(image, 4), image)
    assert np.array_equal(enlarge(image, 12), np.kron(image, np.ones((3, 3, 1), np.uint8)))
    means = image.astype(float).reshape(2, 2, 2, 2, 3).mean((1, 3))
    assert np.abs(enlarge(image, 2) - means).max() <= 1.0
    assert enlarge(image, 7).shape == (7, 7, 3)


@pytest.mark.parametrize("side", [96, 250])
def test_a_scale_covers_the_lower_edge_only(side: int) -> None:
    image = np.full((side, side, 3), 200, np.uint8)
    shown = with_scale(image, (1 / 64, 1.0), "refreshes per cycle", RATE)
    assert shown.shape == image.shape and (image == 200).all(), "a copy"
    assert (shown[: side // 2] == 200).all() and not (shown[-(side // 10) :] == 200).all(-1).any()
    margin = max(4, side // 40)
    bar = shown[side - margin - 2, margin:-margin].astype(int)
    nearest = np.abs(bar[:, None] - palette(RATE)[None]).sum(-1).argmin(1)
    assert (nearest[0], nearest[-1]) == (0, 255) and (np.diff(nearest) >= 0).all(), "the least on the left"


@pytest.mark.parametrize(
    ("value", "text"),
    [(1 / 64, "1/64"), (1 / 3, "1/3"), (0.3, "0.3"), (1.0, "1"), (64.0, "64"), (0.015, "0.015"), (1000.0, "1000")],
)
def test_number(value: float, text: str) -> None:
    assert number(value) == text
