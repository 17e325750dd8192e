"""Run the suitability study: five inputs at sixteen settings, over seeds and phases, beside the thesis' results.

Examples: python scripts/suitability.py --scale quick --out out/study-quick
          python scripts/suitability.py --inputs fly-by --rows 6 7 8 --scale half --out out/fly-by
          python scripts/suitability.py --scale thesis --scheduler tcp://host:8786 --out /shared/study
"""

from __future__ import annotations

from analysis.command.cli import parse
from analysis.command.extras import require_extra
from analysis.suitability.options import SuitabilityOptions


def main() -> None:
    """Makes missing runs; prints the tables."""
    options = parse(SuitabilityOptions, __doc__ or "")
    options.farm.require_port()  # before slow imports
    require_extra("study")
    from analysis.command.console import show
    from analysis.study.written import end_study
    from analysis.suitability.page import shown_tables
    from analysis.suitability.run import study

    summary, tables = study(options)
    show(*shown_tables(tables))
    end_study(summary, summary["broken_invariants"], options.out, "tables/, tables.md, figures/, report.html")
