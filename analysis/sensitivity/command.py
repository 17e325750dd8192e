"""Vary slopes, offsets and bias of the error estimate (figs 7.23–7.25): best values, and flatness of the optimum.

Examples: python scripts/sensitivity.py --scale quick --out out/sensitivity
          python scripts/sensitivity.py --inputs fast-crossing --spatial-slopes -3 -2 -1 --offsets --biases
          python scripts/sensitivity.py --scale half --repetitions 3 --out out/sensitivity-half
"""

from __future__ import annotations

from analysis.command.cli import parse
from analysis.command.extras import require_extra
from analysis.sensitivity.options import SensitivityOptions


def main() -> None:
    """Makes missing runs; prints the best settings, and the flatness of the optimum."""
    options = parse(SensitivityOptions, __doc__ or "")
    options.farm.require_port()  # before slow imports
    require_extra("study")
    from analysis.command.console import show
    from analysis.sensitivity.run import study
    from analysis.sensitivity.tables import shown_tables
    from analysis.study.written import end_study

    summary, broken = study(options)
    show(*shown_tables(summary["optima"]))
    end_study(summary, broken, options.out, "tables/, tables.md, figures/")
