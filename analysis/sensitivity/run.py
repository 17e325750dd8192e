"""Runs the sensitivity study and writes its tables and figures."""

from __future__ import annotations

import sys
from typing import Any

import pandas as pd

from analysis.command.cli import bad_input, full_disk
from analysis.sensitivity.options import SensitivityOptions
from analysis.sensitivity.plots import write_all
from analysis.sensitivity.runs import runs, sweeps
from analysis.sensitivity.tables import optimum_table, setting_table, shown_tables
from analysis.storage.summary import write_summary
from analysis.study.evaluation import broken
from analysis.study.farm import describe_failures, run_study
from analysis.study.written import WRITTEN, write_tables


def study(options: SensitivityOptions) -> tuple[dict[str, Any], list[str]]:
    """Makes missing runs and writes everything to ``options.out``.

    Returns:
        The content of ``summary.json``, and names of the results whose cycles broke an invariant.

    Raises:
        InputError: the machine or the input cannot provide what the options ask for.
    """
    with bad_input():
        planned = runs(options)
    outcomes = run_study(options, [run.case for run in planned], (*WRITTEN, "figures/*.png"))
    out, summaries = options.out.resolve(), outcomes.summaries()
    done = [run for run in planned if run.case in summaries]
    failed = {
        f"{run.case.name} {run.setting or ''}".strip(): outcomes.failures.get(run.case, "no result")
        for run in planned
        if run.case not in summaries
    }
    for line in describe_failures(failed):  # at once: later steps may fail for the same reason
        print(line, file=sys.stderr)
    results = {run.place: outcomes.times(run.case) for run in done}
    tables = {"settings": setting_table(results, options), "optima": optimum_table(results, options)}
    shown = [run for run in done if run.place == (options.figure_input, run.setting, 0)]
    stills = {run.setting: outcomes.keys[run.case] for run in shown}
    head = {"runs": len(planned), "runs_done": len(done), "failures": failed, "ledger": options.ledger}
    with full_disk(out):
        frames = {name: pd.DataFrame(lines) for name, lines in tables.items()}
        write_tables(out, frames, shown_tables(tables["optima"]))
        write_all(out / "figures", options, tables["settings"], sweeps(options)["slopes"], stills, outcomes.place)
        seeds = list(range(options.repetitions))
        summary = write_summary(out, {**head, **tables}, options, outcomes.added, device="cpu", seeds=seeds)
    return summary, broken(summaries.values())
