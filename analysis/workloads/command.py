"""Draw the map of workloads: the best policy by the price of a sample, the amount of motion, and the resolution.

The machine is always as fast as the framed renderer needs to keep its rate. The cheaper a sample, the more samples a
policy gives up for its own work; the fewer framed images a second, the more moves from one to the next.

Examples: python scripts/workloads.py --out out/workloads
          python scripts/workloads.py --inputs fly-by --sample-flops 100 10000 --image-hz 8 --out out/two
          python scripts/workloads.py --sides-px 256 512 1024 --scale half --markdown --out out/workloads-half
"""

from __future__ import annotations

from typing import Any

from analysis.command.cli import bad_input, full_disk, parse
from analysis.command.extras import require_extra
from analysis.workloads.options import WorkloadOptions


def main() -> None:
    """Makes missing runs; prints the tables."""
    options = parse(WorkloadOptions, __doc__ or "")
    options.farm.require_port()  # before slow imports
    require_extra("study")
    from analysis.study.written import end_study

    summary = study(options)
    end_study(summary, summary["broken_invariants"], options.out, "tables/, tables.md, map.png")


def study(options: WorkloadOptions) -> dict[str, Any]:
    """Makes missing runs, writes everything to ``options.out`` and prints the tables. Returns the content of
    ``summary.json``.

    Raises:
        InputError: the machine or the input cannot provide what the options ask for.
    """
    from analysis.page.figures import save
    from analysis.study.evaluation import broken
    from analysis.study.farm import run_study
    from analysis.study.written import WRITTEN, write_study
    from analysis.workloads.plots import figure
    from analysis.workloads.runs import runs
    from analysis.workloads.tables import RunResult, map_table, paying_table, policy_table, shown_tables

    with bad_input():
        planned = runs(options)
    written = (*WRITTEN, "map.png")
    outcomes = run_study(options, list(dict.fromkeys(run.case for run in planned if run.case)), written)
    outcomes.tell()
    done = outcomes.summaries()
    errors = {case: float(outcomes.times(case)["mse"].to_numpy().mean()) for case in done}
    policies = policy_table(
        RunResult(run, errors.get(run.case, float("nan")) if run.case else float("nan")) for run in planned
    )
    tables = {"policies": policies, "map": map_table(policies), "pays": paying_table(policies)}
    shown = shown_tables(tables["map"], tables["pays"])
    if len(tables["map"]):
        with full_disk(options.out.resolve()):
            save(figure(tables["map"]), options.out.resolve() / "map.png")
    impossible = sum(run.case is None for run in planned)
    return write_study(options, outcomes, tables, shown, broken(done.values()), impossible=impossible)
