"""Compare temporally and spatially adaptive rendering with a framed renderer at equal cost.

Example: python scripts/run.py fly-by --seconds 2 --out out/fly-by
"""

from __future__ import annotations

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from analysis.cli import parse, require_unbroken, run_cli
from analysis.experiment import run_experiment
from analysis.run_options import RunOptions
from analysis.start import process_began_s


def main() -> None:
    """Parses, runs, prints what came out and where it is."""
    options = parse(RunOptions, __doc__ or "")
    summary = run_experiment(options, process_began_s())

    from rich.table import Table

    from analysis.tables import console

    statistics = summary["ratio_statistics"]
    table = Table(title=f"{options.input}, ledger {summary['ledger']}", show_header=False, title_justify="left")
    rows = {
        "MSE ratio TSAR / framed, median": f"{statistics.median:.3f}",
        "quartiles": f"{statistics.quartile_low:.3f} – {statistics.quartile_high:.3f}",
        "at most 1": f"{100 * statistics.share_suitable:.0f} % of the time",
        "greatest suitable percentile": f"{statistics.suitable_percentile:.0f}",
        "cycles": f"{summary['cycles']}, {1e3 * summary['cycle_s']:.2f} ms each",
        "samples traced": f"{summary['samples_traced']:,}",
        "invariants": "hold in every cycle" if summary["invariants"]["ok"] else f"BROKEN: {summary['invariants']}",
        "non-finite values": str(sum(summary["nonfinite"].values())),
    }
    for name, value in rows.items():
        table.add_row(name, value)
    shown = console()
    shown.print(table)
    shown.print(f"written to {options.out}: summary.json, report.html, error.png, comparison.mp4, steps.parquet")
    require_unbroken([] if summary["invariants"]["ok"] else [options.input])


if __name__ == "__main__":
    run_cli(main)
