"""Measure the trade of speed for accuracy: what every knob costs and what it does to the error.

Each knob is turned alone, then a search turns all of them together. Out come a line a point (trade.csv), the front of
the settings that nothing beats with its knee, a sentence a knob, figures, and a page on which every point shows its
setting and its picture.

Examples: python scripts/trade.py --out out/trade
          python scripts/trade.py --inputs fly-by --knobs batch footprint --repetitions 1 --trials 0 --out out/two
          python scripts/trade.py --inputs chase scene.pbrt --camera-path turntable --out out/scenes
"""

from __future__ import annotations

from analysis.command.cli import parse
from analysis.command.extras import require_extra
from analysis.trade.options import TradeOptions


def main() -> None:
    """Runs what is missing; prints the tables."""
    options = parse(TradeOptions, __doc__ or "")
    require_extra("study", "perception", *(["search"] if options.trials else []))
    from analysis.command.console import markdown, show
    from analysis.study.written import end_study
    from analysis.trade.run import trade
    from analysis.trade.shown import shown_tables

    summary, tables = trade(options)
    shown = shown_tables(tables)
    show(*([markdown(shown)] if options.markdown else shown))
    for setting, reason in summary["dropped"].items():
        show(f"left out at this scale: {setting}: {reason}")
    end_study(summary, summary["broken_invariants"], options.out, "trade.csv, report.html, tables/, tables.md, figures")
