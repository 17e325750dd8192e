"""The front from which presets and budgets choose, as a file."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from analysis.metrics.cost_model import LEDGERS
from analysis.metrics.front import means, on_front
from analysis.study.cases import ROWS
from analysis.trade.knobs import KNOBS, OWN, ROW, KnobSetting
from analysis.trade.options import TradeOptions
from analysis.trade.runs import scale_of
from analysis.trade.tables import by_place, lines, relative

NEAR = 0.05
"""Relative difference up to which the default counts as equal to the knee, and is stored as the knee."""
_STORED = ("cost_flops", "mse", "wall_s", *(f"flops_{ledger}" for ledger in LEDGERS if ledger != "wall"))


def front_file(points: pd.DataFrame, options: TradeOptions) -> dict[str, Any] | None:
    """The front of the settings that a run can use: those of the policy ``tsar`` that turn only its batch and its own
    options. None if the default was not measured.

    Its columns are those of :class:`analysis.comparison.front.FrontPoint`. The knee is that of all measured settings.
    The default is stored in its place if it is as good within :data:`NEAR`, so that no option changes for a gain that
    the runs hardly show.
    """
    own = lines(points, (points["policy"] == OWN) & points["changes"].map(_can_be_given))
    default = KnobSetting().words
    if default not in set(own["setting"]):
        return None
    tables = {name: by_place(own, name) for name in _STORED}
    places = tables["mse"].columns[tables["mse"].loc[default].notna()]
    kept = [name for name in tables["mse"].index if tables["mse"].loc[name, places].notna().all()]
    mean = {name: means(table.loc[kept, places].to_numpy(np.float64)) for name, table in tables.items()}
    scale, side = scale_of(options), ROWS[ROW][1]
    per = (side // scale.divisor) ** 2 * scale.seconds
    standing = kept.index(default)
    at = _nearest(points, kept, standing, mean["cost_flops"], mean["mse"])
    front = _front_through(at, mean["cost_flops"], mean["mse"])
    changes = dict(zip(own["setting"], own["changes"].map(json.loads), strict=True))
    found = []
    for number in sorted(front, key=lambda one: mean["cost_flops"][one]):
        values = changes[kept[number]]
        found.append(
            {
                "batch": values.pop("batch", KNOBS["batch"].default),
                "parts": {KNOBS[name].part: value for name, value in values.items()},
                "flops": {name[6:]: float(mean[name][number] / per) for name in _STORED if name.startswith("flops_")},
                "wall_s": float(mean["wall_s"][number] / per),
                "mse": float(mean["mse"][number]),
                "cost": float(mean["cost_flops"][number] / mean["cost_flops"][standing]),
                "error": float(mean["mse"][number] / mean["mse"][standing]),
                "knee": bool(number == at),
            }
        )
    made = {
        "scale": options.scale,
        "seconds": options.seconds,
        "inputs": ["/".join(Path(name).parts[-2:]) for name in dict.fromkeys(own["input"])],
        "seeds": sorted({int(seed) for seed in own["seed"]}),
        "ledger": options.ledger,
        "settings": len(kept),
    }
    return {"made": made, "places": found}


def _nearest(points: pd.DataFrame, kept: list[str], standing: int, costs: np.ndarray, errors: np.ndarray) -> int:
    """The setting to store as the knee of all measured settings: the default if it is within :data:`NEAR`, or else the
    setting whose logarithms are nearest."""
    front = relative(points, 10).front
    best = front[front["knee"]].iloc[0]
    away = [np.log(own / own[standing] / best[name]) for own, name in ((costs, "cost"), (errors, "error"))]
    apart = np.hypot(*away)
    near = max(abs(one[standing]) for one in away) <= np.log1p(NEAR)
    return standing if near else int(np.argmin(apart))


def _front_through(at: int, costs: np.ndarray, errors: np.ndarray) -> np.ndarray:
    """The front through a given point: settings that dominate the point are left out."""
    kept = on_front(costs, errors) & ~((costs <= costs[at]) & (errors <= errors[at]))
    return np.flatnonzero(kept | (np.arange(len(costs)) == at))


def _can_be_given(changes: str) -> bool:
    return all(name == "batch" or KNOBS[name].part for name in json.loads(changes))
