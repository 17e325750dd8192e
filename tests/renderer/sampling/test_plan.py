"""Point sets, shifts, warps and plans."""

from __future__ import annotations

import warnings

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import kstest, norm, triang

from renderer.sampling import POINT_SETS
from renderer.sampling.blue_noise import FRAMES, SIDE_PX, mask
from renderer.sampling.plan import SamplePlan, blue_shift, box_warp, gaussian_warp, pixel_shift, triangle_warp
from renderer.sampling.point_sets import (
    BELOW_ONE,
    cell_counts,
    packing_distance,
    point_set,
    toroidal_distance,
)


@pytest.mark.parametrize("name", POINT_SETS)
@pytest.mark.parametrize("count", [1, 8, 27, 125])
def test_every_set_has_its_points_in_the_cube_and_repeats(name, count: int) -> None:
    points = point_set(name, count, seed=3)
    assert points.shape == (count, 3) and points.dtype == np.float64
    assert (points >= 0.0).all() and (points < 1.0).all()
    np.testing.assert_array_equal(points, point_set(name, count, seed=3))
    if name != "hammersley":
        assert (points != point_set(name, count, seed=4)).any()


@given(st.integers(1, 80))
@settings(max_examples=20, deadline=None)
def test_darts_keep_their_distance_round_the_torus(count: int) -> None:
    points = point_set("poisson", count, seed=count)
    apart = toroidal_distance(points[:, None], points[None])[~np.eye(count, dtype=bool)]
    assert apart.min(initial=1.0) > 0.6 * packing_distance(count)


def test_opposite_faces_of_the_torus_are_one() -> None:
    assert toroidal_distance(np.array([0.02, 0.5, 0.5]), np.array([0.98, 0.5, 0.5])) == pytest.approx(0.04)


@pytest.mark.parametrize("side", [1, 2, 5, 8])
def test_stratified_has_one_point_in_every_cell(side: int) -> None:
    cells = np.floor(point_set("stratified", side**3) * side).astype(int)
    assert len(np.unique(cells, axis=0)) == side**3


@pytest.mark.parametrize(("count", "near"), [(2, "1 or 8"), (26, "8 or 27"), (100, "64 or 125")])
def test_stratified_takes_cubes_only(count: int, near: str) -> None:
    with pytest.raises(ValueError, match=f"expected a cube for .* such as {near}, got {count}"):
        point_set("stratified", count)


@pytest.mark.parametrize("name", ["sobol", "owen"])
def test_nets_say_where_their_balance_is_lost(name: str) -> None:
    with pytest.warns(UserWarning, match=f"point set {name}: 100 points are not balanced, 64 or 128 would be"):
        point_set(name, 100)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for count in (1, 2, 64, 128):
            point_set(name, count)
        point_set("halton", 100)


def test_hammersley_is_its_formula() -> None:
    """``(i / n, Φ2(i), Φ3(i))``: 6 of 8 is 011 reversed in binary, and 20 reversed in ternary."""
    np.testing.assert_allclose(point_set("hammersley", 8)[6], [6 / 8, 3 / 8, 2 / 9])


