"""Tables from the results of a sensitivity study: the best settings, and the flatness of the optimum."""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from analysis.metrics.arrays import Floats
from analysis.metrics.quality import DRAWS
from analysis.sensitivity.options import SensitivityOptions
from analysis.sensitivity.runs import AXES, TemplateSetting, sweeps
from analysis.study.inputs import ALL

if TYPE_CHECKING:
    import pandas as pd

    from analysis.command.console import Table


BEST = ("to_default", "edge", "low", "high", "held_out", "beyond_spread")
"""Columns of the table of optima on the best setting; the others describe the flatness of the sweep."""
_FLAT = 1e-9

TableLine = dict[str, Any]
"""A line of a table, by column."""
TablesByPlace = Mapping[tuple[str, "TemplateSetting | None", int], "pd.DataFrame"]
"""Tables over the reference times by input, setting and repetition. Runs that failed are missing."""


def errors(results: TablesByPlace, name: str, settings: Sequence[TemplateSetting | None], repetitions: int) -> Floats:
    """Mean MSE ``(settings, repetitions)`` of an input, or ``ALL``; NaN where a run is missing."""
    if name == ALL:
        each = [errors(results, one, settings, repetitions) for one in {key[0]: None for key in results}]
        return np.exp(np.mean(np.log(each), 0))
    keys = itertools.product([name], settings, range(repetitions))
    found = [results[key]["mse"].mean() if key in results else np.nan for key in keys]
    return np.array(found, dtype=np.float64).reshape(len(settings), repetitions)


def setting_table(results: TablesByPlace, options: SensitivityOptions) -> list[TableLine]:
    """One line per sweep, input and setting, over its repetitions; errors and ratios are NaN where a run is missing."""
    from analysis.metrics.quality import ratio, suitable_percentile

    default, lines = TemplateSetting.of(options.tsar), []
    for (sweep, settings), name in itertools.product(sweeps(options).items(), options.inputs):
        for setting in settings:
            ours, base, framed = errors(results, name, (setting, default, None), options.repetitions)
            line: TableLine = {
                "sweep": sweep,
                "input": name,
                **dataclasses.asdict(setting),
                "default": setting == default,
            }
            line |= {"mse": ours.mean(), "to_default": ours.mean() / base.mean(), "ratio": ours.mean() / framed.mean()}
            each = ours / framed
            line |= {"ratio_least": each.min(), "ratio_most": each.max(), "ratio_median": np.nan}
            if not np.isnan(each).any():
                keys = [[(name, one, number) for one in (setting, None)] for number in range(options.repetitions)]
                values = np.concatenate([ratio(*(results[key]["mse"].to_numpy() for key in pair)) for pair in keys])
                line |= {"ratio_median": np.median(values), "suitable_percentile": suitable_percentile(values)}
            lines.append(line)
    return lines


def optimum_table(results: TablesByPlace, options: SensitivityOptions) -> list[TableLine]:
    """The best setting of every sweep and input, its gain over the default, and the flatness of the sweep."""
    default, lines = TemplateSetting.of(options.tsar), []
    names = (*options.inputs, ALL) if results else ()
    for (sweep, settings), name in itertools.product(sweeps(options).items(), names):
        found = errors(results, name, settings, options.repetitions)
        whole = [number for number, row in enumerate(found) if not np.isnan(row).any()]
        base = errors(results, name, (default,), options.repetitions)[0]
        if not whole or np.isnan(base).any():
            continue
        chosen = [settings[number] for number in whole]
        lines.append({"sweep": sweep, "input": name, **_optimum(found[whole], base, chosen, AXES[sweep])})
    return lines


def _optimum(found: Floats, base: Floats, settings: Sequence[TemplateSetting], axes: tuple[str, ...]) -> TableLine:
    mean, points = found.mean(1), np.array([[getattr(one, axis) for axis in axes] for one in settings])
    best = int(mean.argmin())
    line: TableLine = dict(zip(axes, points[best], strict=True))
    line |= {"to_default": mean[best] / base.mean(), "edge": edge(points[best], points, axes) or "inside"}
    near = int((mean <= 1.05 * mean[best]).sum())
    line |= {"worst_to_best": mean.max() / mean[best], "within_5_percent": near, "settings": len(mean)}
    line |= beyond_spread(found, base)
    return line | (bowl(points, mean) if len(axes) == 2 else {})


