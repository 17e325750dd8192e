"""Measures of point sets against values that are known, and errors that fall as theory says."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from analysis.command.progress import Task
from analysis.tracer.point_sets import (
    INTEGRANDS,
    SETS,
    PointSetOptions,
    evenness,
    half_space_volume,
    integrands,
    mean_errors,
    measure,
    slopes,
    squared_error,
)
from renderer.sampling.point_sets import point_set


def grid(side: int) -> np.ndarray:
    step = (np.arange(side) + 0.5) / side
    return np.stack(np.meshgrid(step, step, step, indexing="ij"), axis=-1).reshape(-1, 3)


def test_a_lattice_fills_its_cells_and_no_strata() -> None:
    found = evenness(grid(4))
    assert found["cells"] == 1.0
    assert found["strata"] == 0.0  # sixteen points share each of four of 64 intervals
    assert found["distance"] == pytest.approx(0.25 / (np.sqrt(2.0) / 64) ** (1 / 3))
    assert found["distance_uv"] == 0.0  # four points of a column fall together


def test_hammersley_fills_strata_and_keeps_its_distance_on_the_pixel() -> None:
    even = {name: evenness(point_set(name, 64, 1)) for name in SETS}
    assert even["hammersley"]["strata"] > 2.0 / 3.0  # u and v are; t, to base 3, is not of 64
    assert even["stratified"]["cells"] == 1.0
    assert even["poisson"]["distance"] == max(row["distance"] for row in even.values())
    assert even["hammersley"]["distance_uv"] > even["stratified"]["distance_uv"]
    assert even["random"]["discrepancy"] > even["hammersley"]["discrepancy"]


def test_the_volume_of_a_half_space_in_the_cube() -> None:
    normal = np.random.default_rng(3).standard_normal((200, 3))
    offset = np.random.default_rng(4).uniform(-2.0, 2.0, 200)
    points = np.random.default_rng(5).random((40_000, 3))
    counted = (points @ normal.T <= offset).mean(axis=0)
    np.testing.assert_allclose(half_space_volume(normal, offset), counted, atol=0.012)
    assert half_space_volume(np.array([[1.0, 1.0]]), np.array([1.0]))[0] == pytest.approx(0.5)
    assert half_space_volume(np.array([[2.0, 1.0, 1.0]]), np.array([9.0]))[0] == 1.0


@pytest.mark.parametrize("kind", INTEGRANDS)
def test_integrals_are_what_many_points_give(kind: str) -> None:
    found = integrands(kind, 30, np.random.default_rng(1))
    points = np.broadcast_to(grid(32), (30, 32**3, 3))
    np.testing.assert_allclose(found.values(points).mean(axis=1), found.integral, atol=0.02)


def test_random_points_err_by_their_variance() -> None:
    """The mean squared error of a share is ``p (1 - p) / n``."""
    found = integrands("moving edge", 4000, np.random.default_rng(2))
    shifts = np.random.default_rng(3).random((4000, 3))
    expected = (found.integral * (1.0 - found.integral)).mean() / 64
    errors = [squared_error(point_set("random", 64, seed), found, shifts) for seed in range(12)]
    assert np.mean(errors) == pytest.approx(expected, rel=0.12)


def test_tables_and_slopes() -> None:
    options = PointSetOptions(levels=(1, 8, 64, 216), cases=256, sets_of_each=8)
    task = Task()
    even, errors = measure(options, task)
    assert len(even) == len(SETS) * 4 == task.done and len(errors) == len(SETS) * 4 * 3
    fitted = slopes(errors).set_index("set")
    for kind in INTEGRANDS:
        assert fitted.loc["random", kind] == pytest.approx(-1.0, abs=0.25)
    assert fitted.loc["stratified", "smooth"] < -1.3  # better than random
    table = mean_errors(errors, 64).set_index("set")
    assert table.loc["hammersley", "moving edge"] < 0.5 * table.loc["random", "moving edge"]
    assert isinstance(even, pd.DataFrame)
