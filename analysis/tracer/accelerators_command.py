"""Compare brute force, kd-tree and tree of boxes by the cost of a ray, or render the ray-tracer report's two images.

Examples: python scripts/accelerators.py --out out/accelerators
          python scripts/accelerators.py --image report-one report-two --out out/report
          python scripts/accelerators.py --image report-one --image-scale 0.2 --out out/report-small
"""

from __future__ import annotations

from analysis.command.cli import parse
from analysis.tracer.options import AcceleratorOptions


def main() -> None:
    """Parses, measures or renders, prints a table or the cost of each image."""
    options = parse(AcceleratorOptions, __doc__ or "")
    import pandas as pd

    from analysis.command.console import frame_table, show
    from analysis.tracer.accelerators import lines
    from analysis.tracer.run import accelerators

    found = accelerators(options)
    shown = lines(found["images"]) if options.image else [frame_table(pd.DataFrame(found["rows"]))]
    show(*shown, f"written to {options.out}")
