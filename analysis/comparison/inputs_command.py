"""Compare a policy, by default tsar, on several inputs, repeated over seeds or phases.

Examples: python scripts/inputs.py --out out/inputs
          python scripts/inputs.py fly-by --policy thesis --vary phase --out out/phases
"""

from __future__ import annotations

from analysis.command.cli import bad_input, parse, require_unbroken
from analysis.comparison.experiment import run_experiment
from analysis.comparison.repetitions import InputsOptions, ratio_table, row
from analysis.comparison.stored import added_by, finished
from analysis.storage.files import plain
from analysis.storage.results import own_results


def main() -> None:
    """Makes missing runs, prints and writes a table of the ratios."""
    options = parse(InputsOptions, __doc__ or "")
    with bad_input():
        own_results(options.out, ())
        runs = options.runs()
    rows = [row(run, finished(run) or plain(run_experiment(run))) for run in runs]
    from analysis.command.console import show
    from analysis.storage.summary import write_summary

    found = {"ledger": options.ledger, "runs": rows}
    added = list(dict.fromkeys(one for run in runs for one in added_by(run)))
    write_summary(options.out, found, options, added, seed=options.tsar.seed, device="cpu")
    show(ratio_table(rows), f"written to {options.out}: summary.json, a folder a run")
    require_unbroken([line["run"] for line in rows if not line["invariants_ok"]])
