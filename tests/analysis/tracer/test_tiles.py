"""Tiles over processes: the same bits whatever happens to the workers; and a model of the speed-up."""

from __future__ import annotations

import dataclasses
import os
import signal
import threading
import time
from pathlib import Path

import numpy as np
import pytest
import torch

from analysis.command.cluster import ClusterOptions, connected
from analysis.command.progress import Task
from analysis.tracer.tile_speedup import FarmModel, fitted, study
from analysis.tracer.tiles import (
    PictureTask,
    TileOptions,
    assembled,
    chunks_of,
    picture_of,
    render_chunk,
    render_resumed,
    rendered,
    source_of,
)
from renderer.frames import render_image
from renderer.sampling.plan import SamplePlan
from renderer.trace import Renderer
from scenes import catalog
from scenes.catalog import Look
from tsar.memory import core_count

SOURCE = source_of("quad-light", Look(), "hammersley")
PICTURE = PictureTask("quad-light", Look(), (70, 50), None, 8, "hammersley", "gaussian", 0.0, 3, 1, SOURCE)


@pytest.fixture(scope="module")
def expected() -> torch.Tensor:
    """The picture from one process and one call."""
    renderer = Renderer(catalog.load("quad-light"), seed=3)
    image = render_image(renderer, SamplePlan(8, "hammersley", 3, "gaussian"), 70, 50, 0.0)
    renderer.close()
    return image


@pytest.fixture(scope="module")
def client():
    with connected(ClusterOptions(workers=2)) as found:
        yield found


def put_together(chunks, results) -> torch.Tensor:
    found = dict(results)
    return assembled(PICTURE, chunks, [found[number][0] for number in range(len(chunks))])


def test_chunks_in_one_process_are_the_picture(expected) -> None:
    for size in (1, 7, 100):
        chunks = chunks_of(PICTURE, size)
        assert sum(len(chunk) for chunk in chunks) == 5 * 4
        results = [(number, render_chunk(PICTURE, chunk)) for number, chunk in enumerate(chunks)]
        assert torch.equal(put_together(chunks, results), expected)


def test_a_cluster_gives_the_same_bits_with_any_number_of_workers(client, expected) -> None:
    chunks = chunks_of(PICTURE, 3)
    addresses = sorted(client.scheduler_info(n_workers=-1)["workers"])
    for workers in (addresses[:1], addresses):
        assert torch.equal(put_together(chunks, rendered(client, PICTURE, chunks, workers)), expected)


def test_a_worker_killed_in_the_middle_changes_no_bit(client, expected) -> None:
    chunks = chunks_of(PICTURE, 1)
    pids = client.run(os.getpid)
    victim = next(iter(pids.values()))

    def kill() -> None:
        time.sleep(0.15)
        os.kill(victim, signal.SIGKILL)

    killer = threading.Thread(target=kill)
    results = {}
    for place, result in rendered(client, PICTURE, chunks):
        if not results:
            killer.start()
            killer.join()  # so that the rest is done when one of the two is gone
        results[place] = result
    assert len(results) == len(chunks)
    assert torch.equal(put_together(chunks, results.items()), expected)
    deadline = time.monotonic() + 20.0
    while len(alive := client.run(os.getpid, on_error="ignore")) < 2 or victim in alive.values():
        assert time.monotonic() < deadline
        time.sleep(0.2)


