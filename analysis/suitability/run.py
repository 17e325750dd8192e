"""Runs the suitability study and writes its tables, figures and page."""

from __future__ import annotations

import math
from typing import Any

import pandas as pd

from analysis.command.cli import bad_input, full_disk
from analysis.storage.files import write_json, write_table
from analysis.storage.results import SUMMARY
from analysis.storage.summary import with_source
from analysis.study.cases import ROWS, SCALES, Case
from analysis.study.evaluation import broken
from analysis.study.farm import run_study
from analysis.study.outcomes import Outcomes
from analysis.study.written import write_tables
from analysis.suitability import plots
from analysis.suitability.options import SuitabilityOptions
from analysis.suitability.page import shown_tables, write_page
from analysis.suitability.rivalry import groups_of, lead_table, metric_table, rival_table
from analysis.suitability.runs import Run, runs
from analysis.suitability.tables import (
    Results,
    RunResult,
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
    """Makes missing runs and writes everything to ``options.out``.

    Returns:
        The content of ``summary.json``, and the tables.

    Raises:
        InputError: the machine or the input cannot provide what the options ask for.
    """
    with bad_input():
        planned = runs(options)
    written = ("report.html", "timing.csv", "tables/*.csv", "tables.md", "figures/*.png")
    outcomes = run_study(options, [run.case for run in planned], written)
    outcomes.tell()
    out, done = options.out.resolve(), outcomes.summaries()
    results = Results([RunResult(run, done[run.case], outcomes.times(run.case)) for run in planned if run.case in done])
    tables, measured = tables_of(options, results), timing(done)
    with full_disk(out):
        write_tables(out, tables, shown_tables(tables))
        write_table(out / "timing.csv", measured)
        pictures = plots.write_all(out / "figures", options, results, outcomes.keys, outcomes.place)
        summary = _summary(options, planned, outcomes, measured, tables)
        summary["broken_invariants"] = broken(one.summary for one in results.all)
        write_page(out / "report.html", summary, tables, pictures)
        write_json(out / SUMMARY, summary)
    return summary, tables


def tables_of(options: SuitabilityOptions, results: Results) -> Tables:
    """Every table by name. Tables do not depend on the machine, the order of runs, or measured time."""
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


def timing(done: dict[Case, dict[str, Any]]) -> pd.DataFrame:
    """Measured seconds and memory of every run, which are in no table of results."""
    sizes = [{"run": case.name, "batch": case.tsar.batch_size, "pixels": case.tsar.resolution_px**2} for case in done]
    return pd.DataFrame([{**size, **found["machine"]} for size, found in zip(sizes, done.values(), strict=True)])


def _summary(
    options: SuitabilityOptions, planned: list[Run], outcomes: Outcomes, measured: pd.DataFrame, tables: Tables
) -> dict[str, Any]:
    seconds = (
        {name: math.fsum(measured[name].tolist()) for name in ("run_s", "jod_s", "reference_s")}
        if len(measured)
        else {}
    )
    runs_table = tables["runs"]
    found = {
        "runs": len(outcomes.keys),
        "runs_done": len(measured),
        "failures": dict(sorted(outcomes.reasons.items())),
        "invariants_ok": not len(runs_table) or bool(runs_table["invariants_ok"].all()),
        "ledger": options.ledger,
        "display": options.display,
        "tables": {name: table.to_dict("records") for name, table in tables.items()},
        "seconds": seconds,
        "peak_memory_bytes": max(measured["peak_memory_bytes"].tolist(), default=0) if len(measured) else 0,
    }
    return with_source(found, options, outcomes.added, device="cpu", seeds=sorted({run.repetition for run in planned}))
