"""Runs the commands on scene files, from their options to files and a summary."""

from __future__ import annotations

import time
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import pandas as pd

from analysis.command.cli import bad_input
from analysis.command.console import Table, frame_table
from analysis.command.progress import Task, bars
from analysis.conversion.options import FORMATS_OF, CheckOptions, ConvertOptions
from analysis.storage.files import write_json, write_table
from analysis.storage.results import own_results
from analysis.storage.summary import with_source, write_summary
from tsar.named import require_known


def convert(options: ConvertOptions) -> dict[str, Any]:
    """Converts a scene file; returns the content of the report of losses.

    Raises:
        InputError: the scene cannot be read or written, or ``strict`` is set and a loss changes the picture.
    """
    from scenes.formats.conversion import format_of, load_scene_file, save_scene_file
    from scenes.formats.losses import LossReport

    report = LossReport()
    with bad_input():
        begun = time.perf_counter()
        scene = load_scene_file(options.source, options.root, report)
        read = time.perf_counter()
        save_scene_file(scene, options.target, options.to or format_of(options.target), report, options.strict)
        seconds = {"read": read - begun, "written": time.perf_counter() - read}
        found = {"losses": report.rows(), "instances": len(scene.instances), "lights": len(scene.lights)}
        write_json(options.report_file, with_source({**found, "seconds": seconds}, options, seed=0))
    return {**found, "lines": report.lines(), "count": len(report.losses)}


def check(options: CheckOptions) -> list[Table]:
    """Renders converted scenes and compares their pictures; returns the results as tables.

    Raises:
        InputError: a scene cannot be read or written.
    """
    from analysis.conversion.check import checked
    from analysis.conversion.markers import marker_offsets
    from analysis.conversion.matrix import GROUPS, matrix_rows, worst
    from analysis.conversion.mutations import summed

    groups = options.groups or tuple(GROUPS)
    with bad_input():
        for name in groups:
            require_known(name, "groups", GROUPS)
        written = ("table.csv", "markers.csv", "pictures.jpg", "worst.csv", "pairs.csv", "matrix.csv", "markers/*",
                    "matrix/*", "[0-9][0-9]-*/*", "mutations.csv", "mutations.journal")  # fmt: skip
        own_results(options.out, written)
    with bad_input(), bars() as shown:
        mutations = mutation_rows(options, shown.task("mutations", options.mutations)) if options.mutations else []
        rows = [] if options.mutations else checked(options, shown.task("scenes", len(options.scenes)))
        markers = marker_offsets(options.out / "markers", options.limit_s) if options.markers else []
        matrix = []
        if options.matrix:
            given, task = (options.samples, options.limit_s), shown.task("matrix", len(groups))
            matrix = matrix_rows(options.out / "matrix", *given, task, groups, options.formats or tuple(FORMATS_OF))
        tables = {"table": rows, "markers": markers, "matrix": matrix, "worst": worst(matrix),
                  "pairs": worst(matrix, pairs=True), "mutations": mutations}  # fmt: skip
        found = {name: part for name, part in tables.items() if part}
        for name, part in found.items():
            write_table(options.out / f"{name}.csv", pd.DataFrame(part))
        write_summary(options.out, {"rows": rows, "markers": markers, "matrix": matrix, "mutations": mutations},
                      options, seed=options.seed)  # fmt: skip
    brief = [{**row, "losses": len(row["losses"])} for row in rows]
    counts = [summed(mutations)] if mutations else []
    listed = brief, markers, tables["worst"], tables["pairs"]
    faults = [{"fault": fault} for row in mutations for fault in row["faults"]]
    return [frame_table(pd.DataFrame(part)) for part in (*listed, counts, faults) if part]


def mutation_rows(options: CheckOptions, task: Task) -> list[dict[str, Any]]:
    """A row for each batch of changed scene files."""
    from analysis.conversion.mutations import Mutations, sources_in
    from scenes.loading import asset

    scenes = options.scenes or tuple(asset(f"cornell-box/cornell-box{ending}") for ending in (".pbrt", ".lxs", ".xml"))
    with TemporaryDirectory() as work:
        sources = sources_in(Path(work), scenes, options.root)
        return Mutations(sources, Path(work), options.out / "mutations.journal", options.seed).rows(
            options.mutations, task
        )
