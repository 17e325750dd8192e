"""Runs the suitability study and writes its tables, figures and page."""

from __future__ import annotations

import dataclasses
import math
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pandas as pd

from analysis.command.cli import bad_input, full_disk
from analysis.command.ownership import own_folder, writable_folder
from analysis.command.progress import bars
from analysis.storage.files import atomic, write_json
from analysis.storage.provenance import provenance
from analysis.study.cases import ROWS, SCALES, Case
from analysis.study.evaluation import Place, broken, finished, times_of
from analysis.study.farm import describe_failures, run_cases
from analysis.suitability import plots
from analysis.suitability.options import SuitabilityOptions
from analysis.suitability.runs import Run, runs
from analysis.suitability.tables import (
    Result,
    Results,
    cause_table,
    disagreement_table,
    percentile_table,
    policy_table,
    rank_table,
    region_table,
    run_table,
    share_table,
    vote_table,
)

if TYPE_CHECKING:
    from rich.table import Table

Tables = dict[str, pd.DataFrame]


def study(options: SuitabilityOptions) -> tuple[dict[str, Any], Tables]:
    """Runs what is missing and writes everything to ``options.out``.

    Returns:
        What is in ``summary.json``, and the tables.

    Raises:
        InputError: something asked for cannot be had.
    """
    with bad_input():
        planned = runs(options)
        own_folder(options.out, "out")
        writable_folder(options.cache, "cache")
    out = options.out.resolve()
    place = Place(out / "runs", options.cache.resolve(), options.farm.threads)
    place.results.mkdir(exist_ok=True)
    with full_disk(out), bars() as shown:
        keys, failures = run_cases(
            [run.case for run in planned], place, options.farm, shown.task("runs", len({run.case for run in planned}))
        )
    # said at once: what follows may fail for the same reasons, such as a full disk
    for line in describe_failures({keys[case]: reason for case, reason in failures.items()}):
        print(line, file=sys.stderr)
    results = Results(collect(planned, keys, place))
    tables = tables_of(options, results)
    with full_disk(out):
        for name, table in tables.items():
            with atomic(out / "tables" / f"{name}.csv") as temporary:
                table.to_csv(temporary, index=False)
        timing(planned, keys, place).to_csv(out / "timing.csv", index=False)
        pictures = plots.write_all(out / "figures", options, results, keys, place)
        summary = _summary(options, planned, keys, place, failures, tables)
        summary["broken_invariants"] = broken(one.summary for one in results.all)
        write_page(out / "report.html", summary, tables, pictures)
        write_json(out / "summary.json", summary)
    return summary, tables


def collect(planned: list[Run], keys: Mapping[Case, str], place: Place) -> list[Result]:
    """Results of the runs that are on disk."""
    found = []
    for run in planned:
        key = keys[run.case]
        summary = finished(key, place)
        if summary is not None:
            found.append(Result(run, summary, times_of(key, place)))
    return found


def tables_of(options: SuitabilityOptions, results: Results) -> Tables:
    """Every table by name. Nothing in them depends on machine, order or time."""
    side = ROWS[options.policy_row][1] // SCALES[options.scale].divisor
    return {
        "table_7_2": percentile_table(results),
        "shares": share_table(results),
        "policies": policy_table(results, options.policy_row, side),
        "causes": cause_table(results, options.policy_row, side),
        "regions": region_table(results, options.policy_row, side),
        "disagreements": disagreement_table(results),
        "votes": vote_table(results),
        "ranks": rank_table(results),
        "runs": run_table(results),
    }


def timing(planned: list[Run], keys: Mapping[Case, str], place: Place) -> pd.DataFrame:
    """Measured seconds and memory of every run, which no table of results holds."""
    lines = []
    for case in dict.fromkeys(run.case for run in planned):
        found = finished(keys[case], place)
        if found is not None:
            pixels, batch = case.tsar.resolution_px**2, case.tsar.batch_size
            lines.append({"run": case.name, "batch": batch, "pixels": pixels, **found["machine"]})
    return pd.DataFrame(lines)


