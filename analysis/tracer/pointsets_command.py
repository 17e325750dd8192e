"""Measure point sets and draw figures 4, 5, 7 and 9 of the motion-blur perception thesis from them.

Example: python scripts/pointsets.py --out out/pointsets
"""

from __future__ import annotations

import dataclasses
import itertools

from analysis.command.cli import bad_input, full_disk, parse
from analysis.command.ownership import own_folder
from analysis.storage.files import atomic, write_json
from analysis.tracer.options import PointSetOptions


def main() -> None:
    """Parses, measures, draws, prints tables."""
    options = parse(PointSetOptions, __doc__ or "")
    from analysis.tracer.point_sets import INTEGRANDS, SETS, blurred_frames, mean_errors, measure, slopes

    with bad_input():
        own_folder(options.out, "out")
    import numpy as np

    from analysis.command.console import frame_table
    from analysis.command.progress import bars
    from analysis.page.figures import save
    from analysis.storage.provenance import provenance
    from analysis.tracer import plots_point_sets as plots
    from renderer.film.files import encode_srgb
    from renderer.sampling.plan import box_warp, gaussian_warp, triangle_warp
    from renderer.sampling.point_sets import point_set

    config, count = dataclasses.asdict(options), itertools.count(1)
    with full_disk(options.out), bars() as shown:
        done = shown.task("sets", len(SETS) * len(set(options.levels)))
        even, errors = measure(options, lambda: done(next(count)))
        fitted = slopes(errors)
        for name, rows in (("evenness", even), ("errors", errors), ("slopes", fitted)):
            with atomic(options.out / f"{name}.csv") as path:
                rows.to_csv(path, index=False)
        sets = {name: point_set(name, 125, options.seed) for name in SETS}  # type: ignore[arg-type]
        save(plots.projections_figure(sets), options.out / "projections.png")
        warped = np.stack(gaussian_warp(sets["hammersley"][:, 0], sets["hammersley"][:, 1], 0.5), axis=1)
        save(plots.warp_figure(sets["hammersley"][:, :2], warped), options.out / "gaussian.png")
        t = (np.arange(40) + 0.5) / 40
        times = {"even": t, "truncated box": box_warp(t, 0.5), "triangle": triangle_warp(t)}
        save(plots.time_figure(times), options.out / "times.png")
        save(plots.convergence_figure(errors, SETS, INTEGRANDS), options.out / "convergence.png")
        if options.frame_px:
            frames = blurred_frames(options, SETS[:3], (8, 64, 216))
            pictures = {key: encode_srgb(image) for key, image in frames.items()}
            save(plots.frames_figure(pictures), options.out / "blur.png")
        tables = {name: rows.to_dict("records") for name, rows in (("evenness", even), ("errors", errors))}
        source = provenance(config, seed=options.seed)
        found = {**tables, "slopes": fitted.to_dict("records"), "config": config, "provenance": source}
        write_json(options.out / "summary.json", found)
    middle = sorted(set(options.levels))[len(set(options.levels)) // 2]
    frame_table(even.query("points == @middle"), f"evenness of {middle} points")
    frame_table(mean_errors(errors, middle), f"mean squared error of {middle} points")
    frame_table(fitted, "slopes of the MSE")
    print(f"written to {options.out}")
