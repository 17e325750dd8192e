"""Render converted scenes with Mitsuba 3 and LuxCore and compare their pictures.

Examples: python scripts/conversion_check.py scene.xml other.lxs --out out/conversion-check
          python scripts/conversion_check.py --markers
          python scripts/conversion_check.py --matrix --samples 64
          python scripts/conversion_check.py --mutations 20000 scene.xml --root .
"""

from __future__ import annotations

from analysis.command.cli import parse
from analysis.command.extras import require_extra
from analysis.conversion.options import FORMATS_OF, CheckOptions


def main() -> None:
    """Parses, converts, renders, prints the tables."""
    options = parse(CheckOptions, __doc__ or "")
    require_extra("formats", "peers")
    if options.mutations or (options.matrix and "usd" in (options.formats or FORMATS_OF)):
        require_extra("usd")
    from analysis.command.console import show
    from analysis.conversion.run import check

    show(*check(options), f"written to {options.out}")
