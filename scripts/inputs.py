"""Compare TSAR with the framed renderer on several inputs, repeated over seeds or animation phases.

Examples: python scripts/inputs.py --out out/inputs
          python scripts/inputs.py fly-by --vary phase --out out/phases
"""

from __future__ import annotations

import dataclasses
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from analysis.command.cli import bad_input, parse, require_unbroken, run_cli
from analysis.command.ownership import own_folder
from analysis.comparison.experiment import ROOT, finished, run_experiment
from analysis.comparison.repetitions import InputsOptions, row
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

    from analysis.storage.records import provenance

    config = dataclasses.asdict(options)
    source = provenance(ROOT, config, seed=options.tsar.seed, device="cpu")
    write_json(
        options.out / "summary.json", {"ledger": options.ledger, "runs": rows, "config": config, "provenance": source}
    )
    require_unbroken([line["run"] for line in rows if not line["invariants_ok"]])


if __name__ == "__main__":
    run_cli(main)
