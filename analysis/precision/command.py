"""Measure the cost of fewer bits: everything that a policy keeps, and textures, in formats down to 8 bits.

Each run holds one kind of value, or all of them, in another format between the stages, on the five inputs. The report
has the error over that of the unchanged policy, and the first batch that differs. Arithmetic stays float32, except in
runs in float64.

Examples: python scripts/precision.py --out out/precision
          python scripts/precision.py --inputs fly-by --policies tsar --kept colors variances --out out/two
          python scripts/precision.py --scale half --repetitions 3 --markdown --out out/precision-half
"""

from __future__ import annotations

from typing import Any

from analysis.command.cli import bad_input, parse
from analysis.command.extras import require_extra
from analysis.precision.options import PrecisionOptions


def main() -> None:
    """Makes missing runs; prints the tables."""
    options = parse(PrecisionOptions, __doc__ or "")
    options.farm.require_port()  # before slow imports
    require_extra("study")
    from analysis.study.written import end_study

    summary = study(options)
    end_study(summary, summary["broken_invariants"], options.out, "tables/, tables.md")


def study(options: PrecisionOptions) -> dict[str, Any]:
    """Makes missing runs, writes everything to ``options.out`` and prints the tables. Returns the content of
    ``summary.json``.

    Raises:
        InputError: the machine or the input cannot provide what the options ask for.
    """
    from analysis.precision.runs import OWN, runs
    from analysis.precision.tables import RunResult, format_table, least_safe, run_table, shown_tables
    from analysis.study.evaluation import broken
    from analysis.study.farm import run_study
    from analysis.study.written import WRITTEN, write_study

    with bad_input():
        planned = runs(options)
    outcomes = run_study(options, [run.case for run in planned], WRITTEN)
    outcomes.tell()
    done = outcomes.summaries()
    made = [run for run in planned if run.case in done]
    lines = run_table(
        RunResult(
            run,
            float(outcomes.times(run.case)["mse"].to_numpy().mean()),
            done[run.case]["asked"],
            bool(broken([done[run.case]])),
        )
        for run in made
    )
    formats = format_table(lines, options.tolerance)
    tables = {"runs": lines, "formats": formats, "safe": least_safe(formats)}
    own = broken(done[run.case] for run in made if run.form == OWN)
    return write_study(options, outcomes, tables, shown_tables(formats, options.tolerance), own)
