"""The sensitivity study: its cases, its tables from made-up errors, and its figures."""

from __future__ import annotations

import dataclasses
import itertools
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from PIL import Image

from analysis.sensitivity import plots
from analysis.sensitivity.options import SensitivityOptions
from analysis.sensitivity.runs import Setting, runs, sweeps
from analysis.sensitivity.tables import ALL, Results, beyond_spread, bowl, edge, optimum_table, setting_table
from analysis.study.cases import INPUTS, SCALES, framed_config
from tsar.config import ConfigError, ErrorConfig, ResponseConfig, TsarConfig

TWO = SensitivityOptions(inputs=("chase", "fast-crossing"))
SLOPES = ("spatial_slope", "temporal_slope")
GRID = np.array(list(itertools.product((-2.0, -1.0, 0.0), repeat=2)))
Errors = Callable[[str, Setting | None, int], float]


def made_up(options: SensitivityOptions, error: Errors) -> Results:
    """Results whose error rises and falls about ``error``, as the framed one does; NaN is a run that failed."""
    shape = np.array([0.5, 1.0, 1.5])
    found = {run.place: error(*run.place) for run in runs(options)}
    return {place: pd.DataFrame({"mse": shape * mean}) for place, mean in found.items() if not math.isnan(mean)}


def centred(name: str, setting: Setting | None, repetition: int) -> float:
    """The framed renderer has 2; the least error lies at slopes (-2, 0), bias 1 and the default offsets."""
    if setting is None:
        return 2.0
    away = (setting.spatial_slope + 2) ** 2 + setting.temporal_slope**2 + (setting.bias - 1) ** 2
    offsets = (setting.spatial_offset + 7) ** 2 + (setting.temporal_offset + 9) ** 2
    return (1.0 if name == "chase" else 3.0) * float(np.exp(0.1 * away + 0.01 * offsets))


def test_cases_are_made_once() -> None:
    planned = runs(SensitivityOptions())
    assert len(planned) == len({run.case for run in planned}) == len({run.place for run in planned})
    per_input = 1 + 9 + 4 + 4 + 4
    assert len(planned) == len(INPUTS) * per_input
    default = Setting.of(TsarConfig())
    assert sum(run.setting == default for run in planned) == len(INPUTS)
    assert all(default in settings for settings in sweeps(SensitivityOptions()).values())
    assert sum(run.case.policy == "framed" for run in planned) == sum(run.setting is None for run in planned) == 5


def test_a_case_is_the_row_at_its_setting() -> None:
    base = TsarConfig(error=ErrorConfig(norm="linf", spatial_offset=-6.0), response=ResponseConfig(gain=0.5))
    options = SensitivityOptions(inputs=("fast-crossing",), row=8, tsar=base, repetitions=2, scale="half")
    row = SCALES["half"].config(8, base)
    for run in runs(options):
        if run.setting is None:
            assert run.case.tsar == framed_config(row.resolution_px)
            continue
        assert Setting.of(run.case.tsar) == run.setting
        back = Setting.of(base).applied(dataclasses.replace(run.case.tsar, seed=0))
        assert back == row and run.case.tsar.seed == run.repetition
        assert run.case.phase == run.repetition / 2
        assert run.case.stills_s == ((options.still_s,) if run.repetition == 0 else ())
    offsets = {one.spatial_offset for one in sweeps(options)["spatial offset"]}
    assert offsets == {-10.0, -8.0, -6.0, -4.0, -2.0}
    assert {one.temporal_offset for one in sweeps(options)["spatial offset"]} == {-9.0}


def test_the_default_runs_even_where_no_sweep_holds_it() -> None:
    options = SensitivityOptions(
        inputs=("chase",), figure_input="chase", spatial_slopes=(-3.0,), temporal_slopes=(-3.0,), offsets=(), biases=()
    )
    assert [run.setting for run in runs(options)] == [
        None,
        Setting.of(TsarConfig()),
        Setting.of(TsarConfig()).changed(spatial_slope=-3, temporal_slope=-3),
    ]


