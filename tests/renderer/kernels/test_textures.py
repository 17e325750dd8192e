"""Texture lookup against NumPy."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from renderer.tables.materials import mip_levels
from scenes.canonical import (
    CheckerboardTexture,
    ConstantTexture,
    ImageTexture,
    Instance,
    PerspectiveCamera,
    Phong,
    Rectangle,
    Scene,
)
from tests.renderer.builders import batch, colors, grid, place

RNG = np.random.default_rng(11)
PICTURE = RNG.random((5, 7, 3), dtype=np.float32)


def _card(texture, distance: float = 1.0, **rest) -> Scene:
    """A card that fills the view exactly: image position (x, y) has uv (x, 1 - y)."""
    camera = PerspectiveCamera(place((0, 0, distance)), 2 * np.degrees(np.arctan(1 / distance)))
    return Scene(camera, (Instance(Rectangle(), Phong(texture)),), ambient=(1.0, 1.0, 1.0), **rest)


def _lookup(picture, uv, scale, offset, wrap, nearest):
    height, width = picture.shape[:2]
    uv = uv * scale + offset

    def texel(x, y):
        outside = (x < 0) | (x >= width) | (y < 0) | (y >= height)
        if wrap == "repeat":
            return picture[y % height, x % width]
        color = picture[np.clip(y, 0, height - 1), np.clip(x, 0, width - 1)]
        return np.where(outside[:, None], 0.0, color) if wrap == "black" else color

    x, y = uv[:, 0] * width, (1 - uv[:, 1]) * height
    if nearest:
        return texel(np.floor(x).astype(int), np.floor(y).astype(int))
    x0, y0 = np.floor(x - 0.5).astype(int), np.floor(y - 0.5).astype(int)
    fx, fy = (x - 0.5 - x0)[:, None], (y - 0.5 - y0)[:, None]
    upper = texel(x0, y0) * (1 - fx) + texel(x0 + 1, y0) * fx
    lower = texel(x0, y0 + 1) * (1 - fx) + texel(x0 + 1, y0 + 1) * fx
    return upper * (1 - fy) + lower * fy


@pytest.mark.parametrize("wrap", ["repeat", "clamp", "black"])
@pytest.mark.parametrize("kind", ["bilinear", "nearest"])
def test_lookup_agrees_with_numpy(wrap: str, kind: str) -> None:
    scale, offset = np.array([2.7, -1.9]), np.array([-0.83, 1.31])
    texture = ImageTexture(PICTURE, tuple(scale), tuple(offset), wrap, kind)
    position = RNG.random((400, 2)).astype(np.float32).astype(np.float64)
    uv = np.stack([position[:, 0], 1 - position[:, 1]], -1)
    expected = _lookup(PICTURE, uv, scale, offset, wrap, kind == "nearest")
    error = np.abs(colors(_card(texture), position) - expected).max(1)
    assert (error > 1e-4).sum() <= (3 if kind == "nearest" else 0)  # a nearest texel's edge may fall on either side


def test_row_zero_is_at_the_top() -> None:
    picture = np.zeros((2, 2, 3), np.float32)
    picture[0, 1] = (1, 2, 3)
    got = colors(_card(ImageTexture(picture, filter="nearest")), np.array([[0.75, 0.25], [0.75, 0.75], [0.25, 0.25]]))
    np.testing.assert_allclose(got, [(1, 2, 3), (0, 0, 0), (0, 0, 0)])


def test_mip_levels_are_area_averages_of_the_whole() -> None:
    picture = RNG.random((16, 64, 3), dtype=np.float32)
    levels = mip_levels(picture)
    assert [level.shape[:2] for level in levels] == [(16, 64), (8, 32), (4, 16), (2, 8), (1, 4), (1, 2), (1, 1)]
    np.testing.assert_allclose(levels[2], picture.reshape(4, 4, 16, 4, 3).mean((1, 3)), atol=1e-6)
    np.testing.assert_allclose(levels[-1][0, 0], picture.mean((0, 1)), atol=1e-6)


@pytest.mark.parametrize(("footprint_px", "level"), [(256, 0), (64, 0), (32, 1), (16, 2), (8, 3), (1, 6), (0.01, 6)])
def test_footprint_chooses_the_level(footprint_px: float, level: int) -> None:
    """A card of 64 texels under ``footprint_px`` pixels has 64 / footprint_px texels to a pixel."""
    stack = mip_levels(RNG.random((64, 64, 3), dtype=np.float32))
    position = np.array([[0.5, 0.5], [0.52, 0.48]])
    scene = _card(ImageTexture(stack[0]), distance=20.0)
    got = colors(scene, position, footprint_resolution_px=footprint_px)
    uv = np.stack([position[:, 0], 1 - position[:, 1]], -1)
    np.testing.assert_allclose(got, _lookup(stack[level], uv, 1.0, 0.0, "repeat", False), atol=2e-4)


def test_levels_blend() -> None:
    """Between two levels the colour lies between theirs, by the logarithm of the footprint, and nothing jumps."""
    stack = mip_levels(RNG.random((64, 64, 3), dtype=np.float32))
    position = np.array([[0.37, 0.61]])
    uv = np.stack([position[:, 0], 1 - position[:, 1]], -1)
    detail = np.linspace(-0.5, 6.5, 141)
    got = []
    for level in detail:
        scene = _card(ImageTexture(stack[0]), distance=1000.0)
        got.append(colors(scene, position, footprint_resolution_px=64.0 / 2.0**level)[0])
        low = int(np.clip(np.floor(level), 0, 6))
        near, far = (_lookup(stack[min(i, 6)], uv, 1.0, 0.0, "repeat", False)[0] for i in (low, low + 1))
        share = np.clip(level - low, 0.0, 1.0) if 0 <= level < 6 else 0.0
        np.testing.assert_allclose(got[-1], near * (1 - share) + far * share, atol=2e-3)
    assert np.abs(np.diff(got, axis=0)).max() < 0.06


def test_footprint_grows_with_distance_and_slant_and_shrinks_with_texture_scale() -> None:
    stack = mip_levels(RNG.random((64, 64, 3), dtype=np.float32))
    position = np.array([[0.5, 0.5]])

    def level_of(scene: Scene) -> int:
        got = colors(scene, position, footprint_resolution_px=64)[0]
        centres = [_lookup(level, np.array([[0.5, 0.5]]), 1.0, 0.0, "repeat", False)[0] for level in stack]
        return int(np.argmin([np.abs(got - c).max() for c in centres]))

    def card(distance=1.0, slant=0.0, scale=1.0) -> Scene:
        card = Instance(
            Rectangle(), Phong(ImageTexture(stack[0])), place((0, 0, -distance), (slant, 0, 0), (scale,) * 3)
        )
        return Scene(PerspectiveCamera(fov_deg=90.0), (card,), ambient=(1, 1, 1))

    assert [level_of(card(distance)) for distance in (1.0, 2.0, 4.0, 8.0)] == [0, 1, 2, 3]
    assert [level_of(card(1.0, np.arccos(c))) for c in (1.0, 0.5, 0.25)] == [0, 1, 2]
    assert [level_of(card(8.0, scale=scale)) for scale in (1.0, 2.0, 4.0)] == [3, 2, 1]


def test_framelet_level_does_not_change_sharpness(driving) -> None:
    base = batch(grid(8))
    coarse, fine = (replace(base, level=torch.full_like(base.level, level)) for level in (0, 6))
    assert torch.equal(driving.trace(coarse).color, driving.trace(fine).color)


def test_checkerboard_alternates_and_nests() -> None:
    red, green, blue = (ConstantTexture(tuple(np.eye(3)[i])) for i in range(3))
    inner = CheckerboardTexture(green, blue, (4.0, 4.0))
    scene = _card(CheckerboardTexture(red, inner, (2.0, 2.0)))
    position = grid(16)
    uv = np.stack([position[:, 0], 1 - position[:, 1]], -1)
    outer, nested = (np.floor(uv * s).sum(1).astype(int) % 2 for s in (2, 4))
    expected = np.eye(3)[np.where(outer == 0, 0, 1 + nested)]
    np.testing.assert_allclose(colors(scene, position), expected)


def test_far_repeats_of_a_large_plane_keep_their_texels() -> None:
    texture = ImageTexture(PICTURE, (1.0, 1.0), (1000.0, -2000.0), filter="nearest")
    position = grid(9)
    plain = colors(_card(ImageTexture(PICTURE, filter="nearest")), position)
    assert (np.abs(colors(_card(texture), position) - plain).max(1) > 1e-6).sum() <= 9
