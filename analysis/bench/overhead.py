"""Group overhead: the time of the stages around tracing, and the wavelet transform beside PyWavelets."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import islice
from statistics import median
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import torch

from analysis.bench.cycles import cycles, default_stages, steady
from analysis.bench.machine import installed
from analysis.bench.options import FRAMELET_SIDE, BenchOptions
from analysis.bench.rows import NOT_INSTALLED, Row, limit_row, rate_row
from analysis.bench.scenes import driving_scenes, morton_batches, renderer_of
from analysis.command.timing import take_turns
from analysis.metrics.cost_model import RAYS, measured_parameters, parameters_of, stage_flops
from tsar.cache import FrameletCache
from tsar.clock import StageTimer
from tsar.config import TsarConfig
from tsar.error import compressed_luminance
from tsar.morton import raster_to_morton
from tsar.stages import REFERENCE
from tsar.types import FrameletBatch, Trace

if TYPE_CHECKING:
    from analysis.command.progress import Bars, Task

CONTROL = ("selection", "error", "cache", "response", "tiling")
CONTROL_LIMIT, RECONSTRUCTION_LIMIT = 0.15, 0.60
DWT_TARGET = 5.0
MEASURED_CYCLES = 60


class CycleTimes(NamedTuple):
    """Wall seconds of every stage of a cycle, and its number of rays."""

    stage_s: Mapping[str, float]
    counters: Mapping[str, int]


def overhead(options: BenchOptions, bars: Bars) -> Iterator[Row]:
    """Shares of the stages on the driving scenes, and framelets per second of the transform."""
    config = pipeline_config(options)
    scenes = driving_scenes(options)
    task = bars.task("overhead", len(scenes) * MEASURED_CYCLES + options.repetitions)
    everything = []
    for name, scene in scenes.items():
        renderer = renderer_of(scene, options)
        found = thesis_cycles(config, renderer.trace, task)
        renderer.close()
        yield from limit_rows(name, found)
        everything += found
    yield from stage_rows(config, everything)
    yield transform_row(options, task)


def thesis_cycles(config: TsarConfig, trace: Trace, task: Task) -> list[CycleTimes]:
    """Cycles of a run after its cache is full."""
    found = []
    config = steady(config)
    for record in islice(cycles(config, trace), config.warmup_cycles, config.warmup_cycles + MEASURED_CYCLES):
        found.append(CycleTimes(record.stage_s, record.counters))
        task.advance()
    return found


def seconds_of(cycle: CycleTimes, names: Sequence[str]) -> float:
    """Seconds of the named stages together."""
    return sum(cycle.stage_s[name] for name in names)


def limit_rows(name: str, found: Sequence[CycleTimes]) -> Iterator[Row]:
    """Time of the control stages and of the reconstruction on one scene, against their limits relative to tracing."""
    traced_ms = 1e3 * median(cycle.stage_s["tracing"] for cycle in found)
    for what, stages, limit in (
        ("control stages", CONTROL, CONTROL_LIMIT),
        ("reconstruction", ("reconstruction",), RECONSTRUCTION_LIMIT),
    ):
        taken_ms = 1e3 * median(seconds_of(cycle, stages) for cycle in found)
        note = f"{taken_ms:.2f} ms beside {traced_ms:.2f} ms of tracing"
        row = Row("overhead", f"{name}, {what}", "share of tracing", 0.0, "limit", note=note)
        yield limit_row(row, [seconds_of(cycle, stages) / cycle.stage_s["tracing"] for cycle in found], limit)


def stage_rows(config: TsarConfig, found: Sequence[CycleTimes]) -> Iterator[Row]:
    """Each stage's share of a cycle over all scenes, beside its share in the cost model."""
    rays = sum(cycle.counters.get(name, 0) for cycle in found for name in RAYS)
    segments = rays / sum(cycle.counters["primary_rays"] for cycle in found)
    drawn = {"framelet_pixels": sum(cycle.counters.get("framelet_pixels", 0) for cycle in found) / len(found)}
    flops = stage_flops(measured_parameters(parameters_of(config, segments), drawn))
    modelled = {name: float(value) / float(sum(flops.values())) for name, value in flops.items()}
    for name in found[0].stage_s:
        measured = [cycle.stage_s[name] / sum(cycle.stage_s.values()) for cycle in found]
        note = "" if name in modelled else "the model has no such stage"
        yield Row(
            "overhead",
            f"all scenes, {name}",
            "share of a cycle",
            median(measured),
            "cost model",
            modelled.get(name),
            repetitions=len(measured),
            less_is_better=True,
            note=f"{segments:.2f} segments a sample" if name == "tracing" else note,
        )


