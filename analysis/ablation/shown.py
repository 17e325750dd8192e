"""The tables of the study of parts as text: on the terminal, and as Markdown."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import pandas as pd

from analysis.ablation.tables import ALL, by_input, where
from analysis.command.console import Table
from analysis.metrics.budget import SHARES
from analysis.metrics.rivals import BEST

Tables = Mapping[str, pd.DataFrame]


def shown_tables(tables: Tables) -> list[Table]:
    """For each row of table 7.2 the worth of every part, the terms of the error, and the distance to the floor."""
    found = []
    for row in sorted(set(tables["parts"]["row"])) if len(tables["parts"]) else ():
        found += [_parts(tables["parts"], row), _changes(tables["parts"], row)]
        found += [_budget(tables["budget"], row), _floor(tables["floor"], row)]
    return [table for table in found if table.rows]


def _parts(parts: pd.DataFrame, row: int) -> Table:
    ratios, framed, best = (by_input(parts, name, row) for name in ("ratio", "at most framed", f"at most {BEST}"))
    inputs = _inputs(ratios)
    rows = [
        [
            label,
            *(_number(values.get(name)) for name in (*inputs, ALL)),
            *(_percent(of[label][ALL]) for of in (framed, best)),
        ]
        for label, values in ratios.items()
    ]
    header = ["policy", *inputs, "geometric mean", "at most framed", f"at most {BEST}"]
    return Table(f"Mean error over framed's with a part left out or changed, row {row}", header, rows)


def _changes(parts: pd.DataFrame, row: int) -> Table:
    changes = by_input(parts, "change", row)
    inputs = _inputs(changes)
    rows = [[label, *(_number(values.get(name), 2) for name in (*inputs, ALL))] for label, values in changes.items()]
    return Table(f"The same over that of the whole policy, row {row}", ["policy", *inputs, "geometric mean"], rows)


def _budget(budget: pd.DataFrame, row: int) -> Table:
    columns = [*SHARES, "ratio"]
    rows = [
        [line["input"], *(_number(line[name]) for name in columns), _number(line["late_ms"], 1)]
        + [_percent(line[name]) for name in ("uncovered", "relit")]
        for line in _lines(budget, row)
    ]
    header = ["input", *SHARES, "sum", "age, ms", "pixels uncovered", "pixels relit"]
    return Table(f"Where the error of tsar lies, over framed's, row {row}", header, rows)


def _floor(floor: pd.DataFrame, row: int) -> Table:
    columns = (("floor", 3), ("policy", 3), ("policy / floor", 2))
    rows = [
        [line["input"], *(_number(line[name], digits) for name, digits in columns), _percent(line["at most twice"])]
        for line in _lines(floor, row)
    ]
    header = ["input", "a perfect picture of the same latency", "tsar", "ratio", "moments at most twice the floor"]
    return Table(f"Distance to the floor: errors over framed's, row {row}", header, rows)


def _lines(table: pd.DataFrame, row: int) -> list[dict[str, Any]]:
    found: Any = where(table, "row", row).to_dict("records")
    return found


def _inputs(values: Mapping[str, Mapping[str, float]]) -> list[str]:
    return list(dict.fromkeys(name for one in values.values() for name in one if name != ALL))


def _number(value: float | None, digits: int = 3) -> str:
    return "—" if value is None or math.isnan(value) else f"{value:.{digits}f}"


def _percent(value: float) -> str:
    return "—" if math.isnan(value) else f"{100.0 * value:.1f} %"
