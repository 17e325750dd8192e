"""Measure the worth of each part of the policy tsar, the terms of its error, and its distance to a perfect picture.

Each run leaves one part out, or changes one number, on the five inputs. The error of the whole policy is divided into
latency, blur, disocclusion, shadows and aliasing, and compared with that of a perfect picture of the same latency.

Examples: python scripts/ablation.py --out out/ablation
          python scripts/ablation.py --inputs fly-by --parts jitter smoothing --repetitions 1 --rivals --out out/two
          python scripts/ablation.py --scale half --rows 7 8 --markdown --out out/ablation-half
"""

from __future__ import annotations

from analysis.ablation.options import AblationOptions
from analysis.command.cli import parse
from analysis.command.extras import require_extra


def main() -> None:
    """Makes missing runs; prints the tables."""
    options = parse(AblationOptions, __doc__ or "")
    options.farm.require_port()  # before slow imports
    require_extra("study")
    from analysis.ablation.run import study
    from analysis.ablation.shown import shown_tables
    from analysis.command.console import markdown, show
    from analysis.study.written import end_study

    summary, tables = study(options)
    shown = shown_tables(tables)
    show(*([markdown(shown)] if options.markdown else shown))
    end_study(
        summary, summary["broken_invariants"], options.out, "tables/, tables.md, moments.parquet, parts_row_*.png"
    )