@pytest.mark.parametrize("seed", range(5))
def test_owen_scrambling_keeps_every_elementary_interval(seed: int) -> None:
    """Of 64 points one lies in each of 64 boxes of u and v, however the 64 are cut into columns and rows."""
    points = point_set("owen", 64, seed)
    for columns in (1, 2, 4, 8, 16, 32, 64):
        boxes = np.floor(points[:, :2] * (columns, 64 // columns)).astype(int)
        assert len(np.unique(boxes, axis=0)) == 64
    assert len(np.unique(np.floor(points[:, 2] * 64))) == 64


def test_owen_scrambling_is_even_over_its_seeds() -> None:
    """Every point alone is uniform, and a smooth product is met better than with digits scrambled alike."""
    many = np.stack([point_set("owen", 16, seed) for seed in range(400)])
    for index in (0, 1, 7):
        assert min(kstest(axis, "uniform").pvalue for axis in many[:, index].T) > 1e-3
    assert np.abs(np.corrcoef(many[:, 0].T) - np.eye(3)).max() < 0.2


@pytest.mark.parametrize(
    ("count", "ratio", "sides"),
    [(64, 1.0, (4, 4, 4)), (64, 8.0, (2, 2, 16)), (64, 0.125, (8, 8, 1)), (216, 8.0, (3, 3, 24)),
     (512, 0.125, (16, 16, 2)), (512, 8.0, (4, 4, 32)), (48, 1.0, (4, 4, 3)),
     (48, 8.0, (2, 2, 12)), (1, 8.0, (1, 1, 1))],
)  # fmt: skip
def test_cells_are_as_many_in_time_as_the_ratio_wants(count: int, ratio: float, sides: tuple[int, ...]) -> None:
    assert cell_counts(count, ratio) == sides


@given(st.integers(1, 300), st.sampled_from(["cells-even", "cells-space", "cells-time"]))
@settings(max_examples=30, deadline=None)
def test_cells_have_one_point_each(count: int, name: str) -> None:
    sides = cell_counts(count, {"cells-even": 1.0, "cells-space": 0.125, "cells-time": 8.0}[name])
    assert np.prod(sides) == count
    assert len(np.unique(np.floor(point_set(name, count) * sides), axis=0)) == count


def test_the_mask_is_blue_in_space_and_in_time() -> None:
    """Of white noise every band of frequencies holds as much; of the mask the low ones hold next to nothing."""
    values = mask()
    assert values.shape == (FRAMES, SIDE_PX, SIDE_PX)
    np.testing.assert_allclose(np.sort(values.ravel()), (np.arange(values.size) + 0.5) / values.size)
    power = np.mean([np.abs(np.fft.fft2(one - one.mean())) ** 2 for one in values], axis=0) / SIDE_PX**2 / values.var()
    frequency = np.hypot(*np.meshgrid(np.fft.fftfreq(SIDE_PX), np.fft.fftfreq(SIDE_PX)))
    assert power[(frequency > 0.0) & (frequency < 0.1)].mean() < 0.01
    assert power[frequency > 0.25].mean() > 1.0
    in_time = (np.abs(np.fft.fft(values - values.mean(axis=0), axis=0)) ** 2).mean(axis=(1, 2)) / FRAMES / values.var()
    assert in_time[1] < 0.05 and in_time[2] < 0.2 and in_time[5:8].min() > 1.0


def test_blue_shifts_leave_errors_that_differ_between_neighbours() -> None:
    """Same mean squared error of a pixel as white shifts; after a blur of the picture, less."""
    column, row = (part.ravel() for part in np.meshgrid(np.arange(SIDE_PX), np.arange(SIDE_PX)))
    points = point_set("hammersley", 4)
    left = {}
    for name, shift in (("white", pixel_shift(3, column, row)), ("blue", blue_shift(3, column, row))):
        moved = (points[None] + shift[:, None]) % 1.0
        error = (moved[..., 2] < 0.3).mean(axis=1) - 0.3
        blurred = np.fft.fft2(error.reshape(SIDE_PX, SIDE_PX))[:6, :6]
        left[name] = (error**2).mean(), (np.abs(blurred[1:, 1:]) ** 2).mean()
    assert left["blue"][0] == pytest.approx(left["white"][0], rel=0.2)
    assert left["blue"][1] < 0.2 * left["white"][1]
    np.testing.assert_array_equal(blue_shift(3, column[[7]], row[[7]], 2), blue_shift(3, column, row, 2)[[7]])
    assert (blue_shift(3, column, row, 1) != blue_shift(4, column, row, 1)).mean() > 0.99


def test_what_no_set_can_be() -> None:
    for name, count, message in (("grid", 4, "one of"), ("halton", 0, "1 to"), ("poisson", 10**6, "1 to 4096")):
        with pytest.raises(ValueError, match=message):
            point_set(name, count)
    for options in ({"space_filter": "sinc"}, {"sigma_px": 0.0}, {"box_share": 0.0}, {"seed": -1}, {"shift": "pink"}):
        with pytest.raises(ValueError, match=r"SamplePlan"):
            SamplePlan(**options)


def test_shifts_are_even_and_of_each_pixel_alone() -> None:
    column, row = (part.ravel() for part in np.meshgrid(np.arange(64), np.arange(64)))
    shift = pixel_shift(7, column, row)
    for axis in range(3):
        assert kstest(shift[:, axis], "uniform").pvalue > 1e-3
    assert np.abs(np.corrcoef(shift.T) - np.eye(3)).max() < 0.06
    some = np.random.default_rng(0).permutation(len(column))[:50]
    np.testing.assert_array_equal(pixel_shift(7, column[some], row[some]), shift[some])
    for other in (pixel_shift(8, column, row), pixel_shift(7, column, row, frame=1), pixel_shift(7, row, column)):
        assert (other != shift).mean() > 0.97


def test_warps_have_the_density_of_their_filter() -> None:
    u, v = np.random.default_rng(2).random((2, 20000))
    x, y = gaussian_warp(u, v, 0.5)
    assert kstest(x, norm(scale=0.5).cdf).pvalue > 1e-3 and kstest(y, norm(scale=0.5).cdf).pvalue > 1e-3
    assert abs(np.corrcoef(x, y)[0, 1]) < 0.03
    assert kstest(triangle_warp(u), triang(0.5).cdf).pvalue > 1e-3
    assert kstest(box_warp(u, 0.5), "uniform", args=(0.25, 0.5)).pvalue > 1e-3


def test_warps_at_their_ends() -> None:
    ends = np.array([0.0, 5e-324, 0.5, BELOW_ONE])
    for part in gaussian_warp(ends, ends, 0.5):
        assert np.isfinite(part).all() and np.abs(part).max() < 5.0
    np.testing.assert_allclose(triangle_warp(np.array([0.0, 0.125, 0.5, 0.875, 1.0])), [0.0, 0.25, 0.5, 0.75, 1.0])
    assert triangle_warp(np.nextafter(0.5, 1.0)) == pytest.approx(0.5, abs=1e-12)
    np.testing.assert_allclose(box_warp(np.array([0.0, 1.0]), 0.5), [0.25, 0.75])


@pytest.mark.parametrize("shift", ["white", "blue"])
@pytest.mark.parametrize("name", POINT_SETS)
def test_a_pixel_has_its_samples_whoever_asks_with_it(name, shift) -> None:
    plan = SamplePlan(27, name, seed=5, space_filter="gaussian", time_filter="triangle", shift=shift)
    column, row = np.array([3, 40, 3, 0]), np.array([9, 2, 10, 0])
    position, time_s = plan.samples(column, row, 64, 32, 2.0, (0.1, 0.3), frame=4)
    assert position.shape == (4, 27, 2) and time_s.shape == (4, 27)
    assert (time_s >= 2.1).all() and (time_s <= 2.3).all()
    for pixel in range(4):
        alone = plan.samples(column[[pixel]], row[[pixel]], 64, 32, 2.0, (0.1, 0.3), frame=4)
        np.testing.assert_array_equal(alone[0][0], position[pixel])
        np.testing.assert_array_equal(alone[1][0], time_s[pixel])


def test_a_box_keeps_to_the_pixel_and_a_gaussian_has_its_width() -> None:
    column, row = np.arange(50), np.full(50, 7)
    inside = SamplePlan(64).samples(column, row, 50, 20, 0.0)[0].astype(np.float64) * (50, 20)
    assert (np.abs(inside - np.stack([column, row], 1)[:, None] - 0.5) <= 0.5001).all()
    wide = SamplePlan(64, space_filter="gaussian", sigma_px=0.8).samples(column, row, 50, 20, 0.0)[0] * (50.0, 20.0)
    offset = wide - np.stack([column, row], 1)[:, None] - 0.5
    np.testing.assert_allclose(offset.reshape(-1, 2).std(axis=0), 0.8, rtol=0.05)


def test_frames_share_a_set_or_have_their_own() -> None:
    pixel = np.zeros(1, np.int64)
    for own in (False, True):
        plan = SamplePlan(8, "random", new_set_each_frame=own)
        first, second = (plan.samples(pixel, pixel, 1, 1, 0.0, frame=frame)[0][0] for frame in (0, 1))
        shift = pixel_shift(0, pixel, pixel, 0)[0, :2], pixel_shift(0, pixel, pixel, 1)[0, :2]
        unshifted = [(np.float64(part) - by) % 1.0 for part, by in zip((first, second), shift, strict=True)]
        assert np.allclose(*unshifted, atol=1e-6) != own
