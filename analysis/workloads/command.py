"""Draw the map of workloads: which policy to use where, by what a sample costs, how much moves, and the resolution.

The machine is always as fast as the framed renderer needs to keep its rate. The cheaper a sample, the more samples are
displaced by a policy's own work; the fewer framed images a second, the more moves from one to the next.

Examples: python scripts/workloads.py --out out/workloads
          python scripts/workloads.py --inputs fly-by --sample-flops 100 10000 --image-hz 8 --out out/two
          python scripts/workloads.py --sides-px 256 512 1024 --scale half --markdown --out out/workloads-half
"""

from __future__ import annotations

import sys
from typing import Any

from analysis.command.cli import bad_input, full_disk, parse, require_unbroken
from analysis.command.extras import require_extra
from analysis.workloads.options import WorkloadOptions

WRITTEN = ("tables/*.csv", "tables.md", "map.png")


def main() -> None:
    """Runs what is missing; prints the tables."""
    options = parse(WorkloadOptions, __doc__ or "")
    require_extra("study", "perception")
    from analysis.command.console import show

    summary = study(options)
    written = f"written to {options.out}: summary.json, tables/, tables.md, map.png"
    show(f"{summary['runs_done']} of {summary['runs']} runs; {written}")
    require_unbroken(summary["broken_invariants"])
    if summary["failures"]:
        sys.exit(1)


def study(options: WorkloadOptions) -> dict[str, Any]:
    """Runs what is missing, writes everything to ``options.out`` and prints the tables. Returns what ``summary.json``
    holds.

    Raises:
        InputError: something asked for cannot be had.
    """
    from analysis.command.console import markdown, show
    from analysis.page.figures import save
    from analysis.storage.files import atomic, write_json, write_table
    from analysis.storage.summary import with_source
    from analysis.study.evaluation import broken
    from analysis.study.farm import run_study
    from analysis.workloads.plots import figure
    from analysis.workloads.runs import runs
    from analysis.workloads.tables import Result, map_table, paying_table, policy_table, shown_tables

    with bad_input():
        planned = runs(options)
    outcomes = run_study(options, list(dict.fromkeys(run.case for run in planned if run.case)), WRITTEN)
    outcomes.tell()
    done = outcomes.summaries()
    errors = {case: float(outcomes.times(case)["mse"].to_numpy().mean()) for case in done}
    policies = policy_table(
        Result(run, errors.get(run.case, float("nan")) if run.case else float("nan")) for run in planned
    )
    tables = {"policies": policies, "map": map_table(policies), "pays": paying_table(policies)}
    shown = shown_tables(tables["map"], tables["pays"])
    out = options.out.resolve()
    with full_disk(out):
        for name, table in tables.items():
            write_table(out / "tables" / f"{name}.csv", table)
        with atomic(out / "tables.md") as file:
            file.write_text(markdown(shown), encoding="utf-8")
        if len(tables["map"]):
            save(figure(tables["map"]), out / "map.png")
        found = {
            "runs": len(outcomes.keys),
            "runs_done": len(done),
            "impossible": sum(run.case is None for run in planned),
            "failures": dict(sorted(outcomes.reasons.items())),
            "broken_invariants": broken(done.values()),
            "tables": {name: table.to_dict("records") for name, table in tables.items()},
        }
        summary = with_source(found, options, device="cpu", seeds=list(range(options.repetitions)))
        write_json(out / "summary.json", summary)
    show(*([markdown(shown)] if options.markdown else shown))
    return summary
