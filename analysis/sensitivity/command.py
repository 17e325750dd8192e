"""Vary slopes, offsets and bias of the error estimate (figs 7.23–7.25): which are best, and how flat the optimum is.

Examples: python scripts/sensitivity.py --scale quick --out out/sensitivity
          python scripts/sensitivity.py --inputs fast-crossing --spatial-slopes -3 -2 -1 --offsets --biases
          python scripts/sensitivity.py --scale half --repetitions 3 --out out/sensitivity-half
"""

from __future__ import annotations

import dataclasses
import sys

from analysis.command.cli import bad_input, full_disk, parse, require_unbroken
from analysis.command.extras import require_extra
from analysis.command.ownership import own_folder, writable_folder
from analysis.sensitivity.options import SensitivityOptions
from analysis.sensitivity.runs import AXES, runs, sweeps
from analysis.sensitivity.tables import BEST, optimum_table, setting_table
from analysis.storage.files import atomic, write_json


def main() -> None:
    """Runs what is missing; writes tables and figures; prints what is best, and how flat it is."""
    options = parse(SensitivityOptions, __doc__ or "")
    require_extra("study", "perception")
    with bad_input():
        planned = runs(options)
        own_folder(options.out, "out")
        writable_folder(options.cache, "cache")
    import pandas as pd

    from analysis.command.progress import bars
    from analysis.sensitivity.plots import write_all
    from analysis.storage.provenance import provenance
    from analysis.study.evaluation import Place, broken, finished, times_of
    from analysis.study.farm import describe_failures, run_cases

    out, config = options.out.resolve(), dataclasses.asdict(options)
    place = Place(out / "runs", options.cache.resolve(), options.farm.threads)
    (out / "summary.json").unlink(missing_ok=True)
    with full_disk(out), bars() as show:
        place.results.mkdir(exist_ok=True)
        keys, failures = run_cases([run.case for run in planned], place, options.farm, show.task("runs", len(planned)))
    summaries = {run: finished(keys[run.case], place) for run in planned}
    done = {run: keys[run.case] for run, found in summaries.items() if found}
    missing = [run for run in planned if run not in done]
    failed = {f"{run.case.name} {run.setting or ''}".strip(): failures.get(run.case, "no result") for run in missing}
    for line in describe_failures(failed):  # at once: what follows may fail for the same reasons, such as a full disk
        print(line, file=sys.stderr)
    results = {run.place: times_of(key, place) for run, key in done.items()}
    tables = {"settings": setting_table(results, options), "optima": optimum_table(results, options)}
    stills = {run.setting: key for run, key in done.items() if run.place == (options.figure_input, run.setting, 0)}
    head = {"runs": len(planned), "runs_done": len(done), "failures": failed, "ledger": options.ledger}
    with full_disk(out):
        for name, lines in tables.items():
            with atomic(out / "tables" / f"{name}.csv") as temporary:
                pd.DataFrame(lines).to_csv(temporary, index=False)
        write_all(out / "figures", options, tables["settings"], sweeps(options)["slopes"], stills, place)
        source = provenance(config, device="cpu", seeds=list(range(options.repetitions)))
        write_json(out / "summary.json", {**head, **tables, "config": config, "provenance": source})
    for sweep, axes in AXES.items():
        part = pd.DataFrame([line for line in tables["optima"] if line["sweep"] == sweep])
        best = [name for name in ("input", *axes, *BEST) if name in part]
        flat = ["input", *(name for name in part if name not in (*best, "sweep"))]
        for title, names in (("best", best), ("flatness", flat)) if len(part) else ():
            shown = part[names].dropna(axis=1, how="all")
            text = shown.map(lambda value: f"{value:.3g}" if isinstance(value, float) else value).to_string(index=False)
            print(f"{sweep}, {title}\n{text}\n")
    print(f"{len(done)} of {len(planned)} runs; written to {options.out}: summary.json, tables/, figures/")
    require_unbroken(broken(summaries.values()))
    sys.exit(1 if failed else 0)
