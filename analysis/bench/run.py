"""Runs the requested groups of the benchmark and writes their measurements."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from analysis.bench.bits import bits
from analysis.bench.conversion import conversion
from analysis.bench.features import features
from analysis.bench.growth import growth
from analysis.bench.large import large
from analysis.bench.machine import machine, versions
from analysis.bench.options import ON_CPU_ONLY, BenchOptions
from analysis.bench.overhead import overhead
from analysis.bench.peers import missing_peers
from analysis.bench.policy import policy
from analysis.bench.rays import coherent, incoherent
from analysis.bench.rows import SPREAD, Group, Row
from analysis.bench.scenes import driving_scenes
from analysis.bench.shading import shaded
from analysis.bench.start import start_rows
from analysis.bench.tables import group_tables
from analysis.bench.threads import cores, hits, order
from analysis.command import progress
from analysis.command.cli import bad_input, full_disk
from analysis.command.console import markdown
from analysis.storage.files import write_json, write_text
from analysis.storage.results import own_results
from analysis.storage.summary import with_source

TABLES = "tables.md"
MEASURED_BY: Mapping[str, Group] = {
    "coherent": coherent,
    "incoherent": incoherent,
    "shaded": shaded,
    "cores": cores,
    "order": order,
    "hits": hits,
    "features": features,
    "overhead": overhead,
    "tsar": policy,
    "bits": bits,
    "growth": growth,
    "large": large,
    "conversion": conversion,
    "start": start_rows,
}


def run_bench(options: BenchOptions) -> dict[str, Any]:
    """Measures and writes ``bench.json`` after each group, ``summary.json`` at the end.

    Returns:
        The content of ``bench.json``: ``rows``, and the machine and versions on which they were measured.

    Raises:
        InputError: the machine or the input cannot provide what the options ask for.
    """
    with bad_input():
        own_results(options.out, (f"bench{options.file_ending}.json", f"summary{options.file_ending}.json", TABLES))
        driving_scenes(options)
        from renderer.compute.device import pick, use_instructions

        pick(options.device)
        use_instructions(options.isa)
    ending = options.file_ending
    summary = options.out / f"summary{ending}.json"
    summary.unlink(missing_ok=True)
    place = {
        "device": options.device,
        "isa": options.isa,
        "machine": machine(options.device),
        "versions": versions(),
        "spread": SPREAD,
    }
    rows: list[Row] = []
    found: dict[str, Any] = {**place, "rows": []}
    groups = [name for name in options.groups if options.device == "cpu" or name not in ON_CPU_ONLY]
    with progress.bars() as bars, full_disk(options.out):
        for line in missing_peers(groups):
            bars.say(line)
        for name in groups:
            rows += MEASURED_BY[name](options, bars)
            found = {**place, "rows": [row.record() for row in rows]}
            write_json(options.out / f"bench{ending}.json", found)
        write_text(options.out / TABLES, markdown(group_tables(found)))
        write_json(summary, _summary(options, rows))
    return found


def _summary(options: BenchOptions, rows: list[Row]) -> dict[str, Any]:
    found = {
        "groups": options.groups,
        "rows": len(rows),
        "targets_met": sum(row.met is True for row in rows),
        "targets_missed": [f"{row.group}: {row.name}" for row in rows if row.met is False],
    }
    return with_source(found, options, device=options.device)
