"""Tables of a sensitivity study from made-up results."""

from __future__ import annotations

import dataclasses
import itertools
import math
from typing import Any

import numpy as np
import pytest

from analysis.sensitivity.runs import TemplateSetting
from analysis.sensitivity.tables import ALL, beyond_spread, bowl, edge, optimum_table, setting_table
from tests.analysis.sensitivity.builders import TWO, centred, made_up
from tsar.config import TsarConfig

SLOPES = ("spatial_slope", "temporal_slope")
GRID = np.array(list(itertools.product((-2.0, -1.0, 0.0), repeat=2)))


def test_table_of_settings() -> None:
    lines = setting_table(made_up(TWO, centred), TWO)
    assert len(lines) == 2 * (9 + 5 + 5 + 5)
    assert sum(line["default"] for line in lines) == 2 * 4
    for line in lines:
        setting = TemplateSetting(**{name: line[name] for name in dataclasses.asdict(TemplateSetting.of(TsarConfig()))})
        error = centred(line["input"], setting, 0)
        assert line["mse"] == pytest.approx(error)
        for column in ("ratio", "ratio_median", "ratio_least", "ratio_most"):
            assert line[column] == pytest.approx(error / 2)
        assert line["to_default"] == pytest.approx(error / centred(line["input"], TemplateSetting.of(TsarConfig()), 0))
        assert line["suitable_percentile"] == (100.0 if error <= 2 else 0.0)
    assert {line["suitable_percentile"] for line in lines} == {0.0, 100.0}


def test_ratios_are_of_the_framed_run_of_the_same_repetition() -> None:
    options = dataclasses.replace(TWO, repetitions=2)

    def error(name: str, setting: TemplateSetting | None, repetition: int) -> float:
        return (4.0 if repetition else 1.0) if setting is None else (2.0 if repetition else 3.0)

    line = setting_table(made_up(options, error), options)[0]
    assert line["ratio"] == pytest.approx((3 + 2) / (1 + 4))
    assert (line["ratio_least"], line["ratio_most"]) == (pytest.approx(0.5), pytest.approx(3.0))
    assert line["ratio_median"] == pytest.approx((0.5 + 3.0) / 2)


def test_optima() -> None:
    lines = {(line["sweep"], line["input"]): line for line in optimum_table(made_up(TWO, centred), TWO)}
    assert len(lines) == 4 * 3
    for name in ("chase", "fast-crossing", ALL):
        slopes = lines["slopes", name]
        assert [slopes[axis] for axis in SLOPES] == [-2.0, 0.0]
        assert slopes["edge"] == "steepest spatial slope, flattest temporal slope"
        # the default is a step away in each slope, the worst pair two
        assert slopes["to_default"] == pytest.approx(np.exp(-0.2))
        assert slopes["worst_to_best"] == pytest.approx(np.exp(0.8))
        assert (slopes["within_5_percent"], slopes["settings"]) == (1, 9)
        assert slopes["beyond_spread"] == "unknown"
        assert slopes["convex"] and slopes["residual"] < 1e-9
        assert slopes["fit_spatial_slope"] == pytest.approx(-2.0) and slopes["fit_temporal_slope"] == pytest.approx(0.0)
        bias = lines["bias", name]
        assert bias["bias"] == 1.0 and bias["edge"] == "inside" and "convex" not in bias
        assert bias["to_default"] == pytest.approx(np.exp(-0.1))
        offset = lines["spatial offset", name]
        assert offset["spatial_offset"] == -7.0 and offset["to_default"] == pytest.approx(1.0)
        assert (offset["within_5_percent"], offset["worst_to_best"]) == (3, pytest.approx(np.exp(0.16)))


def test_all_inputs_are_judged_by_factors() -> None:
    """A quarter on the dark input outweighs a doubling on the bright one, whatever their errors are."""

    def error(name: str, setting: TemplateSetting | None, repetition: int) -> float:
        changed = setting is not None and setting.bias == 2.0
        return (100.0 * (2.0 if changed else 1.0)) if name == "chase" else 0.01 * (0.25 if changed else 1.0)

    lines = [line for line in optimum_table(made_up(TWO, error), TWO) if line["sweep"] == "bias"]
    found = {line["input"]: (line["bias"], line["to_default"]) for line in lines}
    assert found["fast-crossing"] == (2.0, pytest.approx(0.25))
    assert found["chase"][1] == 1.0
    assert found[ALL] == (2.0, pytest.approx(np.sqrt(0.5)))


