"""Figures of a sensitivity study."""

from __future__ import annotations

import itertools
from pathlib import Path

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from PIL import Image

from analysis.sensitivity import plots
from analysis.sensitivity.tables import setting_table
from tests.analysis.sensitivity.builders import TWO, centred, made_up


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
