"""Output of a study whose results are tables."""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Protocol

import pandas as pd

from analysis.command.cli import full_disk, require_unbroken
from analysis.command.console import Table, markdown, show, written_to
from analysis.storage.files import write_json, write_table, write_text
from analysis.storage.results import SUMMARY
from analysis.storage.summary import with_source
from analysis.study.outcomes import Outcomes

WRITTEN = ("tables/*.csv", "tables.md")
"""Files of every such study, beside ``summary.json``."""


class TableOptions(Protocol):
    """Options that a study with tables must have."""

    @property
    def out(self) -> Path: ...
    @property
    def markdown(self) -> bool: ...
    @property
    def repetitions(self) -> int: ...


def write_tables(out: Path, tables: Mapping[str, pd.DataFrame], shown: Sequence[Table] | None = None) -> None:
    """Writes tables as CSV files by name, and those that people read as Markdown where there are any."""
    for name, table in tables.items():
        write_table(out / "tables" / f"{name}.csv", table)
    if shown is not None:
        write_text(out / "tables.md", markdown(shown))


def end_study(summary: Mapping[str, Any], broken: Sequence[str], out: Path, files: str) -> None:
    """Prints the number of runs and the files beside ``summary.json``; ends with status 1 if runs failed.

    Raises:
        BrokenInvariants: ``broken`` names results whose cycles broke an invariant.
    """
    written, *page = written_to(out, f"{SUMMARY}, {files}")
    show(f"{summary['runs_done']} of {summary['runs']} runs; {written}", *page)
    require_unbroken(broken)
    if summary["failures"]:
        sys.exit(1)


def write_study(
    options: TableOptions,
    outcomes: Outcomes,
    tables: Mapping[str, pd.DataFrame],
    shown: Sequence[Table],
    broken: Sequence[str],
    **more: Any,
) -> dict[str, Any]:
    """Writes the tables of a study and its ``summary.json``, and prints the tables as text.

    Args:
        options: options of the study.
        outcomes: outcomes of its cases.
        tables: tables by name.
        shown: the tables as text.
        broken: names of results whose cycles broke an invariant unexpectedly.
        more: further entries of the summary.

    Returns:
        The content of ``summary.json``.

    Raises:
        InputError: the folder cannot be written to.
    """
    out = options.out.resolve()
    found = {
        "runs": len(outcomes.keys),
        "runs_done": len(outcomes.summaries()),
        "failures": dict(sorted(outcomes.reasons.items())),
        "broken_invariants": list(broken),
        **more,
        "tables": {name: table.to_dict("records") for name, table in tables.items()},
    }
    summary = with_source(found, options, outcomes.added, device="cpu", seeds=list(range(options.repetitions)))
    with full_disk(out):
        write_tables(out, tables, shown)
        write_json(out / SUMMARY, summary)
    show(*([markdown(shown)] if options.markdown else shown))
    return summary
