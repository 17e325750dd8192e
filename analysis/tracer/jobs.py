"""Batch jobs: the sequence of a block file, rendered in every combination of sampling settings in a job file."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from analysis.command.progress import Bars
from analysis.storage.reference import content_hash
from analysis.storage.source import code_hash
from analysis.tracer.options import JobOptions
from renderer.tables.checks import check_frame_size
from scenes import catalog
from scenes.canonical import Scene, SceneError
from scenes.formats.blocks.jobs import Combination, Job, read_job
from scenes.formats.blocks.read import load_blocks
from scenes.formats.blocks.settings import Settings

if TYPE_CHECKING:
    from renderer.sampling.plan import SamplePlan


@dataclass(frozen=True)
class PreparedJob:
    """A job that is ready to run: its scene, frames and combinations."""

    job: Job
    scene: Scene
    settings: Settings
    size_px: tuple[int, int]
    frames: range

    @property
    def times_s(self) -> dict[int, float]:
        """Animation time of each frame by its number, seconds."""
        return {number: self.settings.frame_start_s(number) for number in self.frames}


def prepare(options: JobOptions) -> PreparedJob:
    """Reads the job and its scene.

    Raises:
        SceneError: the job or its scene is invalid.
    """
    job = read_job(options.job)
    name = options.scene or job.name.lower().replace("_", "").replace(" ", "")
    if not options.scene and name not in catalog.BLUR_SCENES:
        raise SceneError(f"scene: expected a block file or one of {', '.join(catalog.BLUR_SCENES)}, got none")
    file = catalog.blur_scene_file(name) if name in catalog.BLUR_SCENES else Path(name)
    scene, settings = load_blocks(file)
    size = (settings.width_px, settings.height_px)
    if options.width_px:
        size = (options.width_px, max(1, round(options.width_px * settings.height_px / settings.width_px)))
    check_frame_size(*size, 1)
    end = options.first_frame + options.frames if options.frames else settings.frame_count
    if not options.first_frame < end <= settings.frame_count:
        count = settings.frame_count
        raise SceneError(f"frames: expected some of the sequence's {count}, got {options.first_frame} to {end - 1}")
    return PreparedJob(job, scene, settings, size, range(options.first_frame, end))


def run_job(work: PreparedJob, options: JobOptions, bars: Bars) -> list[dict[str, Any]]:
    """Renders frames that are not on disk yet; returns a row for each combination.

    Args:
        work: from :func:`prepare`.
        options: options of the job.
        bars: progress bars.
    """
    from analysis.tracer.stills import render_stills
    from renderer.frames import pictures
    from renderer.trace import Renderer

    content = content_of(work)
    renderer = Renderer(work.scene, threads=options.threads or None, seed=options.seed)
    rows = []
    for combination in work.job.combinations:
        plan, task = plan_of(combination, options), bars.task(combination.name, len(work.frames))
        picture, folder = pictures(renderer, plan, *work.size_px), options.out / combination.name
        key, ending = content_hash((plan, content)), f".{options.format}"
        rendered, nonfinite = render_stills(picture, work.times_s, folder, ending, key, task)
        counts = {"frames": len(work.frames), "rendered_now": rendered, "nonfinite": nonfinite}
        rows.append({"combination": combination.name, **counts})
    renderer.close()
    return rows


def content_of(work: PreparedJob) -> str:
    """Hash of everything that decides the frames of a job, except the sampling settings."""
    from analysis.tracer.stills import render_stills
    from renderer.frames import pictures
    from renderer.trace import Renderer

    return content_hash((work.scene, work.settings, work.size_px, code_hash(Renderer, pictures, render_stills)))


def plan_of(combination: Combination, options: JobOptions) -> SamplePlan:
    """Sampling settings of a combination."""
    from renderer.sampling.plan import SamplePlan

    return SamplePlan(
        combination.samples,
        combination.points,  # type: ignore[arg-type]
        options.seed,
        options.space_filter,
        options.sigma_px,
        combination.time_filter,  # type: ignore[arg-type]
        options.box_share,
        combination.shift,  # type: ignore[arg-type]
    )
