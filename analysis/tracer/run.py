"""Runs the commands of the ray tracer, from their options to files and a summary."""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from analysis.command.cli import bad_input, full_disk
from analysis.command.cluster import ClusterOptions, connected
from analysis.command.progress import bars
from analysis.storage.files import write_table
from analysis.storage.results import own_results
from analysis.storage.summary import write_summary
from analysis.study.inputs import tables_of
from analysis.tracer.options import (
    AcceleratorOptions,
    GalleryOptions,
    JobOptions,
    PointSetOptions,
    TileOptions,
)
from analysis.tracer.render_options import RenderOptions

if TYPE_CHECKING:
    import pandas as pd
    from torch import Tensor

    from analysis.tracer.jobs import PreparedJob
    from scenes.canonical import Scene


def opened(options: RenderOptions) -> tuple[Scene, tuple[str, ...]]:
    """The scene to render, and the losses from its file.

    Raises:
        InputError: there is no such scene, or its file cannot be read.
    """
    from analysis.tracer.posing import ANEW
    from scenes import catalog
    from scenes.models.scenes_of_models import is_posed

    with bad_input():
        scene, losses = catalog.load_seen(options.scene, options.look, options.phase)
        more = [ANEW] if options.frames > 1 and is_posed(options.scene, options.integrator == "path") else []
        return scene, (*map(str, losses), *more)


def losses_of(options: TileOptions) -> tuple[str, ...]:
    """The losses from the scene's file.

    Raises:
        InputError: there is no such scene, or its file cannot be read.
    """
    from scenes import catalog

    with bad_input():
        return catalog.load_seen(options.scene, options.look)[1]


def explained(scene: Scene) -> list[str]:
    """The kernel features that a scene requires, with reasons."""
    from renderer.tables.requirements import explanation

    with bad_input():
        return explanation(scene)


def render(options: RenderOptions, scene: Scene, losses: tuple[str, ...]) -> dict[str, Any]:
    """Renders missing frames of a sequence, and its film if requested; returns the content of ``summary.json``.

    Args:
        options: of the command.
        scene, losses: as of :func:`opened`.

    Raises:
        InputError: the machine or the input cannot provide what the options ask for.
    """
    from analysis.storage.reference import content_hash
    from analysis.storage.source import brought, code_hash
    from analysis.tracer.denoising import StillOf, denoised
    from analysis.tracer.posing import Posing
    from analysis.tracer.rounds import StillRounds
    from analysis.tracer.stills import render_stills
    from renderer.film.files import FilmError
    from renderer.film.sequence import still_path, write_film
    from renderer.frames import pictures
    from renderer.sampling import POINT_SETS
    from renderer.sampling.plan import SamplePlan
    from renderer.tables.checks import check_frame_size
    from renderer.trace import Renderer

    with bad_input():
        size = options.size_px((scene.film.width_px, scene.film.height_px))
        check_frame_size(*size, 1 if options.samples else options.samples_per_axis)
        own_results(options.out, ["film.mp4"] if options.format == "mp4" else [])
        posing = Posing(options, scene, losses)
        kinds = options.point_set, options.seed, options.space_filter
        count = options.samples // (options.in_rounds or 1)
        plan = (
            SamplePlan(count, *kinds, time_filter=options.time_filter, shift=options.shift) if options.samples else None
        )

    def picture(number: int, time_s: float) -> Tensor:
        sampling = plan or options.samples_per_axis
        return pictures(posing.at(time_s), sampling, *size, options.crop)(number, time_s)

    def cleared(made: StillOf) -> StillOf:
        return denoised(made, posing.at, size, options.crop) if options.denoise else made

    points = [(POINT_SETS, options.point_set)] if options.samples else []
    added = brought(*points, *tables_of(options.scene))
    key = content_hash(
        (options.job, posing.content, code_hash(Renderer, pictures, render_stills, StillRounds, denoised), *added)
    )
    out, ending = options.out, options.still_ending
    with bad_input(), full_disk(out, FilmError), bars() as shown:
        times = dict(enumerate(options.times_s))
        if plan is not None and options.in_rounds:
            made = StillRounds(posing, plan, options, size, shown)
            still = cleared(made.picture)
            rendered, nonfinite = render_stills(still, times, out, ending, key, made.frames, made.write)
        else:
            task = shown.task("frames", options.frames)
            rendered, nonfinite = render_stills(cleared(picture), times, out, ending, key, task)
        if options.format == "mp4":
            stills = [still_path(out, number, ending) for number in range(options.frames)]
            write_film(stills, out / "film.mp4", options.fps)
        found = {"frames": options.frames, "rendered_now": rendered, "nonfinite": nonfinite}
        found |= {"later_losses": posing.later_losses} if posing.anew else {}
        return write_summary(out, found, options, added, scene=scene.name, device=options.device)


def job(options: JobOptions) -> tuple[PreparedJob, dict[str, Any]]:
    """Renders missing frames of a job; returns the job and the content of ``summary.json``.

    Raises:
        InputError: the job or its scene is invalid, or the results cannot be written.
    """
    from analysis.tracer.job_farm import run_job_anywhere
    from analysis.tracer.jobs import prepare
    from renderer.film.files import FilmError

    with bad_input():
        work = prepare(options)
        own_results(options.out, ())
    with bad_input(), full_disk(options.out, FilmError), bars() as shown:
        found = {
            "job": asdict(work.job),
            "settings": asdict(work.settings),
            "rows": run_job_anywhere(work, options, shown),
        }
        return work, write_summary(options.out, found, options, scene=work.settings.name, seed=options.seed)


