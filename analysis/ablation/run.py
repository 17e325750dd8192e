"""Runs the study of parts and writes its tables and figures."""

from __future__ import annotations

from typing import Any

import pandas as pd

from analysis.ablation.options import AblationOptions
from analysis.ablation.parts import WHOLE, Part, chosen_parts
from analysis.ablation.plots import figure
from analysis.ablation.runs import Run, rivals_of, runs
from analysis.ablation.shown import shown_tables
from analysis.ablation.tables import RunResult, budget_table, floor_table, moment_table, part_table
from analysis.command.cli import bad_input, full_disk
from analysis.page.figures import save
from analysis.storage.files import atomic, write_json
from analysis.storage.results import SUMMARY
from analysis.storage.summary import with_source
from analysis.study.evaluation import broken
from analysis.study.farm import run_study
from analysis.study.outcomes import Outcomes
from analysis.study.written import write_tables

Tables = dict[str, pd.DataFrame]
WRITTEN = ("tables/*.csv", "tables.md", "moments.parquet", "parts_row_*.png")


def study(options: AblationOptions) -> tuple[dict[str, Any], Tables]:
    """Makes missing runs and writes everything to ``options.out``.

    Returns:
        The content of ``summary.json``, and the tables.

    Raises:
        InputError: the machine or the input cannot provide what the options ask for.
    """
    with bad_input():
        parts = chosen_parts(options.parts)
        planned = runs(options, parts)
    outcomes = run_study(options, [run.case for run in planned], WRITTEN)
    outcomes.tell()
    done = outcomes.summaries()
    results = [RunResult(run, outcomes.times(run.case)) for run in planned if run.case in done]
    moments = moment_table(results, rivals_of(options))
    tables = {"parts": part_table(moments), "budget": budget_table(moments), "floor": floor_table(moments)}
    out = options.out.resolve()
    with full_disk(out):
        write_tables(out, tables, shown_tables(tables))
        with atomic(out / "moments.parquet") as file:
            moments.to_parquet(file)
        for row in sorted(set(tables["parts"]["row"])) if len(tables["budget"]) else ():
            save(figure(tables["parts"], tables["budget"], tables["floor"], row), out / f"parts_row_{row}.png")
        summary = _summary(options, parts, planned, outcomes, list(done.values()), tables)
        write_json(out / SUMMARY, summary)
    return summary, tables


def _summary(
    options: AblationOptions,
    parts: tuple[Part, ...],
    planned: list[Run],
    outcomes: Outcomes,
    made: list[dict[str, Any]],
    tables: Tables,
) -> dict[str, Any]:
    found = {
        "runs": len(outcomes.keys),
        "runs_done": len(made),
        "ledger": options.ledger,
        "parts": {WHOLE: {}} | {part.words: dict(part.options) for part in parts},
        "broken_invariants": broken(made),
        "tables": {name: table.to_dict("records") for name, table in tables.items()},
        "seconds": {name: sum(one["machine"][name] for one in made) for name in ("run_s", "reference_s")},
        "failures": outcomes.reasons,
    }
    return with_source(found, options, outcomes.added, device="cpu", seeds=sorted({run.repetition for run in planned}))
