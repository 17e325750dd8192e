"""Tables of the trade from the results of the runs. They do not depend on the order of the runs."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd

from analysis.metrics.cost_model import LEDGERS, RAYS, Ledger
from analysis.metrics.front import FrontBands, bootstrap, interval, knee, means, on_front
from analysis.trade.knobs import KNOBS, KnobSetting, said
from analysis.trade.runs import SEARCH, Run

COLUMNS = (
    *("input", "seed", "knob", "value", "cost_flops", "wall_s", "peak_bytes", "latency_s", "mse", "flip", "jod"),
    "on_front",
)
"""The first columns of ``trade.csv``."""
COSTS = {"cost_flops": "FLOPs", "wall_s": "wall seconds", "peak_bytes": "peak memory", "latency_s": "latency"}
"""Columns of the costs of a point."""
_MODELLED = tuple(ledger for ledger in LEDGERS if ledger != "wall")
_FURTHER = ("setting", "policy", "changes", "rays", "ssim", "result", *(f"flops_{ledger}" for ledger in _MODELLED))
GRID = 64
"""Number of budgets at which bands are computed."""


@dataclass(frozen=True)
class RunResult:
    """A run as read from disk: its place in the measurement, its summary, and its table over the reference times."""

    run: Run
    summary: Mapping[str, Any]
    times: pd.DataFrame


def point_table(results: Iterable[RunResult], ledger: Ledger) -> pd.DataFrame:
    """A line for each run: :data:`COLUMNS`, then the setting in words and as JSON, and further numbers.

    Costs are those of the whole measured span. ``on_front`` says whether no other point of the same input and seed has
    both less cost and less error (:func:`analysis.metrics.front.on_front`) by ``cost_flops`` and ``mse``.
    """
    made = [_line(one, ledger) for one in results if one.summary["spent"]]
    found = pd.DataFrame(made, columns=pd.Index([*COLUMNS, *_FURTHER]))
    if len(found):
        flags = found.groupby(["input", "seed"], sort=False, group_keys=False)[["cost_flops", "mse"]].apply(
            lambda one: pd.Series(on_front(one["cost_flops"].to_numpy(), one["mse"].to_numpy()), one.index)
        )
        found["on_front"] = np.ravel(flags.to_numpy()) if flags.ndim > 1 else flags.reindex(found.index)
    return found


def _line(one: RunResult, ledger: Ledger) -> dict[str, Any]:
    spent, machine, run = one.summary["spent"], one.summary["machine"], one.run
    jod = one.summary["jod"]
    return {
        "input": run.where.input,
        "seed": run.where.seed,
        "knob": run.point.knob,
        "value": said(run.point.value),
        "cost_flops": spent["flops"][ledger],
        "wall_s": machine["cycles_s"],
        "peak_bytes": machine["run_memory_bytes"],
        "latency_s": spent["latency_s"],
        "mse": one.times["mse"].mean(),
        "flip": one.times["flip"].mean(),
        "jod": np.nan if jod is None else jod,
        "setting": run.point.setting.words,
        "policy": run.point.setting.policy,
        "changes": json.dumps(dict(run.point.setting.changes)),
        "rays": sum(spent["counters"].get(name, 0.0) for name in RAYS),
        "ssim": one.times["ssim"].mean(),
        "result": one.summary["key"],
        **{f"flops_{name}": spent["flops"][name] for name in _MODELLED},
    }


@dataclass(frozen=True)
class Relative:
    """Cost and error of every setting at every place (input, seed and phase), over those of the default there.

    Attributes:
        settings: the settings in words, in the order of the rows.
        costs, errors: a row for each setting and a column for each place.
        front: a line for each setting: geometric means, whether it is on their front, and the share of the bootstrap
            draws in which it is.
        bands: bands of the front.
    """

    settings: list[str]
    costs: np.ndarray
    errors: np.ndarray
    front: pd.DataFrame
    bands: FrontBands | None


def relative(points: pd.DataFrame, draws: int, cost: str = "cost_flops", error: str = "mse") -> Relative:
    """The front of all settings that were measured at every place where the default was measured."""
    pivots = [by_place(points, column) for column in (cost, error)]
    default = KnobSetting().words
    if default not in pivots[0].index:
        return Relative([], np.empty((0, 0)), np.empty((0, 0)), pd.DataFrame(), None)
    places = pivots[0].columns[pivots[0].loc[default].notna()]
    kept = [name for name in pivots[0].index if all(one.loc[name, places].notna().all() for one in pivots)]
    costs, errors = ((one.loc[kept, places] / one.loc[default, places]).to_numpy(np.float64) for one in pivots)
    cost_means, error_means = means(costs), means(errors)
    budgets = np.geomspace(cost_means.min(), cost_means.max(), GRID)
    bands = bootstrap(costs, errors, budgets, draws)
    front = pd.DataFrame(
        {
            "setting": kept,
            "cost": cost_means,
            "error": error_means,
            "on_front": on_front(cost_means, error_means),
            "knee": np.arange(len(kept)) == knee(cost_means, error_means),
            "share_on_front": bands.on_front,
            "share_at_knee": bands.at_knee,
        }
    )
    for name, values in (("cost", costs), ("error", errors)):
        spans = [interval(row, draws) for row in values]
        front[f"{name}_low"], front[f"{name}_high"] = zip(*spans, strict=True)
    return Relative(kept, costs, errors, front, bands)


def lines(frame: pd.DataFrame, flags: Any) -> pd.DataFrame:
    """The flagged lines of a table."""
    found: Any = frame[flags]
    return found


def by_place(points: pd.DataFrame, column: str) -> pd.DataFrame:
    """Values of a column, with a line for each setting and a column for each place."""
    once = points.drop_duplicates(["setting", "input", "seed"])
    return once.pivot(index="setting", columns=["input", "seed"], values=column).reindex(once["setting"].unique())


def knob_table(points: pd.DataFrame, draws: int) -> pd.DataFrame:
    """A line for each knob and value: geometric means over all places of every cost and of both errors, over those of
    the knob's default there, and the mean difference in JOD. ``mse_low`` and ``mse_high`` are bootstrap bounds."""
    made = []
    for knob, found in _groups(lines(points, points["knob"] != SEARCH), "knob"):
        standing = found[found["value"] == said(KNOBS[knob].default)].set_index(["input", "seed"])
        for value, turned in _groups(found, "value"):
            here = turned.set_index(["input", "seed"])
            both = here.index.intersection(standing.index)
            if not len(both):
                continue
            line: dict[str, Any] = {"knob": knob, "value": value, "places": len(both)}
            for column in (*COSTS, "mse", "flip"):
                ratio = (here.loc[both, column] / standing.loc[both, column]).to_numpy(np.float64)
                line[column] = float(means(ratio[None])[0])
                if column == "mse":
                    line["mse_low"], line["mse_high"] = interval(ratio, draws)
            line["jod"] = float((here.loc[both, "jod"] - standing.loc[both, "jod"]).mean())
            made.append(line)
    return pd.DataFrame(made)