def test_slopes_run_from_steep_to_flat_in_any_order_given() -> None:
    options = dataclasses.replace(TWO, spatial_slopes=(0.0, -2.0, -1.0), temporal_slopes=(-0.0, -3.0))
    pairs = [(one.temporal_slope, one.spatial_slope) for one in sweeps(options)["slopes"]]
    assert pairs == [(-3, -2), (-3, -1), (-3, 0), (0, -2), (0, -1), (0, 0)]
    assert all(np.copysign(1.0, pair[0]) == 1.0 for pair in pairs[3:]), "-0.0 would be another file than 0.0"


@pytest.mark.parametrize(
    ("values", "parts"),
    [
        ({"inputs": ("moon",)}, ("inputs", "moon", "fly-by")),
        ({"inputs": ()}, ("inputs", "at least one")),
        ({"inputs": ("chase",)}, ("figure_input", "fast-crossing")),
        ({"row": 16}, ("row", "16")),
        ({"spatial_slopes": ()}, ("spatial_slopes",)),
        ({"temporal_slopes": (0.0, -0.0)}, ("temporal_slopes", "none twice")),
        ({"offsets": (1.0, 1.0)}, ("offsets", "none twice")),
        ({"repetitions": 0}, ("repetitions", "0")),
        ({"still_s": SCALES["quick"].seconds}, ("still_s", f"{SCALES['quick'].seconds:g} s")),
        ({"biases": (9.0,)}, ("biases", "9.0")),
        ({"offsets": (float("nan"),)}, ("offsets", "nan")),
        ({"ledger": "wall"}, ("ledger", "wall")),
    ],
)
def test_what_is_refused(values: dict[str, Any], parts: tuple[str, ...]) -> None:
    with pytest.raises(ConfigError) as refused:
        runs(SensitivityOptions(**values))
    assert all(part in str(refused.value) for part in parts)


def test_table_of_settings() -> None:
    lines = setting_table(made_up(TWO, centred), TWO)
    assert len(lines) == 2 * (9 + 5 + 5 + 5)
    assert sum(line["default"] for line in lines) == 2 * 4
    for line in lines:
        setting = Setting(**{name: line[name] for name in dataclasses.asdict(Setting.of(TsarConfig()))})
        error = centred(line["input"], setting, 0)
        assert line["mse"] == pytest.approx(error)
        for column in ("ratio", "ratio_median", "ratio_least", "ratio_most"):
            assert line[column] == pytest.approx(error / 2)
        assert line["to_default"] == pytest.approx(error / centred(line["input"], Setting.of(TsarConfig()), 0))
        assert line["suitable_percentile"] == (100.0 if error <= 2 else 0.0)
    assert {line["suitable_percentile"] for line in lines} == {0.0, 100.0}


def test_ratios_are_of_the_framed_run_of_the_same_repetition() -> None:
    options = dataclasses.replace(TWO, repetitions=2)

    def error(name: str, setting: Setting | None, repetition: int) -> float:
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

    def error(name: str, setting: Setting | None, repetition: int) -> float:
        changed = setting is not None and setting.bias == 2.0
        return (100.0 * (2.0 if changed else 1.0)) if name == "chase" else 0.01 * (0.25 if changed else 1.0)

    lines = [line for line in optimum_table(made_up(TWO, error), TWO) if line["sweep"] == "bias"]
    found = {line["input"]: (line["bias"], line["to_default"]) for line in lines}
    assert found["fast-crossing"] == (2.0, pytest.approx(0.25))
    assert found["chase"][1] == 1.0
    assert found[ALL] == (2.0, pytest.approx(np.sqrt(0.5)))


