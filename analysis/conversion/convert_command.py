"""Converts a scene file of one renderer to that of another, and reports what could not be carried over.

Examples: python scripts/convert.py scene.pbrt out/scene.lxs
          python scripts/convert.py scene.lxs out/scene.pbrt --strict --report losses.json
"""

from __future__ import annotations

import dataclasses
import time

from analysis.command.cli import bad_input, parse
from analysis.conversion.options import ConvertOptions
from analysis.storage.files import write_json


def main() -> None:
    """Parses, reads, writes, and prints what was lost."""
    options = parse(ConvertOptions, __doc__ or "")
    from analysis.storage.provenance import provenance
    from scenes.formats.conversion import format_of, load_scene_file, save_scene_file
    from scenes.formats.losses import LossReport

    report = LossReport()
    with bad_input():
        begun = time.perf_counter()
        scene = load_scene_file(options.source, options.root, report)
        read = time.perf_counter()
        to = options.to or format_of(options.target)
        save_scene_file(scene, options.target, to, report, options.strict)
        seconds = {"read": read - begun, "written": time.perf_counter() - read}
        config = dataclasses.asdict(options)
        found = {"losses": report.rows(), "instances": len(scene.instances), "lights": len(scene.lights)}
        source = provenance(config, seed=0)
        write_json(options.report_file, {**found, "seconds": seconds, "config": config, "provenance": source})
    for loss in report.losses:
        print(loss)
    print(f"{len(scene.instances)} shapes, {len(scene.lights)} lights, {len(report.losses)} losses; {options.target}")
