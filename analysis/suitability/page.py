"""The suitability study as text and as a page."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pandas as pd

from analysis.command.console import Table, frame_table
from analysis.metrics.rivals import BEST
from analysis.page.report import Report, write_report
from analysis.suitability.rivalry import ALL

Tables = Mapping[str, pd.DataFrame]


def shown_tables(tables: Tables) -> list[Table]:
    """The main tables that have rows, as text."""
    percentiles = tables["table_7_2"]
    names = [name for name in percentiles.columns if f"{name} thesis" in percentiles.columns]
    rows = [
        [f"{line['row']}", f"{line['batch']}", f"{line['side']}²"]
        + [f"{_whole(line[name])} ({_whole(line[f'{name} thesis'])})" for name in names]
        for line in percentiles.to_dict("records")
    ]
    header = ["row", "batch", "resolution", *names]
    found = [
        Table("Greatest suitable percentile, ours (thesis)", header, rows, words=0),
        *_rivalry(tables),
        *(
            frame_table(tables[name], title, f".{digits}f")
            for title, name, digits in (
                ("Summary shares", "shares", 3),
                ("Policies, and their share of the oracle's gain", "policies", 4),
                ("Causes of the error", "causes", 5),
                ("Runs in which thesis is better, by metric", "votes", 0),
                ("Agreement of metrics on the ranks of runs", "ranks", 3),
            )
        ),
    ]
    return [table for table in found if table.rows]


def _rivalry(tables: Tables) -> list[Table]:
    """Policies beside the framed renderer and the best rival; for the rivals, all rows together."""
    rivals = tables["rivals"]
    if len(rivals) and ALL in set(rivals["row"]):
        rivals = rivals.query("row == @ALL")
    return [
        _beside(tables["judged"], f"Error of policies beside framed (F) and the {BEST} (B)"),
        _beside(rivals, f"Error of rivals beside framed (F) and the {BEST} (B)"),
        _beside(tables["judged_metrics"], f"Policies beside framed (F) and the {BEST} (B) by every metric"),
        frame_table(tables["best_rival"], f"Share of moments at which each rival is the {BEST}", ".3f"),
    ]


def _beside(rows: pd.DataFrame, title: str) -> Table:
    """A table with short names of columns, because these tables are wide."""
    short = {name: name.replace("framed: ", "F ").replace(f"{BEST}: ", "B ") for name in rows.columns}
    return frame_table(rows.rename(columns=short), title, ".3f")


def _whole(value: float) -> str:
    return "—" if value != value else f"{value:.0f}"


def write_page(path: Path, summary: Mapping[str, Any], tables: Tables, pictures: Mapping[str, Path]) -> None:
    """Writes ``report.html``."""
    config = summary["config"]
    shown = [
        *shown_tables(tables),
        frame_table(tables["regions"], "Causes of the error by region", ".5f"),
        frame_table(tables["disagreements"], "Runs whose better renderer depends on the metric (1: thesis)", ".0f"),
    ]
    ratio = "The ratio is the mean squared error of the policy thesis over that of the framed renderer at each time. "
    if not len(tables["runs"]):
        ratio = ""
    lead = [
        f"{summary['runs_done']} of {summary['runs']} runs at scale {config['scale']}, ledger {summary['ledger']}, "
        f"{config['repetitions']} repetitions, each with its seed and phase. {ratio}A framed image of one sample a "
        f"pixel is shown {config['framed_rate_hz']:g} times a second.",
        f"JOD by ColorVideoVDP for the display {summary['display'].name} at {summary['display'].rate_hz:g} Hz, from "
        f"{config['jod_span_s'][0]:g} s to {config['jod_span_s'][1]:g} s of the first {config['jod_repetitions']} "
        "repetitions.",
    ]
    if summary["failures"]:
        lead.append(f"Failed: {'; '.join(f'{name}: {reason}' for name, reason in summary['failures'].items())}")
    write_report(
        path,
        Report(
            title=f"Suitability of {' and '.join(config['policies'])}",
            lead=lead,
            key_numbers=shown[0] if shown else None,
            figures=[(caption, file.read_bytes()) for caption, file in pictures.items()],
            tables=shown[1:],
            details={"Configuration": config, "Provenance": summary["provenance"]},
        ),
    )
