"""Figures 7.23 to 7.25 of a sensitivity study, and its measurements as maps and lines; computes nothing."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from PIL import Image

from analysis.page.figures import ADAPTIVE, GRID, INKS, MARKERS, ink_of, label_ends, line_style, plain_log, save
from analysis.page.pictures import RATE_MAP, number

if TYPE_CHECKING:
    from analysis.sensitivity.options import SensitivityOptions
    from analysis.sensitivity.runs import TemplateSetting
    from analysis.study.evaluation import Resources

Lines = Sequence[Mapping[str, Any]]
"""Lines of the table of settings."""

_FACTORS = (1.1, 1.25, 1.5, 2.0, 4.0)
"""The colours of the maps end at one of these factors above and below the default."""
_MAP = "RdBu_r"
_SPATIAL = "spatial slope   ← steeper, more sensitive"
_TEMPORAL = "temporal slope   steeper, more sensitive →"


def write_all(
    folder: Path,
    options: SensitivityOptions,
    lines: Lines,
    settings: Sequence[TemplateSetting],
    keys: Mapping[TemplateSetting | None, str],
    place: Resources,
) -> list[Path]:
    """Draws every figure that has results.

    Args:
        folder: folder for the figures.
        options: options of the study.
        lines: one per sweep, input and setting.
        settings: pairs of slopes.
        keys: keys of the results of the input that is shown, by setting.
        place: gives the files of a result by its key.

    Returns:
        The files.
    """
    grid = {(one.temporal_slope, one.spatial_slope): keys.get(one) for one in settings}
    default = options.tsar.error.temporal_slope, options.tsar.error.spatial_slope
    where = f"{options.figure_input}, {options.still_s:g} s"
    shown, tilings = (
        {pair: place.still(key, what, 0) if key else None for pair, key in grid.items()} for what in ("shown", "tiling")
    )
    references = [place.still(key, "reference", 0) for key in keys.values()]
    figures = {
        "fig_7_23": reference_figure(references, f"Reference, {where}"),
        "fig_7_24": grid_figure(shown, default, f"Reconstruction, {where}", None),
        "fig_7_25": grid_figure(tilings, default, f"Tiles by refresh rate, {where}", options.tsar.temporal_bounds),
        "slopes": map_figure([line for line in lines if line["sweep"] == "slopes"]),
        "sweeps": line_figure([line for line in lines if line["sweep"] != "slopes"]),
    }
    files = []
    for name, figure in figures.items():
        file = folder / f"{name}.png"
        # a figure of an earlier study must not stay beside the results of this one
        file.unlink(missing_ok=True)
        file.with_suffix(".svg").unlink(missing_ok=True)
        if figure is not None:
            save(figure, file)
            files.append(file)
    return files


def _show(axis: Axes, path: Path) -> None:
    with Image.open(path) as image:
        axis.imshow(np.asarray(image))


def reference_figure(paths: Sequence[Path], title: str) -> Figure | None:
    """The reference (fig. 7.23), from the first file that exists: all runs have the same one."""
    path = next((path for path in paths if path.exists()), None)
    if path is None:
        return None
    figure = Figure(figsize=(5.0, 5.3), layout="constrained")
    axis = figure.subplots()
    _show(axis, path)
    axis.set_axis_off()
    axis.set_title(title, fontsize=10, loc="left")
    return figure


def grid_figure(
    pictures: Mapping[tuple[float, float], Path | None],
    default: tuple[float, float],
    title: str,
    bounds: tuple[float, float] | None,
) -> Figure | None:
    """Pictures by slope (figs 7.24, 7.25): sensitivity falls to the right in space and downwards in time.

    Args:
        pictures: files by temporal and spatial slope; missing ones stay empty.
        default: the default pair, marked by an asterisk.
        title: text above the figure.
        bounds: bounds of the colour scale, refreshes per cycle; None for pictures without a scale.
    """
    if not any(path is not None and path.exists() for path in pictures.values()):
        return None
    rows, columns = (sorted({pair[number] for pair in pictures}) for number in (0, 1))
    width = 0.6 + 3.0 * len(columns) + (1.2 if bounds else 0.0)
    figure = Figure(figsize=(width, 0.9 + 3.2 * len(rows)), layout="constrained")
    axes = figure.subplots(len(rows), len(columns), squeeze=False)
    for (row, column), axis in np.ndenumerate(axes):
        pair = rows[row], columns[column]
        path = pictures.get(pair)
        if path is not None and path.exists():
            _show(axis, path)
        else:
            axis.text(0.5, 0.5, "no result", ha="center", va="center", transform=axis.transAxes)
            axis.set_box_aspect(1)
        axis.set_xticks([])
        axis.set_yticks([])
        asterisk = "*" if pair == default else ""
        axis.set_title(f"{columns[column]:g}, {rows[row]:g}{asterisk}", fontsize=10)
        if asterisk:
            axis.spines[:].set(color=ADAPTIVE, linewidth=2.5)
    figure.suptitle(f"{title}  (spatial slope, temporal slope; * default)", fontsize=11)
    figure.supxlabel(_SPATIAL, fontsize=10)
    figure.supylabel(_TEMPORAL, fontsize=10)
    if bounds is not None:
        scale = ScalarMappable(LogNorm(*bounds), RATE_MAP)
        bar = figure.colorbar(scale, ax=axes, shrink=0.6, label="refreshes per cycle (darker: less often)")
        steps = 2.0 ** np.arange(np.ceil(np.log2(bounds[0])), np.floor(np.log2(bounds[1])) + 1)
        bar.set_ticks(list(steps), labels=[number(float(step)) for step in steps])
        bar.minorticks_off()
    return figure


def map_figure(lines: Lines) -> Figure | None:
    """Error ratio over the slopes, a map per input; colours compare it with the default setting."""
    maps: dict[str, list[Mapping[str, Any]]] = {}
    for line in lines:
        if not np.isnan(line["mse"]):
            maps.setdefault(line["input"], []).append(line)
    if not maps:
        return None
    columns = min(3, len(maps))
    rows = -(-len(maps) // columns)
    figure = Figure(figsize=(1.6 + 2.9 * columns, 0.9 + 2.9 * rows), layout="constrained")
    axes = figure.subplots(rows, columns, squeeze=False)
    for axis in axes.flat[len(maps) :]:
        axis.set_visible(False)
    reach = max(max(line["to_default"], 1 / line["to_default"]) for part in maps.values() for line in part)
    end = next((factor for factor in _FACTORS if reach <= factor), _FACTORS[-1])
    norm = LogNorm(1 / end, end)
    places = [sorted({line[name] for line in lines}) for name in ("temporal_slope", "spatial_slope")]
    for axis, (name, part) in zip(axes.flat, maps.items(), strict=False):
        _map(axis, part, places, end)
        axis.set_title(name, fontsize=10, loc="left")
    bar = figure.colorbar(ScalarMappable(norm, _MAP), ax=axes, shrink=0.7, label="error / error of the default")
    ticks = [1 / end, end**-0.5, 1.0, end**0.5, end]
    bar.set_ticks(ticks, labels=[number(tick) for tick in ticks])
    bar.minorticks_off()
    figure.suptitle("Error of thesis / framed (* default, box: best)", fontsize=10, x=0.01, ha="left")
    figure.supxlabel(_SPATIAL, fontsize=9)
    figure.supylabel(_TEMPORAL, fontsize=9)
    return figure


def _map(axis: Axes, lines: Lines, places: Sequence[list[float]], end: float) -> None:
    rows, columns = places
    best = min(lines, key=lambda line: line["mse"])
    values = np.full((len(rows), len(columns)), np.nan)
    for line in lines:
        row, column = rows.index(line["temporal_slope"]), columns.index(line["spatial_slope"])
        values[row, column] = line["to_default"]
        dark = abs(np.log(line["to_default"])) > 0.6 * np.log(end)
        text = "—" if np.isnan(line["ratio"]) else f"{line['ratio']:.3g}{'*' if line['default'] else ''}"
        axis.text(column, row, text, ha="center", va="center", fontsize=10, color="white" if dark else "black")
        if line is best:
            axis.add_patch(Rectangle((column - 0.46, row - 0.46), 0.92, 0.92, fill=False, linewidth=2.2))
    axis.imshow(np.clip(values, 1 / end, end), norm=LogNorm(1 / end, end), cmap=_MAP)
    axis.set_xticks(range(len(columns)), [f"{value:g}" for value in columns])
    axis.set_yticks(range(len(rows)), [f"{value:g}" for value in rows])


def line_figure(lines: Lines) -> Figure | None:
    """Error ratio over offsets and bias, a line per input; bars from the least to the greatest repetition."""
    known = [line for line in lines if not np.isnan(line["ratio"])]
    kinds = list(dict.fromkeys(line["sweep"] for line in known))
    if not kinds:
        return None
    figure = Figure(figsize=(0.8 + 3.4 * max(2, len(kinds)), 4.2), layout="constrained")
    axes = figure.subplots(1, len(kinds), squeeze=False, sharey=True)[0]
    styles = {name: style for style, name in enumerate(dict.fromkeys(line["input"] for line in lines))}
    for axis, kind in zip(axes, kinds, strict=True):
        part, column = [line for line in known if line["sweep"] == kind], kind.replace(" ", "_")
        for name, style in styles.items():
            _line(axis, [line for line in part if line["input"] == name], column, style, name)
        axis.axhline(1.0, color="0.0", linewidth=0.9)
        axis.set_yscale("log")
        axis.spines[["top", "right"]].set_visible(False)
        axis.grid(True, **GRID)
        axis.set_axisbelow(True)
        axis.set_xlabel(f"{kind}{', octaves' if kind == 'bias' else ', log2 of power'}")
        axis.set_xticks(sorted({line[column] for line in part}))
    axes[0].set_ylabel("error of thesis / framed (* default)")
    plain_log(axes[0].yaxis, range(1, 10))
    label_ends(axes[-1])
    return figure


def _line(axis: Axes, lines: Lines, column: str, style: int, name: str) -> None:
    at, ratio, least, most = (
        np.array([line[key] for line in lines]) for key in (column, "ratio", "ratio_least", "ratio_most")
    )
    reach = np.maximum([ratio - least, most - ratio], 0.0)
    ink = INKS[ink_of(style)]
    axis.errorbar(at, ratio, reach if reach.any() else None, fmt="none", color=ink, capsize=2)
    axis.plot(at, ratio, marker=MARKERS[style % len(MARKERS)], markersize=3.5, label=name, **line_style(style))
    marked = [line for line in lines if line["default"]]
    where, height = ([line[key] for line in marked] for key in (column, "ratio"))
    axis.plot(where, height, "*", color=ink, markeredgecolor="black", markersize=13, zorder=4, label="_default")
