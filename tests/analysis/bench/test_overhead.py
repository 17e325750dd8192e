"""Shares of the stages, and the transform that stands beside ours."""

import numpy as np
import pytest
import torch

from analysis.bench.cycles import synthetic_trace
from analysis.bench.options import BenchOptions
from analysis.bench.overhead import (
    CONTROL,
    MEASURED_CYCLES,
    CycleTimes,
    PyWaveletsStream,
    limit_rows,
    stage_rows,
    thesis_cycles,
    transform_row,
)
from analysis.bench.rows import NOT_INSTALLED
from analysis.command.progress import Task
from tsar import haar
from tsar.config import TsarConfig
from tsar.morton import raster_to_morton

COUNTERS = {"primary_rays": 100, "shadow_rays": 80, "reflection_rays": 20}


def cycle(control: float, reconstruction: float, tracing: float = 10.0) -> CycleTimes:
    taken = dict.fromkeys(CONTROL, control / len(CONTROL)) | {"tracing": tracing, "reconstruction": reconstruction}
    return CycleTimes(taken, COUNTERS)


def test_shares_of_tracing_against_their_limits() -> None:
    found = [cycle(1.0, 7.0), cycle(2.0, 8.0), cycle(3.0, 9.0)]
    control, reconstruction = limit_rows("chase", found)
    assert control.ours == pytest.approx(0.2) and control.peer == 0.15 and control.ratio == pytest.approx(0.75)
    assert reconstruction.ours == pytest.approx(0.8) and reconstruction.ratio == pytest.approx(0.75)
    assert control.met is False and reconstruction.met is False
    assert [row.met for row in limit_rows("chase", [cycle(1.4, 5.9)] * 3)] == [True, True]
    assert control.note == "2000.00 ms beside 10000.00 ms of tracing"


def test_each_stage_stands_beside_its_modelled_share() -> None:
    rows = {row.name: row for row in stage_rows(TsarConfig(), [cycle(5.0, 5.0)] * 3)}
    assert set(rows) == {f"all scenes, {name}" for name in (*CONTROL, "tracing", "reconstruction")}
    assert sum(row.ours for row in rows.values()) == pytest.approx(1.0)
    assert rows["all scenes, tracing"].ours == pytest.approx(0.5)
    assert rows["all scenes, cache"].peer is None
    assert sum(row.peer or 0.0 for row in rows.values()) == pytest.approx(1.0)
    assert "2.00 segments" in rows["all scenes, tracing"].note


def test_a_run_is_measured_past_its_warm_up() -> None:
    asked = []

    def trace(batch):
        asked.append(batch.cycle)
        return synthetic_trace(batch)

    config = TsarConfig(batch_size=16, resolution_px=64, sdf_side=16, cache_size=64, warmup_cycles=2)
    found = thesis_cycles(config, trace, Task())
    assert len(found) == MEASURED_CYCLES and found[0].counters["primary_rays"] == 16 * 256
    assert set(CONTROL) < set(found[0].stage_s)
    assert asked[-MEASURED_CYCLES:] == list(range(MEASURED_CYCLES))


def test_pywavelets_finds_the_coefficients_that_ours_finds() -> None:
    """Over some updates after black history, up to the normalisation: PyWavelets' is orthonormal."""
    pytest.importorskip("pywt")
    tiles, side, raster = 5, 16, raster_to_morton(16)
    generator = torch.Generator().manual_seed(1)
    stream = PyWaveletsStream(tiles, side)
    state, known = torch.zeros(tiles, haar.state_size(256)), torch.ones(tiles, dtype=torch.bool)
    state[:, -1] = haar.updates_needed(3)
    for _ in range(10):
        signal = torch.rand(tiles, 256, generator=generator)
        octaves, state = haar.transform(signal, state, known)
        theirs = stream.update(signal[:, raster].reshape(tiles, side, side).numpy())
        assert len(theirs) == len(octaves) == 4
        for number, (octave, (low, high)) in enumerate(zip(octaves, theirs, strict=True)):
            order = raster_to_morton(side >> (number + 1))
            # by columns: x low and y high is their second
            pairs = ((octave.hgh, low[1]), (octave.ghh, low[2]), (octave.ggh, low[3]))
            pairs += ((octave.hhg, high[0]), (octave.hgg, high[1]), (octave.ghg, high[2]), (octave.ggg, high[3]))
            lows = (2, 2, 1, 2, 1, 1, 0)
            for (mine, other), count in zip(pairs, lows, strict=True):
                scale = 2.0 ** (count / 2.0 - (3 - count) / 2.0)
                np.testing.assert_allclose(mine[:, order].numpy() * scale, other.reshape(tiles, -1), atol=2e-6)


def test_the_transform_is_measured_with_and_without_a_peer(monkeypatch: pytest.MonkeyPatch) -> None:
    options = BenchOptions(batch_size=8)
    task = Task()
    row = transform_row(options, task)
    assert row.target == 5.0 and row.peer and row.ratio and task.done == row.repetitions == options.repetitions
    monkeypatch.setattr("analysis.bench.overhead.installed", lambda module: False)
    assert transform_row(options, Task()).note == NOT_INSTALLED
