"""Polygons as triangles: areas add up, and triangles of concave ones lie within them."""

from __future__ import annotations

import math

import numpy as np
import pytest

from scenes.formats.geometry.polygons import Triangles, triangles_of

L_SHAPE = [(0, 0), (2, 0), (2, 1), (1, 1), (1, 2), (0, 2)]
DART = [(0, 0), (2, 1), (0, 2), (0.5, 1)]
WITH_HOLE = [(0, 0), (4, 0), (4, 4), (0, 4), (0, 0), (1, 1), (1, 3), (3, 3), (3, 1), (1, 1)]  # joined at (0, 0)
COMB = [(0, 0), (7, 0), *((x, 3 if x % 2 else 0.5) for x in np.arange(7, -1, -1).tolist())]


def star(corners: int) -> list[tuple[float, float]]:
    angles = np.arange(corners) * 2.0 * math.pi / corners
    away = np.where(np.arange(corners) % 2, 1.0, 0.2)
    return list(zip((away * np.cos(angles)).tolist(), (away * np.sin(angles)).tolist(), strict=True))


def area_of(flat: np.ndarray) -> float:
    x, y = flat.T
    return 0.5 * float(x @ np.roll(y, -1) - y @ np.roll(x, -1))


def cut(points: np.ndarray, polygons: np.ndarray, **options: int) -> Triangles:
    """Triangles of polygons of equally many corners."""
    return triangles_of(points, polygons.reshape(-1), np.full(len(polygons), polygons.shape[1]), **options)


@pytest.mark.parametrize("shape", [L_SHAPE, DART, WITH_HOLE, COMB, star(10), star(40), star(20_000)])
@pytest.mark.parametrize("first", [0, 1, 3])
@pytest.mark.parametrize("reverse", [False, True])
def test_triangles_of_a_concave_polygon_cover_it_once(shape: list, first: int, reverse: bool) -> None:
    flat = np.roll(np.array(shape, np.float64), -first, axis=0)[:: -1 if reverse else 1]
    turn = np.array([[0.6, 0.0, 0.8], [0.48, 0.8, -0.36]])  # two unit vectors at right angles
    found = cut(flat @ turn + (5.0, 6.0, 7.0), np.arange(len(flat))[None])
    assert found.uncovered == 0
    parts = np.array([area_of(flat[corners]) for corners in found.corners])
    whole = area_of(flat)
    # no triangle is turned over, and none lies outside: their areas would add up to more
    assert (parts * np.sign(whole) >= -1e-12).all() and parts.sum() == pytest.approx(whole)


def test_convex_polygons_are_fans() -> None:
    points = np.array([(0, 0, 0), (1, 0, 0), (2, 0, 0), (2, 2, 0), (0, 2, 0)], np.float64)
    found = cut(points, np.array([[0, 1, 2, 3, 4], [4, 0, 1, 2, 3]]))
    fan = np.array([[0, 1, 2], [0, 2, 3], [0, 3, 4]])
    np.testing.assert_array_equal(found.corners, np.concatenate([fan, fan + 5]))
    np.testing.assert_array_equal(found.polygon, [0, 0, 0, 1, 1, 1])


def test_polygons_that_cross_themselves_and_those_without_area_end() -> None:
    crossing = np.array([(0, 0, 0), (1, 1, 0), (1, 0, 0), (0, 1, 0), (0.5, 3, 0)], np.float64)
    for points in (crossing, np.zeros((5, 3)), np.arange(15.0).reshape(5, 3)):
        corners = cut(points, np.arange(5)[None]).corners
        assert 0 < len(corners) <= 3 and ((corners >= 0) & (corners < 5)).all()


def test_what_would_take_too_long_is_counted() -> None:
    flat = np.array(star(40))
    points = np.concatenate([flat, np.zeros((40, 1))], axis=1)
    found = cut(points, np.tile(np.arange(40), (3, 1)), work=2 * 40**2)
    last = found.corners[found.polygon == 2]
    assert found.uncovered == 1 and (last[:, 0] == 80).all() and not (found.corners[:38, 0] == 0).all()


def test_polygons_of_all_sizes_keep_their_order() -> None:
    points = np.array([(0, 0, 0), (2, 1, 0), (0, 2, 0), (0.5, 1, 0), (9, 9, 0)], np.float64)
    found = triangles_of(points, np.array([0, 1, 2, 0, 1, 2, 3, 1, 2, 4]), np.array([3, 4, 3]))
    np.testing.assert_array_equal(found.polygon, [0, 1, 1, 2])
    np.testing.assert_array_equal(found.corners[[0, 3]], [[0, 1, 2], [7, 8, 9]])
    assert found.uncovered == 0 and {frozenset(row) for row in found.corners[1:3].tolist()} == {
        frozenset((3, 4, 6)),
        frozenset((4, 5, 6)),
    }
    assert not len(triangles_of(points, np.zeros(0, np.int64), np.zeros(0, np.int64)).corners)