def test_an_interrupted_picture_goes_on_where_it_stopped(client, expected, tmp_path: Path, capsys) -> None:
    options = TileOptions("quad-light", 8, size="70x50", seed=3, chunk_tiles=4, out=tmp_path)
    picture = picture_of(options, threads=1)
    assert picture == PICTURE
    shown = list[int]()
    image, facts = render_resumed(client, picture, options, Task(show=shown.append))
    assert torch.equal(image, expected)
    assert (facts["chunks"], facts["chunks_rendered_now"], shown) == (5, 5, [0, 1, 2, 3, 4, 5])
    assert facts["rays"]["primary_rays"] == 20 * 256 * 8  # tiles that hang over are traced whole
    chunks = [tmp_path / "chunks" / f"chunk{number:06d}.npz" for number in range(5)]
    chunks[1].unlink()
    chunks[3].write_bytes(chunks[3].read_bytes()[:-1000])
    np.savez(chunks[4], pixels=np.zeros((1, 256, 3), np.float32), seconds=1.0, kinds=["primary_rays"], rays=[7])
    again, facts = render_resumed(client, picture, options, Task(show=shown.append))
    assert facts["chunks_rendered_now"] == 3 and torch.equal(again, expected)
    assert facts["rays"]["primary_rays"] == 20 * 256 * 8
    said = capsys.readouterr().err
    assert [str(file) in said for file in chunks] == [False, False, False, True, True]
    (tmp_path / "chunks" / "chunk-notes.md").write_text("mine")
    larger = dataclasses.replace(options, chunk_tiles=7)
    assert render_resumed(client, picture, larger, Task(show=shown.append))[1]["chunks_rendered_now"] == 3
    left = sorted(path.name for path in (tmp_path / "chunks").iterdir())
    assert left == ["chunk-notes.md", "chunk000000.npz", "chunk000001.npz", "chunk000002.npz", "files.journal"]
    assert "2 files of an earlier run" in capsys.readouterr().err


def test_a_worker_of_another_source_renders_nothing() -> None:
    """It would render an older scene, or by older code."""
    with pytest.raises(ValueError, match="quad-light: expected a worker with the source of the command"):
        render_chunk(dataclasses.replace(PICTURE, source="old"), [0])


def test_a_chunk_that_fails_is_tried_again(client, expected) -> None:
    """For example for lack of memory that other processes use for a moment."""

    def fail_twice() -> None:
        import analysis.tracer.tiles

        real, left = analysis.tracer.tiles._renderer, [2]

        def renderer(*arguments):
            left[0] -= 1
            if left[0] >= 0:
                raise OSError("for a moment")
            return real(*arguments)

        analysis.tracer.tiles._renderer = renderer

    client.run(fail_twice)
    chunks = chunks_of(PICTURE, 5)
    assert torch.equal(put_together(chunks, rendered(client, PICTURE, chunks)), expected)


def test_a_study_counts_and_compares(client) -> None:
    found = study(client, PICTURE, chunks_of(PICTURE, 5), (2,), 1, Task())
    assert [row["workers"] for row in found["rows"]] == [1, 2] and found["same_bits"]
    # the accuracy of the model is measured by scripts/tiles.py: here other work may run at the same time
    assert found["rows"][0]["speedup"] == 1.0
    assert all(0.0 < row["modelled_over_measured"] < np.inf for row in found["rows"])
    assert found["predicted"]["reported"] is None and 0.0 < found["predicted"]["speedup"] <= 20.0


def test_the_model_of_equal_chunks_is_arithmetic() -> None:
    model = FarmModel(np.full(40, 0.5), 0.1, 0.0, 2.0, 1.0, cores=4)
    assert model.seconds(1) == pytest.approx(40 * 0.6 + 2.0)
    assert model.seconds(4) == pytest.approx(10 * 0.6 + 2.0)
    assert model.seconds(8) == pytest.approx(5 * 1.1 + 2.0)  # two share a core
    assert model.seconds(8, cores=8) == pytest.approx(5 * 0.6 + 2.0)
    assert model.seconds(3) == pytest.approx(14 * 0.6 + 2.0)  # the last round is not full


def test_one_long_chunk_or_a_slow_scheduler_bounds_the_speed_up() -> None:
    uneven = FarmModel(np.array([8.0] + [0.1] * 80), 0.0, 0.0, 0.0, 1.0, cores=64)
    assert uneven.seconds(64) == pytest.approx(8.0)
    slow = FarmModel(np.full(100, 0.1), 0.0, 0.05, 0.0, 1.0, cores=64)
    assert slow.seconds(64) == pytest.approx(100 * 0.05 + 0.1)


def test_the_fit_finds_the_parameters_of_made_up_timings() -> None:
    truth = FarmModel(np.linspace(0.2, 0.4, 50), 0.02, 1e-3, 0.3, 1.1, cores=core_count())
    model = fitted(truth.chunk_s.tolist(), {1: truth.seconds(1)}, (truth.chunk_s * 1.1).tolist(), 1e-3, 0.3)
    assert model.overhead_s == pytest.approx(0.02, rel=2e-3) and model.contention == pytest.approx(1.1)
    assert model.seconds(2) == pytest.approx(truth.seconds(2), rel=1e-3)
