"""Measure point sets and draw figures 4, 5, 7 and 9 of the motion-blur perception thesis from them.

Example: python scripts/pointsets.py --out out/pointsets
"""

from __future__ import annotations

from analysis.command.cli import parse
from analysis.tracer.options import PointSetOptions


def main() -> None:
    """Parses, measures, draws, prints tables."""
    options = parse(PointSetOptions, __doc__ or "")
    from analysis.command.console import frame_table, show
    from analysis.tracer.point_sets import mean_errors
    from analysis.tracer.run import point_sets

    found = point_sets(options)
    middle = sorted(set(options.levels))[len(set(options.levels)) // 2]
    show(
        frame_table(found["evenness"].query("points == @middle"), f"evenness of {middle} points"),
        frame_table(mean_errors(found["errors"], middle), f"mean squared error of {middle} points"),
        frame_table(found["slopes"], "slopes of the MSE"),
        f"written to {options.out}",
    )
