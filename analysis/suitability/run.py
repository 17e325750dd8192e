"""Runs the suitability study and writes its tables, figures and page."""

from __future__ import annotations

import math
import sys
from collections.abc import Mapping
from typing import Any

import pandas as pd

from analysis.command.cli import bad_input, full_disk
from analysis.storage.files import write_json, write_table
from analysis.storage.summary import with_source
from analysis.study.cases import ROWS, SCALES, Case
from analysis.study.evaluation import Place, broken, finished, times_of
from analysis.study.farm import describe_failures, run_study
from analysis.suitability import plots
from analysis.suitability.options import SuitabilityOptions
from analysis.suitability.page import write_page
from analysis.suitability.rivalry import groups_of, lead_table, metric_table, rival_table
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
    written = ("report.html", "timing.csv", "tables/*.csv", "figures/*.png")
    place, keys, failures = run_study(options, [run.case for run in planned], written)
    out = options.out.resolve()
    # said at once: what follows may fail for the same reasons, such as a full disk
    for line in describe_failures({keys[case]: reason for case, reason in failures.items()}):
        print(line, file=sys.stderr)
    results = Results(collect(planned, keys, place))
    tables = tables_of(options, results)
    with full_disk(out):
        for name, table in tables.items():
            write_table(out / "tables" / f"{name}.csv", table)
        write_table(out / "timing.csv", timing(planned, keys, place))
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
    divisor = SCALES[options.scale].divisor
    side = ROWS[options.policy_row][1] // divisor
    rivals = tuple(dict.fromkeys(("framed", *options.rivals)))
    sides = {row: ROWS[row][1] // divisor for row in options.rows}
    groups = groups_of(results, sides, (*options.policies, *rivals))
    return {
        "judged": rival_table(groups, options.policies, rivals),
        "judged_metrics": metric_table(groups, options.policies, rivals),
        "rivals": rival_table(groups, rivals, rivals),
        "best_rival": lead_table(groups, rivals),
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
    measured = timing(planned, keys, place)
    cases = {run.case for run in planned}
    seconds = (
        {name: math.fsum(measured[name].tolist()) for name in ("run_s", "jod_s", "reference_s")}
        if len(measured)
        else {}
    )
    runs_table = tables["runs"]
    found = {
        "runs": len(cases),
        "runs_done": len(measured),
        "failures": {keys[case]: reason for case, reason in sorted(failures.items(), key=lambda one: keys[one[0]])},
        "invariants_ok": not len(runs_table) or bool(runs_table["invariants_ok"].all()),
        "ledger": options.ledger,
        "display": options.display,
        "tables": {name: table.to_dict("records") for name, table in tables.items()},
        "seconds": seconds,
        "peak_memory_bytes": max(measured["peak_memory_bytes"].tolist(), default=0) if len(measured) else 0,
    }
    return with_source(found, options, device="cpu", seeds=sorted({run.repetition for run in planned}))