class PyWaveletsStream:
    """The streaming transform of a batch by PyWavelets: rows and columns of the new tiles, then each coefficient of
    octave o with that of 2^o updates before. Changes in place.

    Each call transforms a whole batch. ``zero`` is the fastest boundary mode, and for two values all modes agree.
    """

    def __init__(self, tiles: int, side: int) -> None:
        import pywt

        self._pywt: Any = pywt
        sides = [side >> octave for octave in range(1, side.bit_length())]
        self._before = [
            deque([np.zeros((4, tiles, half, half), np.float32)] * 2**octave, maxlen=2**octave)
            for octave, half in enumerate(sides)
        ]

    def update(self, tiles: np.ndarray) -> list[tuple[np.ndarray, np.ndarray]]:
        """Low and high pass along time ``(4, n, h, w)`` of each octave; the four are LL, LH, HL, HH by rows, columns.

        Args:
            tiles: ``(n, side, side)`` float32, raster order.
        """
        octaves, field = [], tiles
        for before in self._before:
            now = np.stack(self._spatial(field))
            low, high = self._pywt.dwt(np.stack([now, before[0]], axis=-1), "haar", mode="zero", axis=-1)
            octaves.append((low[..., 0], high[..., 0]))
            before.append(now)
            # orthonormal steps along three axes, where ours are means
            field = low[0, ..., 0] * np.float32(8.0**-0.5)
        return octaves

    def _spatial(self, field: np.ndarray) -> list[np.ndarray]:
        low, (horizontal, vertical, both) = self._pywt.dwt2(field, "haar", mode="zero", axes=(1, 2))
        return [low, horizontal, vertical, both]


def transform_row(options: BenchOptions, task: Task) -> Row:
    """The streaming transform of one batch, ours beside PyWavelets, on the same framelets.

    Ours cannot be timed alone: it is one pass from colours to norms and errors that also stores the batch in the
    cache. All of that is timed.
    """
    batch, color, cache = estimated_batch(options)
    config = pipeline_config(options)
    observe, tiles = default_stages(config).observe, batch.level.shape[0]
    cases: dict[str, Callable[[], object]] = {
        "ours": lambda: [observe(batch, color, cache, config, StageTimer()) for _ in range(_CALLS)]
    }
    note = NOT_INSTALLED
    if installed("pywt"):
        raster = compressed_luminance(color)[:, raster_to_morton(FRAMELET_SIDE)]
        images = raster.reshape(tiles, FRAMELET_SIDE, FRAMELET_SIDE).numpy()
        stream = PyWaveletsStream(tiles, FRAMELET_SIDE)
        cases["peer"] = lambda: [stream.update(images) for _ in range(_CALLS)]
        note = "ours with luminance, norms, errors, cache; peer: one call of each filter for all framelets of an octave"
    seconds = take_turns(cases, options.repetitions, task)
    row = Row("overhead", f"wavelet transform of {tiles} framelets", "k framelets/s", 0.0, "PyWavelets", note=note)
    return rate_row(row, _CALLS * tiles / 1e3, seconds["ours"], seconds.get("peer"), DWT_TARGET)


def pipeline_config(options: BenchOptions) -> TsarConfig:
    """The default configuration with the batches and pictures asked for."""
    return TsarConfig(batch_size=options.batch_size, resolution_px=options.resolution_px)


def estimated_batch(options: BenchOptions) -> tuple[FrameletBatch, torch.Tensor, FrameletCache]:
    """A batch, its colours, and a cache with an earlier batch of the same tiles, so that every tile has a history."""
    config = pipeline_config(options)
    cache = FrameletCache(config)
    batch = morton_batches(options, 0.0)[0]
    generator = torch.Generator().manual_seed(0)
    earlier, color = torch.rand(2, *batch.times.shape, 3, generator=generator).unbind(0)
    REFERENCE.observe(batch, earlier, cache, config, StageTimer())
    return batch, color, cache


_CALLS = 20
