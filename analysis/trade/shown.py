"""The tables of the trade as text: on the terminal, and as Markdown."""

from __future__ import annotations

import math
from collections.abc import Mapping

import pandas as pd

from analysis.command.console import Table
from analysis.trade.knobs import KNOBS, said
from analysis.trade.tables import COSTS, lines, sentences

Tables = Mapping[str, pd.DataFrame]


def shown_tables(tables: Tables) -> list[Table]:
    """The front, the effect of every knob, a sentence on its gain and cost, and the knee of every input."""
    found = [
        front_table(tables["front"]),
        _knobs(tables["knobs"]),
        _sentences(tables["knobs"]),
        _knees(tables["knees"]),
    ]
    return [table for table in found if table.rows]


def front_table(front: pd.DataFrame) -> Table:
    """Settings on the front, by rising cost."""
    header = ["setting", "cost", "error", "95 % of its runs", "on the front", "at the knee", ""]
    kept = lines(front, front["on_front"]).sort_values("cost", kind="stable") if len(front) else front
    rows = [
        [
            line["setting"],
            f"{line['cost']:.2f}",
            f"{line['error']:.2f}",
            f"{line['error_low']:.2f}–{line['error_high']:.2f}",
            f"{100.0 * line['share_on_front']:.0f} %",
            f"{100.0 * line['share_at_knee']:.0f} %",
            "knee" if line["knee"] else "",
        ]
        for line in kept.to_dict("records")
    ]
    title = "The front: cost and error over those of the default, geometric means"
    return Table(title, header, rows, note="The last columns are shares of the bootstrap draws.")


def _knobs(knobs: pd.DataFrame) -> Table:
    header = ["knob", "value", *COSTS.values(), "MSE", "95 %", "FLIP", "JOD"]
    rows = [
        [
            *(line["knob"], line["value"], *(_number(line[name]) for name in COSTS), _number(line["mse"])),
            *(f"{line['mse_low']:.2f}–{line['mse_high']:.2f}", _number(line["flip"]), _signed(line["jod"])),
        ]
        for line in knobs.to_dict("records")
        if line["value"] != said(KNOBS[line["knob"]].default)
    ]
    return Table("Each knob alone, over its default; of JOD the difference", header, rows, words=2)


def _sentences(knobs: pd.DataFrame) -> Table:
    rows = [[name, KNOBS[name].words, told] for name, told in sentences(knobs).items()]
    return Table("What each knob buys and costs", ["knob", "what it is", "what it does"], rows, words=3)


def _knees(knees: pd.DataFrame) -> Table:
    rows = [
        [line["input"], str(line["seed"]), line["setting"], f"{line['cost_flops']:.3g}", f"{line['mse']:.3g}"]
        for line in knees.to_dict("records")
    ]
    return Table("The knee of every input", ["input", "seed", "setting", "FLOPs", "MSE"], rows, words=3)


def _number(value: float) -> str:
    return "—" if math.isnan(value) else f"{value:.2f}"


def _signed(value: float) -> str:
    return "—" if math.isnan(value) else f"{value:+.2f}"