def _groups(frame: pd.DataFrame, by: str) -> list[tuple[str, pd.DataFrame]]:
    return [(str(name), one) for name, one in frame.groupby(by, sort=False)] if len(frame) else []


def sentences(knobs: pd.DataFrame) -> dict[str, str]:
    """For each knob a sentence on cost and error of its cheapest and its most expensive other value; among equal costs,
    of the least and the most accurate one."""
    found = {}
    for name, own in _groups(knobs, "knob"):
        default = said(KNOBS[name].default)
        others = [line for line in own.to_dict("records") if line["value"] != default]
        if others:
            order = sorted(others, key=lambda line: (round(line["cost_flops"], 1), -line["mse"]))
            ends = [order[0], *order[1:][-1:]]
            found[name] = f"Relative to the default ({default}), {'; '.join(map(_told, ends))}."
    return found


def _told(line: Mapping[Any, Any]) -> str:
    """The effect of one value: cost and error, and the latency if it changes by more than a tenth."""
    low, high = line["mse_low"], line["mse_high"]
    parts = [f"{_times(line['cost_flops'])} the FLOPs", f"{_times(line['mse'])} the error ({low:.2f}–{high:.2f})"]
    if abs(np.log(line["latency_s"])) > np.log(1.1):
        parts.append(f"{_times(line['latency_s'])} the latency")
    return f"{line['value']} has {_listed(parts)}"


def _times(ratio: float) -> str:
    return f"{ratio:.2f} times" if ratio < 9.95 else f"{ratio:.0f} times"


def _listed(parts: Sequence[str]) -> str:
    return f"{', '.join(parts[:-1])} and {parts[-1]}"


def knees(points: pd.DataFrame) -> pd.DataFrame:
    """A line for each input and seed: the setting at the knee of its own front, its cost and its error."""
    made = []
    for _, found in points.groupby(["input", "seed"], sort=False) if len(points) else ():
        at = found.iloc[knee(found["cost_flops"].to_numpy(), found["mse"].to_numpy())]
        made.append({name: at[name] for name in ("input", "seed", "setting", "cost_flops", "mse")})
    return pd.DataFrame(made)
