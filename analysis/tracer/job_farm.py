"""Frames of a job on the workers of a Dask scheduler, which see the same folders and run the same source.

Each worker writes its frames into the folder of the job, listed with their checksums. Frames are independent and depend
on nothing but the job, so they are the same on any number of machines.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from analysis.command.awaited import OTHER_SOURCE, ended, not_shared, unseen
from analysis.command.cli import InputError
from analysis.command.cluster import ClusterOptions, connected
from analysis.command.progress import Bars
from analysis.storage.reference import content_hash
from analysis.storage.store import Store
from analysis.tracer.jobs import PreparedJob, content_of, plan_of, prepare, run_job
from analysis.tracer.options import JobOptions
from renderer.film.sequence import still_path
from scenes.formats.blocks.jobs import Combination

if TYPE_CHECKING:
    from distributed import Client

    from renderer.trace import Renderer

_RETRIES = 5
"""Number of times that a frame is tried again."""


def run_job_anywhere(work: PreparedJob, options: JobOptions, bars: Bars) -> list[dict[str, Any]]:
    """Like :func:`analysis.tracer.jobs.run_job`; with a scheduler, its workers render what is missing.

    Raises:
        InputError: nothing answers at the scheduler's address, it is gone or without workers, a worker runs another
            source, or writes to another folder of the same name.
        ValueError: a file of another origin lies where a frame belongs.
    """
    rendered = Counter[str]()
    if options.scheduler:
        with connected(ClusterOptions(scheduler=options.scheduler), bars.say) as client:
            rendered = _rendered(client, work, options, bars)
    rows = run_job(work, options, bars)
    return [{**row, "rendered_now": row["rendered_now"] + rendered[row["combination"]]} for row in rows]


def _rendered(client: Client, work: PreparedJob, options: JobOptions, bars: Bars) -> Counter[str]:
    """Has all missing frames rendered, the most expensive first; returns their number by combination."""
    content = content_of(work)
    scene = str(Path(options.scene).resolve()) if Path(options.scene).is_file() else options.scene
    asked = replace(options, job=options.job.resolve(), scene=scene, out=options.out.resolve(), scheduler="")
    missing = list[tuple[int, int]]()
    for at, combination in enumerate(work.job.combinations):
        store = _store(combination, options, content)
        files = {number: _name(store, number, options) for number in work.frames}
        store.require_own(files.values())
        missing += [(at, number) for number, file in files.items() if store.find(file) is None]
    missing.sort(key=lambda frame: -work.job.combinations[frame[0]].samples)
    task = bars.task("frames elsewhere", len(missing))
    names = [combination.name for combination in work.job.combinations]
    waiting = {
        client.submit(render_frame, asked, *frame, content, pure=False, retries=_RETRIES): names[frame[0]]
        for frame in missing
    }
    rendered = Counter[str]()
    for name, _, reason in ended(client, waiting, options.worker_wait_s):
        if reason is not None:
            raise InputError(f"{name}: {reason}")
        rendered[name] += 1
        task.advance()
    stores = [_store(combination, options, content) for combination in work.job.combinations]
    for absent in unseen(stores[at].folder / _name(stores[at], number, options) for at, number in missing):
        raise InputError(not_shared(absent.parent))
    return rendered


def render_frame(options: JobOptions, at: int, number: int, content: str) -> None:
    """Renders one frame into the folder of the job, unless it is there.

    Args:
        options: options of the job, with absolute paths.
        at: index of the combination.
        number: number of the frame.
        content: :func:`analysis.tracer.jobs.content_of` of the process that asks.

    Raises:
        ValueError: this process runs another source, or reads another scene, than the process that asks.
    """
    from analysis.tracer.stills import render_still
    from renderer.frames import pictures

    work, renderer = _opened(options, content)
    combination = work.job.combinations[at]
    store = _store(combination, options, content)
    name = _name(store, number, options)
    if store.find(name) is None:
        picture = pictures(renderer, plan_of(combination, options), *work.size_px)
        render_still(store, name, lambda: picture(number, work.times_s[number]))


@lru_cache(maxsize=1)
def _opened(options: JobOptions, content: str) -> tuple[PreparedJob, Renderer]:
    from renderer.trace import Renderer

    work = prepare(options)
    if content_of(work) != content:
        raise ValueError(f"{options.job}: {OTHER_SOURCE}, or give it the same scene")
    return work, Renderer(work.scene, threads=options.threads or None, seed=options.seed)


def _store(combination: Combination, options: JobOptions, content: str) -> Store:
    return Store(options.out / combination.name, content_hash((plan_of(combination, options), content)))


def _name(store: Store, number: int, options: JobOptions) -> str:
    return still_path(store.folder, number, f".{options.format}").name