def tiles(options: TileOptions) -> dict[str, Any]:
    """Renders a picture, or measures the speed-up with more workers; returns the content of ``summary.json``.

    Raises:
        InputError: the machine or the input cannot provide what the options ask for.
    """
    from analysis.tracer.tile_speedup import study
    from analysis.tracer.tiles import chunks_of, picture_of, render_resumed
    from renderer.film.files import FilmError, write_image

    farm = ClusterOptions(workers=max(options.study)) if options.study else options.farm
    with bad_input():
        picture = picture_of(options, 1 if options.study else farm.threads)
        own_results(options.out, [f"{picture.name}.png", f"{picture.name}.exr"])
    chunks = chunks_of(picture, options.chunk_tiles)
    with bad_input(), bars() as shown, connected(farm, shown.say) as client, full_disk(options.out, FilmError):
        if options.study:
            task = shown.task("turns", len({1, *options.study}) * options.repetitions)
            found = study(client, picture, chunks, options.study, options.repetitions, task)
        else:
            image, facts = render_resumed(client, picture, options, shown.task("chunks", len(chunks)))
            found = {**facts, "nonfinite": write_image(options.out / f"{picture.name}.png", image)}
            write_image(options.out / f"{picture.name}.exr", image)
        return write_summary(options.out, found, options, scene=picture.scene, seed=options.seed)


def gallery(options: GalleryOptions) -> dict[str, Any]:
    """Renders all requested effects, and the sheet; returns the content of ``summary.json``.

    Raises:
        InputError: the machine or the input cannot provide what the options ask for.
    """
    from analysis.tracer.gallery import names, render_effect, sample_plan, write_sheet
    from renderer.film.files import FilmError
    from renderer.frames import tile_count
    from scenes.effects import scenes as effects

    with bad_input():
        plan = sample_plan(options)
        files = [f"{name}.{ending}" for name in names(options) for ending in ("png", "exr")]
        own_results(options.out, ["gallery.jpg", *files])
    found, pictures = {}, []
    with bad_input(), full_disk(options.out, FilmError), bars() as shown:
        for name in names(options):
            task = shown.task(name, tile_count(options.width_px, options.height_px))
            picture, found[name] = render_effect(name, plan, options, task)
            pictures.append(picture)
        write_sheet(options.out / "gallery.jpg", pictures, [effects.EFFECTS[name].what for name in names(options)])
        return write_summary(options.out, {"effects": found}, options, seed=options.seed, device=options.device)


def accelerators(options: AcceleratorOptions) -> dict[str, Any]:
    """Measures, or renders the requested images; returns the content of ``summary.json``.

    Raises:
        InputError: the results cannot be written.
    """
    import pandas as pd

    from analysis.page.figures import save
    from analysis.tracer.accelerators import measure, render_report_image
    from analysis.tracer.plots import tests_figure
    from renderer.film.files import FilmError, write_image

    with bad_input():
        files = [f"{name}.{ending}" for name in options.image for ending in ("png", "exr")]
        own_results(options.out, files or ("table.csv", "tests.png"))
    with full_disk(options.out, FilmError), bars() as shown:
        found: dict[str, Any] = {}
        for name in dict.fromkeys(options.image):
            image, found[name] = render_report_image(name, options, shown)
            for ending in (".png", ".exr"):
                write_image(options.out / f"{name}{ending}", image)
        if options.image:
            found = {"images": found}
        else:
            task = shown.task("meshes", 2 * len(options.triangles))
            rows = pd.DataFrame([row for size in options.triangles for row in measure(size, options, task)])
            write_table(options.out / "table.csv", rows)
            save(tests_figure(rows), options.out / "tests.png")
            found = {"rows": rows.to_dict("records")}
        return write_summary(options.out, found, options, seed=options.seed)


def point_sets(options: PointSetOptions) -> dict[str, pd.DataFrame]:
    """Measures and draws; returns the tables by name.

    Raises:
        InputError: the results cannot be written.
    """
    from analysis.tracer.point_sets import SETS, measure, slopes

    with bad_input():
        own_results(options.out, ("*.csv", "*.png"))
    with full_disk(options.out), bars() as shown:
        even, errors = measure(options, shown.task("sets", len(SETS) * len(set(options.levels))))
        tables = {"evenness": even, "errors": errors, "slopes": slopes(errors)}
        for name, rows in tables.items():
            write_table(options.out / f"{name}.csv", rows)
        _draw_point_sets(options, errors)
        found = {name: rows.to_dict("records") for name, rows in tables.items()}
        write_summary(options.out, found, options, seed=options.seed)
    return tables


def _draw_point_sets(options: PointSetOptions, errors: pd.DataFrame) -> None:
    import numpy as np

    from analysis.page.figures import save
    from analysis.tracer import plots
    from analysis.tracer.point_sets import INTEGRANDS, SETS, blurred_frames
    from renderer.film.files import encode_srgb
    from renderer.sampling.plan import box_warp, gaussian_warp, triangle_warp
    from renderer.sampling.point_sets import point_set

    sets = {name: point_set(name, 125, options.seed) for name in SETS}  # type: ignore[arg-type]
    even = sets["hammersley"]
    t = (np.arange(40) + 0.5) / 40
    figures = {
        "projections": plots.projections_figure(sets),
        "gaussian": plots.warp_figure(even[:, :2], np.stack(gaussian_warp(even[:, 0], even[:, 1], 0.5), axis=1)),
        "times": plots.time_figure({"even": t, "truncated box": box_warp(t, 0.5), "triangle": triangle_warp(t)}),
        "convergence": plots.convergence_figure(errors, SETS, INTEGRANDS),
    }
    if options.frame_px:
        frames = blurred_frames(options, SETS[:3], (8, 64, 216))
        figures["blur"] = plots.frames_figure({key: encode_srgb(image) for key, image in frames.items()})
    for name, figure in figures.items():
        save(figure, options.out / f"{name}.png")
