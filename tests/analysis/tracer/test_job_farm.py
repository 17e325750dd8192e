"""Frames of a job on the workers of a scheduler: the same files, and what a worker with another source says."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from analysis.command.awaited import unseen
from analysis.command.cli import InputError
from analysis.command.progress import Bars, Task
from analysis.tracer import job_farm
from analysis.tracer.jobs import content_of, prepare, run_job
from analysis.tracer.options import JobOptions

JOB = "planescene\n2\n1 8\n1\nhammersley\n1\nbox\n"


@pytest.fixture(scope="module")
def scheduler() -> Iterator[str]:
    from distributed import LocalCluster

    with LocalCluster(n_workers=2, threads_per_worker=1, host="127.0.0.1", dashboard_address=":0") as cluster:
        yield cluster.scheduler_address


@pytest.fixture
def job(tmp_path: Path) -> JobOptions:
    (tmp_path / "job.txt").write_text(JOB)
    return JobOptions(job=tmp_path / "job.txt", width_px=24, first_frame=80, frames=3, threads=1, out=tmp_path / "here")


def frames(folder: Path) -> dict[str, bytes]:
    return {str(file.relative_to(folder)): file.read_bytes() for file in folder.rglob("*.png")}


def test_frames_of_workers_are_those_of_one_process_and_are_kept(job: JobOptions, scheduler: str) -> None:
    work = prepare(job)
    here = run_job(work, job, Bars())
    there = replace(job, scheduler=scheduler, out=job.out.parent / "there")
    rows = job_farm.run_job_anywhere(work, there, Bars())
    assert rows == here and [row["rendered_now"] for row in rows] == [3, 3]
    assert frames(there.out) == frames(job.out) and len(frames(job.out)) == 6
    damaged = next(there.out.rglob("*.png"))
    damaged.write_bytes(b"")
    again = job_farm.run_job_anywhere(work, there, Bars())
    assert sum(row["rendered_now"] for row in again) == 1 and frames(there.out) == frames(job.out)


def test_a_worker_with_another_scene_or_source_renders_nothing(job: JobOptions, scheduler: str) -> None:
    work = prepare(job)
    with pytest.raises(ValueError, match="job.txt: expected a worker with the source of the command"):
        job_farm.render_frame(job, 0, 80, "0" * 64)
    assert not job.out.exists()
    job_farm.render_frame(job, 0, 80, content_of(work))
    assert len(frames(job.out)) == 1


def test_a_job_waits_for_workers_as_long_as_is_asked(job: JobOptions) -> None:
    from distributed import LocalCluster

    asked = replace(job, worker_wait_s=1.0)
    none: Any = LocalCluster(n_workers=0, host="127.0.0.1", dashboard_address=":0")
    with none, pytest.raises(InputError, match=r"no worker was there for 1 s \(--worker-wait-s waits longer\)"):
        job_farm.run_job_anywhere(prepare(job), replace(asked, scheduler=none.scheduler_address), Bars())


def render_nothing(*_: Any) -> None:
    """In place of a worker that writes into another folder of the same name."""


def test_frames_that_are_not_here_are_not_rendered_again(
    job: JobOptions, scheduler: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(job_farm, "render_frame", render_nothing)
    monkeypatch.setattr(job_farm, "unseen", lambda files: unseen(files, wait_s=0.0))
    with pytest.raises(InputError, match="all machines must see the same folder --out"):
        job_farm.run_job_anywhere(prepare(job), replace(job, scheduler=scheduler), Bars())
    assert not frames(job.out)


def test_a_scheduler_that_ends_is_one_line_and_frames_stay(job: JobOptions) -> None:
    from distributed import LocalCluster

    longer = replace(job, frames=30)
    cluster: Any = LocalCluster(n_workers=1, threads_per_worker=1, host="127.0.0.1", dashboard_address=":0")

    class Ending(Bars):
        """Bars that end the cluster at the first frame."""

        def task(self, label: str, total: int) -> Task:
            return Task(show=lambda done: cluster.close())

    with cluster, pytest.raises(InputError, match=r"^hammersley-box-\d{4}: .*(gone|ended|no worker)"):
        job_farm.run_job_anywhere(prepare(longer), replace(longer, scheduler=cluster.scheduler_address), Ending())
    assert 0 < len(frames(job.out)) < 60
