"""Figures 7.8 to 7.22 of a suitability study."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from analysis.metrics.quality import WHISKERS, percentile
from analysis.page.figures import ADAPTIVE, FRAMED, GRID, INKS, dashed, ink_of, label_ends, new_figure, plain_log, save
from analysis.study.cases import ROWS, Case
from analysis.study.evaluation import Resources
from analysis.study.inputs import INPUTS
from analysis.suitability.options import SuitabilityOptions
from analysis.suitability.stills import finest, setting, write_strip
from analysis.suitability.tables import Results, RunResult, ratios

_INK = {256: INKS[6], 512: FRAMED, 1024: ADAPTIVE}
_HATCH = {256: "", 512: "//", 1024: ".."}


def write_all(
    folder: Path, options: SuitabilityOptions, results: Results, keys: Mapping[Case, str], place: Resources
) -> dict[str, Path]:
    """Draws every figure that has results; returns captions and files in the order of the thesis."""
    made: dict[str, Path] = {}

    def keep(name: str, caption: str, figure: Figure | None) -> None:
        if figure is not None:
            save(figure, folder / f"{name}.png")
            made[caption] = folder / f"{name}.png"

    keep("fig_7_8", "Characteristic behaviour of the error of a framed renderer (fig. 7.8)", behaviour(results))
    keep("fig_7_9", "Error of framed runs of two inputs (fig. 7.9)", framed_errors(results))
    keep("fig_7_10", "Error ratio over all runs (fig. 7.10)", boxes(results, results.inputs, "all inputs"))
    for number, suitable in ((11, True), (13, False)):
        chosen = [name for name in results.inputs if _suits(results, name) == suitable]
        label = "suitable" if suitable else "not suitable"
        which = "7.11 and 7.12" if suitable else "7.13"
        caption = f"Inputs whose runs are {label} at the 75th percentile, by majority (figs {which})"
        keep(f"fig_7_{number}", caption, boxes(results, chosen, label) if chosen else None)
    for name in results.inputs:
        figure, of = _figure_of_errors(name)
        keep(figure, f"Error over time, {name}{of}", errors(results, name))
    keep("fig_7_15", "Error ratio over time of one run (fig. 7.15)", ratio_over_time(results, options.policy_row))
    for name in results.inputs:
        number = 18 + INPUTS.index(name) if name in INPUTS else None
        file = folder / (f"fig_7_{number}.png" if number else f"shown_{name}.png")
        strip = write_strip(file, options, results, name, keys, place)
        if strip is not None:
            made[f"What the displays show, {name}" + (f" (fig. 7.{number})" if number else "")] = strip
    return made


def _figure_of_errors(name: str) -> tuple[str, str]:
    """Name of the figure of an input's errors, and the thesis' number of it where it has one."""
    if name not in INPUTS:
        return f"errors_{name}", ""
    number = INPUTS.index(name)
    figure = "7_14" if number == 0 else f"7_{16 + (number > 2)}"
    return f"fig_{figure}" + (f"_{name}" if number else ""), f" (fig. {figure.replace('_', '.')})"


def _axes(width: float, height: float, columns: int = 1, **kwargs: Any) -> tuple[Figure, list[Any]]:
    figure = Figure(figsize=(width, height), layout="constrained")
    axes = list(figure.subplots(1, columns, squeeze=False, **kwargs)[0])
    for axis in axes:
        axis.spines[["top", "right"]].set_visible(False)
        axis.grid(True, **GRID)
        axis.set_axisbelow(True)
    return figure, axes


def _positive(values: Any) -> Any:
    return np.where(np.asarray(values) > 0, values, np.nan)


def _refreshes(axis: Any, framed: RunResult) -> None:
    """Draws vertical lines at the reference times at which the shown image changes."""
    changes = framed.times["time_s"][framed.times["refresh"].diff() > 0]
    axis.vlines(changes, 0, 1, transform=axis.get_xaxis_transform(), color="0.75", linewidth=0.7, linestyle=":")


def behaviour(results: Results) -> Figure | None:
    """Three refreshes of a framed renderer: the error is least at a refresh (a, c) and grows until the next (b)."""
    name = "approach" if "approach" in results.inputs else next(iter(results.inputs), "")
    framed = finest(results, "framed", name)
    changes = np.flatnonzero(framed.times["refresh"].diff() > 0) if framed else np.array([])
    if framed is None or len(changes) < 3:
        return None
    first, last = max(changes[0] - 1, 0), min(changes[2] + 1, len(framed.times) - 1)
    part = framed.times.iloc[first : last + 1]
    figure, (axis,) = _axes(7.0, 3.2)
    _refreshes(axis, framed)
    axis.plot(part["time_s"], part["mse"], "o-", color=FRAMED, markersize=3, clip_on=False)
    marks = {"a": changes[0], "b": changes[1] - 1, "c": changes[1]}
    for label, at in marks.items():
        row = framed.times.iloc[at]
        axis.annotate(
            label, (row["time_s"], row["mse"]), (0, 7), textcoords="offset points", ha="center", weight="bold"
        )
    axis.set_xlim(part["time_s"].iloc[0], part["time_s"].iloc[-1])
    axis.margins(y=0.2)
    axis.set_xlabel("simulated time, s   (dotted: the display changes)")
    axis.set_ylabel("mean squared error")
    axis.set_title(f"{name}, framed, {framed.run.side_px}²", loc="left", fontsize=10)
    return figure


def framed_errors(results: Results) -> Figure | None:
    """Error of framed runs of inputs 3 and 1, as in the thesis."""
    chosen = [name for name in (INPUTS[3], INPUTS[1]) if name in results.inputs]
    runs = [run for run in (finest(results, "framed", name) for name in chosen) if run is not None]
    if not runs:
        return None
    figure, axes = _axes(10.0, 3.2, len(runs))
    for axis, run in zip(axes, runs, strict=True):
        _refreshes(axis, run)
        axis.plot(run.times["time_s"], run.times["mse"], color=FRAMED)
        axis.set_title(f"{run.run.case.input}, framed, {run.run.side_px}²", loc="left", fontsize=10)
        axis.set_xlabel("simulated time, s   (dotted: the display changes)")
    axes[0].set_ylabel("mean squared error")
    return figure


def _suits(results: Results, name: str) -> bool:
    """Whether most runs of an input have a 75th percentile of at most 1."""
    found = [percentile(np.sort(ratios(pair)), 75.0) <= 1 for row in results.rows for pair in results.pairs(name, row)]
    return bool(np.mean(found) >= 0.5) if found else False


def boxes(results: Results, names: Sequence[str], title: str) -> Figure | None:
    """A box for each row of table 7.2 over the ratios of all repetitions, and a column for each input."""
    if not names:
        return None
    figure, axes = _axes(max(5.0, 3.1 * len(names)), 4.2, len(names), sharey=True)
    drawn, unbounded = False, 0
    for axis, name in zip(axes, names, strict=True):
        pooled = {row: [ratios(pair) for pair in results.pairs(name, row)] for row in results.rows}
        values = {row: np.concatenate(found) for row, found in pooled.items() if found}
        unbounded += sum(int(np.isinf(one).sum()) for one in values.values())
        shown = [np.clip(one[np.isfinite(one)], 1e-6, None) for one in values.values()]
        if not shown:
            continue
        drawn = True
        flier = {"marker": "+", "markersize": 3, "markeredgecolor": "0.45"}
        made = axis.boxplot(
            shown, positions=list(values), widths=0.7, patch_artist=True, flierprops=flier, whis=WHISKERS
        )
        for row, box in zip(values, made["boxes"], strict=True):
            box.set(facecolor=_INK[ROWS[row][1]], hatch=_HATCH[ROWS[row][1]], alpha=0.75, linewidth=0.7)
        for median in made["medians"]:
            median.set(color="black")
        axis.axhline(1.0, color="0.0", linewidth=0.9)
        axis.set_yscale("log")
        axis.set_xticks(list(values), [str(row) for row in values], fontsize=7)
        axis.set_title(name, loc="left", fontsize=10)
        axis.set_xlabel("row of table 7.2")
    if not drawn:
        return None
    axes[0].set_ylabel("error of thesis / framed")
    plain_log(axes[0].yaxis)
    divisor = results.all[0].run.case.scale.divisor
    here = {side: f"{side // divisor}²" + (f" (thesis: {side}²)" if divisor > 1 else "") for side in _INK}
    handles = [_patch(color, _HATCH[side], here[side]) for side, color in _INK.items()]
    figure.legend(handles=handles, loc="outside lower center", ncols=3, fontsize=8, frameon=False)
    note = f"; {unbounded} infinite ratios not drawn" if unbounded else ""
    figure.suptitle(f"{title}: below 1 thesis is better{note}", fontsize=10, x=0.01, ha="left")
    return figure


def _patch(color: str, hatch: str, label: str) -> Any:
    from matplotlib.patches import Patch

    return Patch(facecolor=color, hatch=hatch, alpha=0.75, label=label)


def errors(results: Results, name: str) -> Figure | None:
    """Error over time: bold lines for framed runs, thin lines for adaptive runs, and a panel for each resolution."""
    first = results.repetitions[0]
    found = [one for one in results.all if one.run.case.input == name and one.run.repetition == first]
    sides = sorted({one.run.side_px for one in found if one.run.label == "thesis"})
    if not sides:
        return None
    figure, axes = new_figure(8.0, 2.6 * len(sides), len(sides), sharex=True, sharey=True)
    for axis, side in zip(axes, sides, strict=True):
        ours = [one for one in found if one.run.side_px == side and one.run.label == "thesis"]
        ours.sort(key=lambda one: ROWS[one.run.row or 0][0])
        for place, one in enumerate(ours):
            style = place + (place > 0)  # the second ink is that of framed
            axis.plot(one.times["time_s"], _positive(one.times["mse"]), color=INKS[ink_of(style)], linewidth=0.9,
                      linestyle=dashed(style, 0.9), label=setting(one.run))  # fmt: skip
        for one in found:
            if one.run.side_px == side and one.run.label == "framed":
                _refreshes(axis, one)
                axis.plot(one.times["time_s"], _positive(one.times["mse"]), color=FRAMED, linewidth=2.4, label="framed")
        axis.set_yscale("log")
        plain_log(axis.yaxis)
        axis.set_title(f"{name}, {side}²", loc="left", fontsize=10)
        axis.set_ylabel("mean squared error")
    axes[-1].set_xlabel("simulated time, s")
    for axis in axes:
        label_ends(axis)
    return figure


def ratio_over_time(results: Results, row: int) -> Figure | None:
    """One run of the first input, with lines for the median (dotted), the quartiles (dashed) and the bound of outliers
    (solid)."""
    row = 8 if 8 in results.rows else (row if row in results.rows else results.rows[0]) if results.rows else row
    pairs = results.pairs(results.inputs[0], row) if results.inputs else []
    if not pairs:
        return None
    values, framed = ratios(pairs[0]), pairs[0][1]
    low, middle, high = (percentile(np.sort(values), one) for one in (25.0, 50.0, 75.0))
    figure, (axis,) = _axes(8.0, 3.4)
    _refreshes(axis, framed)
    shown = np.where(np.isfinite(values) & (values > 0), values, np.nan)
    axis.plot(framed.times["time_s"], shown, color=ADAPTIVE, label="thesis / framed")
    axis.axhline(middle, color="0.2", linestyle=":", linewidth=1.0, label="median")
    for one in (low, high):
        axis.axhline(one, color="0.2", linestyle="--", linewidth=0.9, label="quartiles" if one == low else "_")
    axis.axhline(high + 1.5 * (high - low), color="0.2", linewidth=0.9, label="outliers above")
    axis.axhline(1.0, color=FRAMED, linewidth=0.9, label="equal error")
    axis.set_yscale("log")
    plain_log(axis.yaxis)
    axis.set_xlabel("simulated time, s   (dotted: the framed display changes)")
    axis.set_ylabel("error of thesis / framed")
    axis.set_title(
        f"{results.inputs[0]}, row {row}: {setting(pairs[0][0].run)}",
        loc="left",
        fontsize=10,
    )
    label_ends(axis)
    return figure
