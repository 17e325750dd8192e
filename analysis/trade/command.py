"""Measure the trade of speed for accuracy: the cost of every knob and its effect on the error.

Each knob is turned alone, then a search turns all of them together. The results are a line for each point (trade.csv),
the Pareto front with its knee, a sentence for each knob, figures, and a page on which every point shows its setting and
its picture.

Examples: python scripts/trade.py --out out/trade
          python scripts/trade.py --inputs fly-by --knobs batch footprint --repetitions 1 --trials 0 --out out/two
          python scripts/trade.py --inputs chase scene.pbrt --camera-path turntable --out out/scenes
"""

from __future__ import annotations

from analysis.command.cli import parse
from analysis.command.extras import require_extra
from analysis.trade.options import TradeOptions


def main() -> None:
    """Makes missing runs; prints the tables."""
    options = parse(TradeOptions, __doc__ or "")
    options.farm.require_port()  # before slow imports
    require_extra("study", *(["search"] if options.trials else []))
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