def test_failed_runs_leave_gaps_and_nothing_else() -> None:
    gone = Setting.of(TsarConfig()).changed(spatial_slope=-2.0, temporal_slope=0.0)

    def error(name: str, setting: Setting | None, repetition: int) -> float:
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


def pixels(figure: Figure) -> np.ndarray:
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    return np.asarray(canvas.buffer_rgba())[..., :3]


def texts(figure: Figure) -> list[str]:
    drawn = [text.get_text() for axis in figure.axes for text in axis.texts]
    return drawn + [axis.get_title() for axis in figure.axes]


def pictures(folder: Path) -> dict[tuple[float, float], Path | None]:
    found: dict[tuple[float, float], Path | None] = {}
    for number, (temporal, spatial) in enumerate(itertools.product((-2.0, -1.0, 0.0), repeat=2)):
        found[temporal, spatial] = folder / f"{number}.png"
        Image.fromarray(np.full((32, 32, 3), 20 * number + 10, np.uint8)).save(folder / f"{number}.png")
    return found


def test_grid_of_pictures(tmp_path: Path) -> None:
    grid = pictures(tmp_path)
    figure = plots.grid_figure(grid, (-1.0, -2.0), "grid", (1 / 16, 1.0))
    assert figure is not None and pixels(figure).std() > 5.0
    titles = [axis.get_title() for axis in figure.axes[:9]]
    # space falls to the right, time downwards
    assert titles[0] == "-2, -2" and titles[2] == "0, -2" and titles[8] == "0, 0"
    assert [title for title in titles if "*" in title] == ["-2, -1*"]
    shown = [int(np.asarray(axis.images[0].get_array())[0, 0, 0]) for axis in figure.axes[:9]]
    assert shown == [20 * number + 10 for number in range(9)]
    bar = [label.get_text() for label in figure.axes[9].get_yticklabels()]
    assert bar == ["1/16", "1/8", "1/4", "1/2", "1"]


def test_missing_pictures_leave_their_place(tmp_path: Path) -> None:
    grid = pictures(tmp_path)
    grid |= {pair: None for pair in grid if pair[0] == -2.0}
    figure = plots.grid_figure(grid, (-1.0, -1.0), "grid", None)
    assert figure is not None and len(figure.axes) == 9 and texts(figure).count("no result") == 3
    assert plots.grid_figure(dict.fromkeys(grid), (-1.0, -1.0), "grid", None) is None
    assert plots.reference_figure([tmp_path / "none.png"], "reference") is None


def test_maps_and_lines() -> None:
    lines = setting_table(made_up(TWO, centred), TWO)
    maps = plots.map_figure([line for line in lines if line["sweep"] == "slopes"])
    assert maps is not None and pixels(maps).std() > 5.0
    for axis, factor in zip(maps.axes[:2], (1.0, 3.0), strict=True):
        asterisks = [text for text in axis.texts if "*" in text.get_text()]
        assert [text.get_position() for text in asterisks] == [(1, 1)]
        assert float(asterisks[0].get_text()[:-1]) == pytest.approx(factor * np.exp(0.3) / 2, rel=0.01)
        (best,) = axis.patches
        assert (best.get_center() == (0, 2)).all()  # type: ignore[attr-defined]
    drawn = plots.line_figure([line for line in lines if line["sweep"] != "slopes"])
    assert drawn is not None and pixels(drawn).std() > 5.0 and len(drawn.axes) == 3
    for axis, default in zip(drawn.axes, (-7.0, -9.0, 0.0), strict=True):
        stars = [line for line in axis.lines if line.get_marker() == "*"]
        assert [list(star.get_xdata()) for star in stars] == [[default]] * 2  # type: ignore[arg-type]


def test_no_figure_of_nothing() -> None:
    lines = setting_table({}, TWO)
    assert plots.map_figure([line for line in lines if line["sweep"] == "slopes"]) is None
    assert plots.line_figure([line for line in lines if line["sweep"] != "slopes"]) is None
