"""Compare a policy, by default tsar, with its rivals at equal cost.

Examples: python scripts/run.py fly-by --seconds 2 --out out/fly-by
          python scripts/run.py chase --preset draft --resolution-px 256 --out out/draft
          python scripts/run.py chase --budget-flops 1e11 --out out/cheap
"""

from __future__ import annotations

from analysis.command.cli import parse, require_unbroken
from analysis.command.start import process_began_s
from analysis.comparison.experiment import run_experiment
from analysis.comparison.options import RunOptions


def main() -> None:
    """Parses, runs, prints the outcome and the place of the files."""
    options = parse(RunOptions, __doc__ or "")
    options.require_found(options.input)
    summary = run_experiment(options, process_began_s())

    from analysis.command.console import Table, show, written_to
    from analysis.comparison.tables import run_tables, said_of

    rows = {}
    if options.metrics is None and "jod" not in summary["metrics"]:
        rows["JOD"] = f"not taken: {options.reference_rate_hz:g} Hz on a display of {options.display.rate_hz:g} Hz"
    checked = summary["invariants"]
    of = "" if checked is None or checked["runs"] == [summary["policy"]] else f" of {', '.join(checked['runs'])}"
    rows |= {
        "cycles": f"{summary['cycles']}, {1e3 * summary['cycle_s']:.2f} ms each",
        "samples traced": f"{summary['samples_traced']:,}",
        f"invariants{of}": said_of(checked, "hold in every cycle"),
        "non-finite values": str(sum(summary["nonfinite"].values())),
    }
    files = ", ".join(["summary.json", *summary["files"]])
    title = f"{options.input}: {summary['policy']} beside rivals at equal cost, ledger {summary['ledger']}"
    parts: list[Table | str] = [*run_tables(summary, title), Table("", ("", ""), list(rows.items()), words=2)]
    if summary["choice"]:
        from analysis.comparison.choosing import choice_table

        parts.append(choice_table(summary["choice"]))
    parts += [options.pace] if options.pace else []
    show(*parts, *written_to(options.out, files))
    require_unbroken([] if checked is None or checked["ok"] else [options.input])
