"""Compare a policy, by default tsar, with its rivals at equal cost.

Examples: python scripts/run.py fly-by --seconds 2 --out out/fly-by
          python scripts/run.py chase --preset draft --resolution-px 256 --out out/draft
          python scripts/run.py chase --budget-flops 1e11 --out out/cheap
"""

from __future__ import annotations

import statistics

from analysis.command.cli import bad_input, parse, require_unbroken
from analysis.command.start import first_imports, process_began_s
from analysis.comparison.experiment import run_experiment
from analysis.comparison.options import RunOptions


def main() -> None:
    """Parses, runs, prints the outcome and the place of the files."""
    options = parse(RunOptions, __doc__ or "")
    with first_imports(), bad_input():
        from scenes import catalog

        catalog.require_known(options.input)  # before slow imports
    summary = run_experiment(options, process_began_s())

    from analysis.command.console import Table, show
    from analysis.comparison.tables import said_of

    title = f"{options.input}: {summary['policy']}, ledger {summary['ledger']}"
    medians = {name: statistics.median(errors) for name, errors in summary["mse"].items()}
    rows = {"MSE, median": ", ".join(f"{name} {value:.2g}" for name, value in medians.items())}
    for rival, found in summary.get("ratio_statistics", {}).items():
        low, high = found.quartile_low, found.quartile_high
        rows[f"MSE ratio to {rival}, median"] = f"{found.median:.3f} (quartiles {low:.3f} – {high:.3f})"
        rows[f"at most that of {rival}"] = f"{100 * found.share_suitable:.0f} % of the time"
        rows[f"greatest suitable percentile to {rival}"] = f"{found.suitable_percentile:.0f}"
    if "best_rival" in summary:
        found = summary["best_rival"]["ratio_statistics"]
        rows["MSE ratio to the best rival, median"] = f"{found.median:.3f}"
        rows["at most that of the best rival"] = f"{100 * found.share_suitable:.0f} % of the time"
    for metric, values in summary["metrics"].items():
        rows[metric] = ", ".join(f"{name} {value:.4f}" for name, value in values.items())
    untaken = [name for name in ("flip", "jod") if name not in summary["metrics"]]
    if untaken:
        rows[" and ".join(untaken)] = f"not taken; add --metrics {' '.join(untaken)} (extra perception)"
    checked = summary["invariants"]
    of = "" if checked is None or checked["runs"] == [summary["policy"]] else f" of {', '.join(checked['runs'])}"
    rows |= {
        "cycles": f"{summary['cycles']}, {1e3 * summary['cycle_s']:.2f} ms each",
        "samples traced": f"{summary['samples_traced']:,}",
        f"invariants{of}": said_of(checked, "hold in every cycle"),
        "non-finite values": str(sum(summary["nonfinite"].values())),
    }
    files = ", ".join(["summary.json", *summary["files"]])
    parts: list[Table | str] = [Table(title, ("", ""), list(rows.items()), words=2)]
    if summary["choice"]:
        from analysis.comparison.choosing import choice_table

        parts.append(choice_table(summary["choice"]))
    page = (options.out / "report.html").resolve().as_uri()
    parts += [options.pace] if options.pace else []
    show(*parts, f"written to {options.out}: {files}", f"look at it: {page}")
    require_unbroken([] if checked is None or checked["ok"] else [options.input])
