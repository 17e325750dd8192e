"""Compare finished runs, also of different days and versions, on one page.

Example: python scripts/report.py out/monday out/friday --out out/both
"""

from __future__ import annotations

from analysis.command.cli import bad_input, full_disk, parse
from analysis.comparison.options import ReportOptions


def main() -> None:
    """Reads the runs, writes the page, prints the outcome."""
    options = parse(ReportOptions, __doc__ or "")
    from analysis.comparison.finished import named_folders, read_summary

    with bad_input():  # before slow imports
        for folder in named_folders(options.folders).values():
            read_summary(folder)
    from analysis.command.console import show, written_to
    from analysis.comparison.days import finished_runs, outcome_table, page_of
    from analysis.page.report import write_report
    from analysis.storage.results import own_results

    with bad_input():
        runs = finished_runs(options.folders)
        page = page_of(runs)
        own_results(options.out, ("report.html",))
    with full_disk(options.out):
        write_report(options.out / "report.html", page)
    for run in runs:
        if run.lack:
            show(run.lack)
    show(outcome_table(runs), *written_to(options.out, "report.html"))
