"""Measure samples per second of the ray tracer: one thread and several, Morton order and row order.

Example: python scripts/bench.py --out out/bench
"""

from __future__ import annotations

import dataclasses
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from analysis.bench import BenchOptions, measure
from analysis.cli import bad_input, full_disk, parse, run_cli
from analysis.files import writable_folder, write_json

ROOT = Path(__file__).resolve().parent.parent


def main() -> None:
    """Parses, measures, prints a table and writes what it shows."""
    options = parse(BenchOptions, __doc__ or "")
    with bad_input():
        writable_folder(options.out, "out")
    from analysis import progress
    from analysis.records import provenance
    from renderer.trace import Renderer
    from scenes import catalog

    with bad_input():
        scene = catalog.load(options.input)
        renderers = {count: Renderer(scene, threads=count) for count in (1, options.threads)}
    with progress.bars() as bars:
        tracers = {count: renderer.trace for count, renderer in renderers.items()}
        summary = measure(options, tracers, scene.duration_s, bars.task("repetitions", options.repetitions))
    config = dataclasses.asdict(options)
    source = provenance(ROOT, config, scene=scene.name or options.input, device="cpu")
    with full_disk(options.out):
        write_json(options.out / "summary.json", {**summary, "config": config, "provenance": source})

    from rich.console import Console
    from rich.table import Table

    table = Table(title=f"{options.input}, {summary['samples']:,} samples, medians of {options.repetitions}")
    for name in ("threads", "order", "M samples/s", "quartiles"):
        table.add_column(name, justify="left" if name == "order" else "right")
    for case in summary["cases"]:
        low, high = (value / 1e6 for value in case["quartiles"])
        rate = case["samples_per_s"] / 1e6
        table.add_row(str(case["threads"]), case["order"], f"{rate:.3f}", f"{low:.3f} – {high:.3f}")
    console = Console()
    console.print(table)
    per_sample = sum(summary["counters"].values()) / summary["samples"]
    console.print(f"{per_sample:.2f} rays per sample")
    for order, gain in summary["speed_up_of_threads"].items():
        console.print(f"{options.threads} threads against 1, {order}: {gain:.2f}x")
    for threads, gain in summary["speed_up_of_morton_order"].items():
        console.print(f"Morton order against rows, threads {threads}: {gain:.2f}x")
    console.print(f"written to {options.out}: summary.json")


if __name__ == "__main__":
    run_cli(main)
