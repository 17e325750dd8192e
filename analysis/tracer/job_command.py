"""Render a sequence in every combination of sampling levels, point sets and time filters of a job file.

Examples: python scripts/job.py scenes/assets/plane/plane_job.txt --out out/plane
          python scripts/job.py scenes/assets/spheres/spheres_job.txt --width-px 192 --frames 2 --out out/few
          python scripts/job.py my_job.txt --scene my_scene.txt --out out/mine
          python scripts/job.py my_job.txt --scheduler tcp://host:8786 --threads 1 --out /shared/mine
"""

from __future__ import annotations

from analysis.command.cli import parse, require_files
from analysis.command.cluster import ClusterOptions
from analysis.tracer.options import JobOptions


def main() -> None:
    """Parses, renders missing frames, prints their number."""
    options = parse(JobOptions, __doc__ or "")
    require_files(options.job)
    ClusterOptions(scheduler=options.scheduler).require_port()  # before slow imports
    from analysis.command.console import show
    from analysis.tracer.run import job

    work, found = job(options)
    rendered, bad = (sum(row[name] for row in found["rows"]) for name in ("rendered_now", "nonfinite"))
    counts = f"{len(found['rows'])} combinations, {len(found['rows']) * len(work.frames)} frames"
    show(f"{work.job.name}: {counts} ({rendered} rendered now, {bad} values not finite)", f"written to {options.out}")
