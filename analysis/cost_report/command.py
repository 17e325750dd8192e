"""Report the cost of an adaptive cycle and of a framed image: by the model of table 7.1, and on this machine.

Examples: python scripts/cost_report.py --out out/cost
          python scripts/cost_report.py --no-measure --ledger summed --batch-size 256 --out out/summed
"""

from __future__ import annotations

from analysis.command.cli import parse
from analysis.cost_report.options import CostReportOptions


def main() -> None:
    """Parses, evaluates, measures, prints tables and the place of the files."""
    options = parse(CostReportOptions, __doc__ or "")
    from analysis.command.console import show
    from analysis.cost_report.run import write_report
    from analysis.cost_report.tables import tables

    summary = write_report(options)
    show(*tables(summary))
    rows = ", ".join(f"{batch} at {side}²" for batch, side in summary["admitted"])
    segments = f"{options.admitted_segments:g} segments"
    show(f"admitted at {segments}, ledger {options.ledger}: {len(summary['admitted'])} rows: {rows or 'none'}")
    crossing = summary["crossing_batch"]
    show(f"equal cost at batch {'none' if crossing is None else f'{crossing:,.1f}'}")
    names = ", ".join(sorted(path.name for path in options.out.iterdir() if path.suffix in (".png", ".vtp", ".json")))
    show(f"written to {options.out}: {names}")
