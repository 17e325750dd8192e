"""Compare TSAR with the framed renderer on several inputs, repeated over seeds or animation phases.

Examples: python scripts/inputs.py --out out/inputs
          python scripts/inputs.py fly-by --vary phase --out out/phases
"""

from __future__ import annotations

import dataclasses

from analysis.command.cli import bad_input, parse, require_unbroken
from analysis.command.ownership import own_folder
from analysis.comparison.experiment import run_experiment
from analysis.comparison.repetitions import InputsOptions, row
from analysis.comparison.stored import finished
from analysis.storage.files import plain, write_json


def main() -> None:
    """Runs what is missing, prints and writes a table of the ratios."""
    options = parse(InputsOptions, __doc__ or "")
    with bad_input():
        own_folder(options.out, "out")
        runs = options.runs()
    rows = []
    for run in runs:
        rows.append(row(run, finished(run) or plain(run_experiment(run))))
        low, high = rows[-1]["ratio_quartiles"]
        percentile = f"{rows[-1]['suitable_percentile']:.0f}"
        print(f"| {rows[-1]['run']} | {rows[-1]['ratio_median']:.3f} | {low:.3f} – {high:.3f} | {percentile} |")

    from analysis.storage.provenance import provenance

    config = dataclasses.asdict(options)
    source = provenance(config, seed=options.tsar.seed, device="cpu")
    write_json(
        options.out / "summary.json", {"ledger": options.ledger, "runs": rows, "config": config, "provenance": source}
    )
    require_unbroken([line["run"] for line in rows if not line["invariants_ok"]])