def test_failed_runs_leave_gaps_and_nothing_else() -> None:
    gone = TemplateSetting.of(TsarConfig()).changed(spatial_slope=-2.0, temporal_slope=0.0)

    def error(name: str, setting: TemplateSetting | None, repetition: int) -> float:
        framed_gone = setting is None and name == "chase"
        return np.nan if setting == gone or framed_gone else centred(name, setting, repetition)

    results = made_up(TWO, error)
    lines = setting_table(results, TWO)
    assert sum(math.isnan(line["mse"]) for line in lines) == 2
    assert all(math.isnan(line["ratio"]) for line in lines if line["input"] == "chase")
    assert sum(math.isnan(line["ratio"]) for line in lines if line["input"] == "fast-crossing") == 1
    slopes = {line["input"]: line for line in optimum_table(results, TWO) if line["sweep"] == "slopes"}
    assert all(line["settings"] == 8 for line in slopes.values()) and len(slopes) == 3
    assert slopes["chase"]["to_default"] == pytest.approx(np.exp(-0.1))
    assert optimum_table({}, TWO) == []


def test_flatness_of_a_bowl() -> None:
    x, y = GRID.T
    mse = 3.0 * np.exp(0.2 * (x + 0.7) ** 2 + 0.05 * (y + 1.6) ** 2 + 0.06 * (x + 0.7) * (y + 1.6))
    found = bowl(GRID, mse)
    assert found["curvature_spatial"] == pytest.approx(0.4) and found["curvature_temporal"] == pytest.approx(0.1)
    assert found["curvature_mixed"] == pytest.approx(0.06) and found["residual"] < 1e-12 and found["convex"]
    assert (found["fit_spatial_slope"], found["fit_temporal_slope"]) == (pytest.approx(-0.7), pytest.approx(-1.6))
    assert "fit_edge" not in found


@pytest.mark.parametrize(
    ("place", "second", "where", "convex"),
    [
        ((-5.0, -1.0), (1.0, 1.0, 0.0), "steepest spatial slope", True),
        ((-1.0, 3.0), (1.0, 1.0, 0.0), "flattest temporal slope", True),
        ((-4.0, 4.0), (1.0, 1.0, 0.0), "steepest spatial slope, flattest temporal slope", True),
        # with y bound to x the least on the edge x = -2 is not at the y of the minimum, and still within
        ((-3.0, -1.0), (1.0, 1.0, 0.5), "steepest spatial slope", True),
        # a saddle and a dome fall towards the edges
        ((-1.2, -1.0), (-1.0, 1.0, 0.0), "flattest spatial slope", False),
        ((-1.2, -0.8), (-1.0, -1.0, 0.0), "flattest spatial slope, steepest temporal slope", False),
        ((-1.0, -1.0), (0.0, 0.0, 0.0), "flat", False),
    ],
)
def test_a_minimum_that_is_not_within(
    place: tuple[float, float], second: tuple[float, float, float], where: str, convex: bool
) -> None:
    (x, y), (a, b, c) = (GRID - place).T, second
    found = bowl(GRID, np.exp((a * x * x + b * y * y) / 2 + c * x * y))
    assert found["fit_edge"] == where and found["convex"] is convex and "fit_spatial_slope" not in found


def test_the_edge_is_where_the_fitted_surface_is_least() -> None:
    """Against a fine grid over the square, for surfaces of every kind."""
    fine = np.linspace(-2.0, 0.0, 201)
    x, y = (grid.ravel() for grid in np.meshgrid(fine, fine))
    rng, kinds = np.random.default_rng(3), set()
    for _ in range(40):
        a, b, c, d, e = rng.normal(size=5)

        def surface(x: Any, y: Any, k: tuple[float, ...] = (a, b, c, d, e)) -> Any:
            return k[0] * x + k[1] * y + k[2] * x * x + k[3] * x * y + k[4] * y * y

        found = bowl(GRID, np.exp(surface(*GRID.T)))
        least = int(np.argmin(surface(x, y)))
        expected = edge(np.array([x[least], y[least]]), GRID, SLOPES)
        assert found.get("fit_edge", "") == expected
        kinds.add(expected.count("slope"))
    assert kinds == {0, 1, 2}


def test_no_fit_without_a_grid() -> None:
    two = GRID[GRID[:, 0] > -2]
    assert bowl(two, np.ones(len(two))) == {}
    assert bowl(GRID, np.zeros(9)) == {}


def test_noise_is_not_beyond_the_spread() -> None:
    rng = np.random.default_rng(0)
    noise, base = np.exp(0.1 * rng.normal(size=(9, 5))), np.exp(0.1 * rng.normal(size=5))
    better = np.concatenate([noise, [0.5 * base]])
    assert beyond_spread(better, base)["beyond_spread"] == "yes"
    assert beyond_spread(better, base)["held_out"] == pytest.approx(0.5)
    # each setting is good in one repetition only: the best of the others is no good there
    luck = np.where(np.eye(5, dtype=bool), 0.2, 1.05)
    found = beyond_spread(luck, np.ones(5))
    assert luck.mean(1).min() < 0.9 and found["held_out"] == pytest.approx(1.05)
    assert found["beyond_spread"] == "no" and found["low"] < 0.9 < found["high"]
