"""Random numbers of a group: uniform over the unit square, for any number of samples."""

from __future__ import annotations

import numpy as np
import pytest
import warp as wp

from renderer.compute.device import initialise
from renderer.kernels.randomness import draw_2d, group_draw

GROUPS = 4096


@wp.kernel
def drawn(count: wp.int32, points: wp.array2d(dtype=wp.vec2)):
    """All samples of many groups."""
    group, index = wp.tid()
    place = wp.vec2(wp.float32(group) * 0.001, 0.25)
    points[group, index] = draw_2d(group_draw(wp.uint32(7), place, wp.float64(0.5), index, count), 3)


def draws(count: int) -> np.ndarray:
    initialise()
    points = wp.zeros((GROUPS, count), dtype=wp.vec2, device="cpu")
    wp.launch(drawn, (GROUPS, count), [count], [points], device="cpu")
    return points.numpy()


@pytest.mark.parametrize("count", [1, 2, 3, 8, 16, 27, 32, 64, 125])
def test_every_part_of_the_square_is_drawn_as_often(count: int) -> None:
    points = draws(count)
    assert (points >= 0.0).all() and (points < 1.0).all()
    found = np.histogram2d(points[..., 0].ravel(), points[..., 1].ravel(), bins=8, range=((0, 1), (0, 1)))[0]
    expected = GROUPS * count / 64
    assert np.abs(found - expected).max() < 6.0 * np.sqrt(expected)


@pytest.mark.parametrize("count", [16, 64])
def test_the_samples_of_a_group_are_stratified_on_both_axes(count: int) -> None:
    points = draws(count)[:50]
    for axis in range(2):
        assert (np.sort(np.floor(points[..., axis] * count), axis=1) == np.arange(count)).all()
