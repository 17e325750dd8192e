"""Runs the study of parts and writes its tables and figures."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from typing import Any

import pandas as pd

from analysis.ablation.options import AblationOptions
from analysis.ablation.parts import WHOLE, Part, chosen_parts
from analysis.ablation.plots import figure
from analysis.ablation.runs import Run, rivals_of, runs
from analysis.ablation.shown import shown_tables
from analysis.ablation.tables import Result, budget_table, floor_table, moment_table, part_table
from analysis.command.cli import bad_input, full_disk
from analysis.command.console import markdown
from analysis.page.figures import save
from analysis.storage.files import atomic, write_json, write_table
from analysis.storage.summary import with_source
from analysis.study.cases import Case
from analysis.study.evaluation import broken, finished, times_of
from analysis.study.farm import describe_failures, run_study

Tables = dict[str, pd.DataFrame]
WRITTEN = ("tables/*.csv", "tables.md", "moments.parquet", "parts_row_*.png")


def study(options: AblationOptions) -> tuple[dict[str, Any], Tables]:
    """Runs what is missing and writes everything to ``options.out``.

    Returns:
        What is in ``summary.json``, and the tables.

    Raises:
        InputError: something asked for cannot be had.
    """
    with bad_input():
        parts = chosen_parts(options.parts)
        planned = runs(options, parts)
    place, keys, failures = run_study(options, [run.case for run in planned], WRITTEN)
    for line in describe_failures({keys[case]: reason for case, reason in failures.items()}):
        print(line, file=sys.stderr)
    summaries = {case: finished(key, place) for case, key in keys.items()}
    done = [Result(run, times_of(keys[run.case], place)) for run in planned if summaries[run.case] is not None]
    moments = moment_table(done, rivals_of(options))
    tables = {"parts": part_table(moments), "budget": budget_table(moments), "floor": floor_table(moments)}
    out = options.out.resolve()
    with full_disk(out):
        for name, table in tables.items():
            write_table(out / "tables" / f"{name}.csv", table)
        with atomic(out / "moments.parquet") as file:
            moments.to_parquet(file)
        with atomic(out / "tables.md") as file:
            file.write_text(markdown(shown_tables(tables)), encoding="utf-8")
        for row in sorted(set(tables["parts"]["row"])) if len(tables["budget"]) else ():
            save(figure(tables["parts"], tables["budget"], tables["floor"], row), out / f"parts_row_{row}.png")
        summary = _summary(options, parts, planned, summaries, tables)
        summary["failures"] = {keys[case]: reason for case, reason in failures.items()}
        write_json(out / "summary.json", summary)
    return summary, tables


def _summary(
    options: AblationOptions,
    parts: tuple[Part, ...],
    planned: list[Run],
    summaries: Mapping[Case, Mapping[str, Any] | None],
    tables: Tables,
) -> dict[str, Any]:
    made = [one for one in summaries.values() if one is not None]
    found = {
        "runs": len(summaries),
        "runs_done": len(made),
        "ledger": options.ledger,
        "parts": {WHOLE: {}} | {part.words: dict(part.options) for part in parts},
        "broken_invariants": broken(made),
        "tables": {name: table.to_dict("records") for name, table in tables.items()},
        "seconds": {name: sum(one["machine"][name] for one in made) for name in ("run_s", "reference_s")},
    }
    return with_source(found, options, device="cpu", seeds=sorted({run.repetition for run in planned}))