def beyond_spread(found: Floats, base: Floats) -> TableLine:
    """Whether the best of settings ``(settings, repetitions)`` beats the default ``(repetitions,)`` beyond the spread.

    ``held_out`` is the error, over that of the default, of settings that were chosen on the other repetitions, because
    the best of many is partly best by chance. Both it and the bootstrap interval must lie below 1. One repetition
    allows no conclusion.
    """
    count = len(base)
    if count == 1:
        return {"low": np.nan, "high": np.nan, "held_out": np.nan, "beyond_spread": "unknown"}
    best = found[found.mean(1).argmin()]
    drawn = np.random.default_rng(0).integers(0, count, (DRAWS, count))
    low, high = np.percentile(best[drawn].mean(1) / base[drawn].mean(1), (2.5, 97.5))
    others = ((found.sum(1, keepdims=True) - found) / (count - 1)).argmin(0)
    held_out = found[others, np.arange(count)].mean() / base.mean()
    return {"low": low, "high": high, "held_out": held_out, "beyond_spread": "yes" if max(high, held_out) < 1 else "no"}


def edge(point: Floats, points: Floats, axes: Sequence[str]) -> str:
    """The ends of the varied ranges at which a point lies; empty if it lies inside."""
    names, words = [], {True: ("steepest", "flattest"), False: ("least", "greatest")}
    for axis, value, column in zip(axes, point, points.T, strict=True):
        low, high = column.min() + _FLAT, column.max() - _FLAT
        if low < high and not low < value < high:
            names.append(f"{words[axis.endswith('slope')][int(value >= high)]} {axis.replace('_', ' ')}")
    return ", ".join(names)


def bowl(points: Floats, mse: Floats) -> TableLine:
    """Least-squares fit of ``ln mse`` by a quadratic in two slopes, and its minimum within the grid.

    Returns:
        Second derivatives, root mean square residual, whether the fit is convex, and its minimum: the stationary point
        if the fit is convex and the point lies within the grid, else a point on the edge of the grid. Empty for less
        than a grid of 3 x 3.
    """
    (x, y), centre = (points - points.mean(0)).T, points.mean(0)
    terms = np.stack([np.ones_like(x), x, y, x * x / 2, x * y, y * y / 2], 1)
    if np.linalg.matrix_rank(terms) < 6 or not (mse > 0).all():
        return {}
    fitted = np.linalg.lstsq(terms, np.log(mse), rcond=None)[0]
    slope, second = fitted[1:3], np.array([[fitted[3], fitted[4]], [fitted[4], fitted[5]]])
    low, high = points.min(0) - centre, points.max(0) - centre
    found = {"curvature_spatial": fitted[3], "curvature_temporal": fitted[5], "curvature_mixed": fitted[4]}
    found |= {"residual": np.sqrt(np.square(np.log(mse) - terms @ fitted).mean())}
    found["convex"] = bool(np.linalg.eigvalsh(second)[0] > _FLAT)
    if found["convex"]:
        least = np.linalg.solve(second, -slope)
        if (least >= low - _FLAT).all() and (least <= high + _FLAT).all():
            return found | {"fit_spatial_slope": (least + centre)[0], "fit_temporal_slope": (least + centre)[1]}
    # on an edge one coordinate is fixed and the fit is a parabola; if that is not convex, its minimum is at an end
    candidates = []
    for fixed, value in itertools.product((0, 1), (low, high)):
        free, at = 1 - fixed, value[fixed]
        steps = [low[free], high[free]]
        if second[free, free] > _FLAT:
            steps.append(np.clip(-(slope[free] + second[0, 1] * at) / second[free, free], low[free], high[free]))
        candidates += [(at, step) if fixed == 0 else (step, at) for step in steps]
    values = [slope @ one + one @ second @ one / 2 for one in np.array(candidates)]
    least = np.array(candidates[int(np.argmin(values))]) + centre
    return found | {"fit_edge": "flat" if np.ptp(np.log(mse)) < _FLAT else edge(least, points, AXES["slopes"])}


def shown_tables(optima: Sequence[TableLine]) -> list[Table]:
    """The best setting of every sweep, and the flatness of the sweep, for a terminal."""
    import pandas as pd

    from analysis.command.console import frame_table

    found = []
    for sweep, axes in AXES.items():
        part = pd.DataFrame([line for line in optima if line["sweep"] == sweep])
        best = [name for name in ("input", *axes, *BEST) if name in part]
        flat = ["input", *(name for name in part if name not in (*best, "sweep"))]
        for title, names in (("best", best), ("flatness", flat)) if len(part) else ():
            shown = pd.DataFrame(part, columns=names).dropna(axis=1, how="all")
            found.append(frame_table(shown, f"{sweep}, {title}", ".3g"))
    return found
