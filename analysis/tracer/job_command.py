"""Render a sequence in every combination of sampling levels, point sets and time filters of a job file.

Examples: python scripts/job.py scenes/assets/plane/plane_job.txt --out out/plane
          python scripts/job.py scenes/assets/spheres/spheres_job.txt --width-px 192 --frames 2 --out out/few
          python scripts/job.py my_job.txt --scene my_scene.txt --out out/mine
"""

from __future__ import annotations

import dataclasses

from analysis.command.cli import bad_input, full_disk, parse
from analysis.command.ownership import own_folder
from analysis.storage.files import write_json
from analysis.tracer.options import JobOptions


def main() -> None:
    """Parses, renders what is missing, prints how much that was."""
    options = parse(JobOptions, __doc__ or "")
    from analysis.tracer.jobs import prepare, run_job

    with bad_input():
        work = prepare(options)
        own_folder(options.out, "out")
    from analysis.command.progress import bars
    from analysis.storage.provenance import provenance
    from renderer.film.files import FilmError

    config = dataclasses.asdict(options)
    source = provenance(config, scene=work.settings.name, seed=options.seed)
    with bad_input(), full_disk(options.out, FilmError), bars() as shown:
        rows = run_job(work, options, shown.task)
        found = {"job": dataclasses.asdict(work.job), "settings": dataclasses.asdict(work.settings), "rows": rows}
        write_json(options.out / "summary.json", {**found, "config": config, "provenance": source})
    rendered, bad = (sum(row[name] for row in rows) for name in ("rendered_now", "nonfinite"))
    frames = len(rows) * len(work.frames)
    print(
        f"{work.job.name}: {len(rows)} combinations, {frames} frames ({rendered} rendered now, {bad} values not finite)"
    )
    print(f"written to {options.out}")