def _summary(
    options: SuitabilityOptions,
    planned: list[Run],
    keys: Mapping[Case, str],
    place: Place,
    failures: Mapping[Case, str],
    tables: Tables,
) -> dict[str, Any]:
    config = dataclasses.asdict(options)
    measured = timing(planned, keys, place)
    cases = {run.case for run in planned}
    seconds = (
        {name: math.fsum(measured[name].tolist()) for name in ("run_s", "jod_s", "reference_s")}
        if len(measured)
        else {}
    )
    runs_table = tables["runs"]
    return {
        "runs": len(cases),
        "runs_done": len(measured),
        "failures": {keys[case]: reason for case, reason in sorted(failures.items(), key=lambda one: keys[one[0]])},
        "invariants_ok": bool(len(runs_table) and runs_table["invariants_ok"].all()),
        "ledger": options.ledger,
        "display": options.display,
        "tables": {name: table.to_dict("records") for name, table in tables.items()},
        "seconds": seconds,
        "peak_memory_bytes": max(measured["peak_memory_bytes"].tolist(), default=0) if len(measured) else 0,
        "config": config,
        "provenance": provenance(config, device="cpu", seeds=sorted({run.repetition for run in planned})),
    }


def _cell(value: Any, digits: int) -> str:
    if isinstance(value, float):
        return "—" if math.isnan(value) else f"{value:.{digits}f}"
    return str(value)


def shown_tables(tables: Tables) -> dict[str, tuple[list[str], list[list[str]]]]:
    """Header and rows of text of the tables that people look at first."""
    percentiles, shown = tables["table_7_2"], {}
    names = [name for name in percentiles.columns if f"{name} thesis" in percentiles.columns]
    rows = [
        [f"{line['row']}", f"{line['batch']}", f"{line['side']}²"]
        + [f"{_cell(line[name], 0)} ({line[f'{name} thesis']:.0f})" for name in names]
        for line in percentiles.to_dict("records")
    ]
    shown["Greatest suitable percentile, ours (thesis)"] = (["row", "batch", "resolution", *names], rows)
    for title, name, digits in (
        ("Summary shares", "shares", 3),
        ("Policies, and their share of the oracle's gain", "policies", 4),
        ("Causes of the error", "causes", 5),
        ("Runs in which TSAR is better, by metric", "votes", 0),
        ("Agreement of metrics on the ranks of runs", "ranks", 3),
    ):
        shown[title] = _as_text(tables[name], digits)
    return shown


def _as_text(table: pd.DataFrame, digits: int) -> tuple[list[str], list[list[str]]]:
    body = [[_cell(value, digits) for value in line.values()] for line in table.to_dict("records")]
    return [str(column) for column in table.columns], body


def console_tables(tables: Tables) -> list[Table]:
    """The same for a terminal."""
    from rich.table import Table

    found = []
    for title, (header, rows) in shown_tables(tables).items():
        table = Table(title=title, title_justify="left")
        for column in header:
            table.add_column(column, justify="left" if column in ("input", "policy", "share", "metric") else "right")
        for row in rows:
            table.add_row(*row)
        found.append(table)
    return found


def write_page(path: Path, summary: Mapping[str, Any], tables: Tables, pictures: Mapping[str, Path]) -> None:
    """Writes ``report.html``."""
    from analysis.page.report import Report, Table, write_report

    config = summary["config"]
    pages = shown_tables(tables)
    pages["Causes of the error by region"] = _as_text(tables["regions"], 5)
    pages["Runs on which metrics disagree which renderer is better (1: TSAR)"] = _as_text(tables["disagreements"], 0)
    shown = [Table(title, header, rows) for title, (header, rows) in pages.items()]
    lead = [
        f"{summary['runs_done']} of {summary['runs']} runs at scale {config['scale']}, ledger {summary['ledger']}, "
        f"{config['repetitions']} repetitions, each with its seed and phase. The ratio is the mean squared error "
        f"of TSAR over that of the framed renderer at each reference time. A framed image of one sample a pixel is "
        f"shown {config['framed_rate_hz']:g} times a second.",
        f"JOD by ColorVideoVDP for the display {summary['display'].name} at {summary['display'].rate_hz:g} Hz, from "
        f"{config['jod_span_s'][0]:g} s to {config['jod_span_s'][1]:g} s of the first {config['jod_repetitions']} "
        "repetitions.",
    ]
    if summary["failures"]:
        lead.append(f"Failed: {'; '.join(f'{name}: {reason}' for name, reason in summary['failures'].items())}")
    write_report(
        path,
        Report(
            title="Suitability of TSAR",
            lead=lead,
            key_numbers=shown[0],
            figures=[(caption, file.read_bytes()) for caption, file in pictures.items()],
            tables=shown[1:],
            details={"Configuration": config, "Provenance": summary["provenance"]},
        ),
    )
