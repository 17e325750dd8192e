"""Measure the speed of the simulator beside Embree, Mitsuba 3 and PyWavelets, and the overhead of its stages.

Examples: python scripts/bench.py --out out/bench
          python scripts/bench.py --only coherent,incoherent --out out/rays
          python scripts/bench.py --compare out/before/bench.json out/after/bench.json
"""

from __future__ import annotations

from analysis.bench.options import BenchOptions
from analysis.command.cli import bad_input, parse


def main() -> None:
    """Parses, measures or compares, and prints one table."""
    options = parse(BenchOptions, __doc__ or "")
    from analysis.bench.tables import comparison_table, rows_table
    from analysis.command.console import show

    if options.compare is not None:
        with bad_input():
            table = comparison_table(*options.compare)
        show(table)
        return
    from analysis.bench.run import run_bench

    ending = options.file_ending
    files = f"bench{ending}.json, tables.md, summary{ending}.json"
    show(rows_table(run_bench(options)), f"written to {options.out}: {files}")
