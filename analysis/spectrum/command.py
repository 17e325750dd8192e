"""Measure the assumptions of the error estimate.

These are the power-spectrum slopes of frames, framelets and pictures (figs 1.3, 1.4), the ideal sample density of a
tile (figs 5.3–5.5), and the agreement of the streaming estimate with it.

Examples: python scripts/spectrum.py --out out/spectrum
          python scripts/spectrum.py photograph.jpg render.exr --only slopes
"""

from __future__ import annotations

from analysis.command.cli import parse, require_files
from analysis.spectrum.options import SpectrumOptions


def main() -> None:
    """Parses, measures, prints the outcome and the place of the files."""
    options = parse(SpectrumOptions, __doc__ or "")
    require_files(*options.images)
    from analysis.command.console import show
    from analysis.spectrum.run import run_study
    from analysis.spectrum.tables import tables

    summary = run_study(options)
    names = ", ".join(sorted(path.name for path in options.out.iterdir() if path.suffix in (".png", ".json")))
    show(*tables(summary), f"written to {options.out}: {names}")
