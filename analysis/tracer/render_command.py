"""Render a frame or a sequence of a scene.

Examples: python scripts/render.py fly-by --time-s 1 --out out/still
          python scripts/render.py chase --frames 60 --format mp4 --out out/chase
          python scripts/render.py moving-object --samples 125 --point-set stratified --out out/blur
          python scripts/render.py glass --explain
"""

from __future__ import annotations

import dataclasses

from analysis.command.cli import bad_input, full_disk, parse
from analysis.command.ownership import own_folder
from analysis.storage.files import write_json
from analysis.tracer.render_options import RenderOptions


def main() -> None:
    """Parses, renders, prints what was written where."""
    options = parse(RenderOptions, __doc__ or "")
    from renderer.tables.checks import check_frame_size
    from renderer.tables.requirements import explanation
    from scenes import catalog

    with bad_input():
        scene, losses = catalog.load_any(options.scene, options.phase)
        for loss in losses:
            print(loss)
        if options.explain:
            print("\n".join(explanation(scene)))
            return
        check_frame_size(options.width_px, options.height_px, 1 if options.samples else options.samples_per_axis)
        own_folder(options.out, "out")

    from analysis.command.progress import bars
    from analysis.storage.provenance import provenance
    from analysis.storage.reference import content_hash
    from analysis.storage.source import brought, code_hash
    from analysis.tracer.stills import render_stills
    from renderer.film.files import FilmError
    from renderer.film.sequence import still_path, write_film
    from renderer.frames import pictures
    from renderer.sampling import POINT_SETS
    from renderer.sampling.plan import SamplePlan
    from renderer.trace import Renderer

    with bad_input():
        renderer = Renderer(scene, options.device, options.threads or None, seed=options.seed)
        kinds = options.point_set, options.seed, options.space_filter
        plan = (
            SamplePlan(options.samples, *kinds, time_filter=options.time_filter, shift=options.shift)
            if options.samples
            else None
        )
        picture = pictures(renderer, plan or options.samples_per_axis, options.width_px, options.height_px)
    added = brought((POINT_SETS, options.point_set)) if options.samples else []
    source = provenance(options.job, added, scene=scene.name, device=options.device)
    key = content_hash((options.job, scene, code_hash(Renderer, pictures, render_stills), *added))
    with bad_input(), full_disk(options.out, FilmError), bars() as shown:
        stills = [still_path(options.out, number, options.still_ending) for number in range(options.frames)]
        done = shown.task("frames", options.frames)
        rendered, nonfinite = render_stills(
            picture, dict(enumerate(options.times_s)), options.out, options.still_ending, key, done
        )
        if options.format == "mp4":
            write_film(stills, options.out / "film.mp4", options.fps)
        found = {"frames": options.frames, "rendered_now": rendered, "nonfinite": nonfinite}
        write_json(options.out / "summary.json", {**found, "config": dataclasses.asdict(options), "provenance": source})
    print(f"{options.frames} frames ({rendered} rendered now, {nonfinite} values not finite) in {options.out}")
