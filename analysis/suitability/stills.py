"""Images on the displays of a suitability study at one time, side by side, and names of runs in figures."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from PIL import Image

from analysis.page.figures import save
from analysis.study.cases import ROWS, SCALES, Case, is_framed
from analysis.study.evaluation import Resources
from analysis.study.inputs import INPUTS
from analysis.suitability.options import SuitabilityOptions
from analysis.suitability.runs import STILLS, Run
from analysis.suitability.tables import Results, RunResult

_BATCHES = (32, 128, 256, 512, 1024)
LOOKS_AHEAD = "oracle"
"""The policy that sees the truth, which no renderer can do."""


def setting(run: Run) -> str:
    """Batch and resolution of a run, and those of its row of table 7.2 if the study is scaled down."""
    ran = f"{run.side_px}²" if is_framed(run.case.policy) else f"batch {run.case.tsar.batch_size}, {run.side_px}²"
    if run.case.scale.divisor == 1 or run.row is None:
        return ran
    batch, side = ROWS[run.row]
    return f"{ran} (thesis: {batch}, {side}²)"


def finest(results: Results, label: str, name: str) -> RunResult | None:
    """The run of an input at the finest resolution, first repetition; None if there is none."""
    found = [one for one in results.all if (one.run.label, one.run.case.input) == (label, name)]
    found = [one for one in found if one.run.repetition == results.repetitions[0]]
    return max(found, key=lambda one: one.run.side_px, default=None)


def best(results: Results, name: str, side_px: int) -> RunResult | None:
    """The run of an input, first repetition, with the least mean squared error over time among all policies except
    framed ones and the oracle; at one resolution, because errors at different resolutions are not comparable."""
    found = [one for one in results.all if (one.run.case.input, one.run.side_px) == (name, side_px)]
    found = [one for one in found if one.run.repetition == results.repetitions[0]]
    found = [one for one in found if not is_framed(one.run.case.policy) and one.run.case.policy != LOOKS_AHEAD]
    return min((one for one in found if one.value("mse") >= 0), key=lambda one: one.value("mse"), default=None)


def shown(results: Results, name: str) -> list[tuple[str, RunResult]]:
    """Runs whose pictures are shown side by side, with titles: the framed renderer, ``thesis`` with growing batch, each
    at its finest resolution, and the policy of least error at the resolution of the framed one."""
    framed = finest(results, "framed", name)
    if framed is None:
        return []
    first = results.repetitions[0]
    ours = [one for one in results.all if (one.run.label, one.run.case.input) == ("thesis", name)]
    ours = [one for one in ours if one.run.repetition == first]
    chosen = [framed]
    for batch in _BATCHES:
        of_batch = [one for one in ours if ROWS[one.run.row or 0][0] == batch]
        chosen += [max(of_batch, key=lambda one: one.run.side_px)] if of_batch else []
    least = best(results, name, framed.run.side_px)
    if least is not None and least not in chosen:
        chosen.append(least)
    return [
        (f"{one.run.label} {setting(one.run)}" + ("\nof all policies the least error" if one is least else ""), one)
        for one in chosen
    ]


def write_strip(
    path: Path, options: SuitabilityOptions, results: Results, name: str, keys: Mapping[Case, str], place: Resources
) -> Path | None:
    """Draws the reference and the runs of :func:`shown` at one time; None if no picture is on disk."""
    # the fast vehicle is gone by the second
    number = 0 if name == INPUTS[4] else len(STILLS) - 1
    chosen = shown(results, name)
    if not chosen:
        return None
    pictures = [("reference", place.still(keys[chosen[0][1].run.case], "reference", number))]
    pictures += [(title, place.still(keys[one.run.case], "shown", number)) for title, one in chosen]
    pictures = [(title, file) for title, file in pictures if file.exists()]
    if not pictures:
        return None
    columns = min(4, len(pictures))
    rows = -(-len(pictures) // columns)
    figure = Figure(figsize=(3.0 * columns, 3.4 * rows), layout="constrained")
    axes = figure.subplots(rows, columns, squeeze=False).reshape(-1)
    for axis in axes:
        axis.set_axis_off()
    for axis, (title, file) in zip(axes, pictures, strict=False):
        axis.imshow(np.asarray(Image.open(file)), interpolation="nearest")
        axis.set_title(title, fontsize=8, loc="left")
    at = options.start_s + STILLS[number] * SCALES[options.scale].seconds
    figure.suptitle(f"{name} at {at:.2f} s", fontsize=10, x=0.01, ha="left")
    save(figure, path, dpi=150)
    return path
