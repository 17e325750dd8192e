"""Measured cost of the real pipeline over a grid of settings, and the cost model's constants refitted to it.

Settings take turns, so that a machine's ups and downs fall on all alike. Knows the renderer and the pipeline; both are
imported when a measurement begins.
"""

from __future__ import annotations

import dataclasses
import math
import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import islice
from statistics import median
from typing import TYPE_CHECKING, Literal

from analysis.command import limits
from analysis.command.cli import bad_input, require_memory
from analysis.cost_report.refit import Cell, MemoryTrace
from analysis.metrics.cost_model import RAYS
from tsar.config import TsarConfig, closed_choices, require

if TYPE_CHECKING:
    from analysis.command.progress import Bars
    from renderer.trace import Renderer
    from scenes.canonical import Scene
    from tsar.policy import Policy

_BYTES_PER_PIXEL = 320  # images and age fields in flight, and the framed image
_FEWEST_BATCHES, _FEWEST_RESOLUTIONS = 3, 3


@dataclass(frozen=True)
@closed_choices()
class MeasurementOptions:
    """What is run to hold against the model."""

    input: str = "fly-by"
    """Built-in input, by name or number."""
    measured_batches: tuple[int, ...] = (32, 64, 128, 256, 512)
    """Batch sizes measured at the output side measured_resolution."""
    measured_resolutions: tuple[int, ...] = (128, 256, 512, 1024)
    """Output sides measured at the batch size measured_batch, pixels."""
    measured_batch: int = 128
    """Batch size at which output sides are compared."""
    measured_resolution: int = 512
    """Output side at which batch sizes are compared, pixels."""
    repetitions: int = 10
    """Turns of each setting."""
    cycles_per_turn: int = 4
    """Pipeline cycles a setting runs in its turn."""
    cycle_s: float = 0.02
    """Animation time a cycle takes, seconds; the ledger thesis gives about this at the defaults."""
    measured_warmup: int = 0
    """Cycles of every setting before it is measured; 0 runs until the cache is full, 48 at least."""
    memory_cycles: int = 600
    """Cycles over which resident memory is watched; 0 leaves it out."""
    memory_every: int = 10
    """Cycles between two looks at resident memory."""
    device: Literal["cpu", "cuda:0"] = "cpu"
    """Where rays are traced."""
    threads: int = 0
    """Threads for tracing; 0 takes one per core."""

    def __post_init__(self) -> None:
        for name in ("measured_batches", "measured_resolutions"):
            least = _FEWEST_BATCHES if name == "measured_batches" else _FEWEST_RESOLUTIONS
            values = getattr(self, name)
            require(len(set(values)) >= least, name, f"at least {least} different values", values)
        limits.within(
            self,
            measured_batches=(1, 8192),
            measured_batch=(1, 8192),
            measured_resolutions=(64, 8192),
            measured_resolution=(64, 8192),
            repetitions=limits.REPETITIONS,
            cycles_per_turn=(1, 10_000),
            cycle_s=(1e-6, 3600.0),
            measured_warmup=(0, 100_000),
            memory_cycles=(0, limits.CYCLES_MOST),
            memory_every=(1, limits.CYCLES_MOST),
            threads=limits.THREADS,
        )
        asked = self.repetitions * self.cycles_per_turn * len(self.settings)
        limits.require_count("repetitions", self.repetitions, asked, "cycles measured")
        few = self.memory_cycles == 0 or self.memory_cycles >= 4 * self.memory_every
        require(few, "memory_cycles", "0, or at least 4 times memory_every", self.memory_cycles)
        for setting in self.settings:
            self.pipeline(*setting)

    @property
    def settings(self) -> list[tuple[int, int]]:
        """Batch size and output side of every setting."""
        batches = [(batch, self.measured_resolution) for batch in self.measured_batches]
        sides = [(self.measured_batch, side) for side in self.measured_resolutions]
        return sorted({*batches, *sides, self.centre})

    @property
    def centre(self) -> tuple[int, int]:
        """The setting at which all ledgers are compared."""
        return self.measured_batch, self.measured_resolution

    def pipeline(self, batch_size: int, resolution_px: int) -> TsarConfig:
        """Configuration of a setting; what is not said here is the pipeline's own."""
        config = TsarConfig(batch_size=batch_size, resolution_px=resolution_px)
        full = max(config.warmup_cycles, -(-config.cache_slots // batch_size))
        return dataclasses.replace(config, warmup_cycles=self.measured_warmup or full)


def _segments(counters: Sequence[Mapping[str, int]]) -> float:
    total = {name: sum(found.get(name, 0) for found in counters) for name in RAYS}
    return sum(total.values()) / total["primary_rays"]


@dataclass(frozen=True)
class Measurement:
    """What was measured, and on what.

    Attributes:
        cells: one a setting.
        memory: None where it was left out.
        device, threads, torch_threads: where rays are traced, threads that trace, threads of the other stages.
        load_average: of the machine over the minute before; what other programs take disturbs all seconds.
    """

    cells: Sequence[Cell]
    memory: MemoryTrace | None
    device: str
    threads: int
    torch_threads: int
    load_average: float

    def centre(self, options: MeasurementOptions) -> Cell:
        """The setting at which ledgers are compared."""
        return next(cell for cell in self.cells if (cell.batch_size, cell.resolution_px) == options.centre)


def prepare(options: MeasurementOptions) -> tuple[Scene, dict[int, Renderer]]:
    """Checks the memory, loads the scene and builds a renderer for each output side.

    Raises:
        InputError: something asked for cannot be had.
    """
    with bad_input():
        require_memory(_needed_bytes(options), f"measured_resolutions: {options.measured_resolutions}")
    from renderer.trace import Renderer
    from scenes import catalog

    with bad_input():
        scene = catalog.load(options.input)
        sides, threads = sorted({side for _, side in options.settings}), options.threads or None
        # how finely textures are filtered goes with the output side
        return scene, {side: Renderer(scene, options.device, threads, side) for side in sides}


def measure(options: MeasurementOptions, ready: tuple[Scene, Mapping[int, Renderer]], bars: Bars) -> Measurement:
    """Watches memory, then measures every setting; memory first, before other settings fill it."""
    import torch

    scene, found = ready
    load, memory = os.getloadavg()[0], None
    if options.memory_cycles:
        renderer, show = found[options.measured_resolution], bars.task("memory", options.memory_cycles)
        memory = watch_memory(options, renderer, scene.duration_s, show)
    cells = measure_cells(options, found, bars.task("measurement", options.repetitions + 1))
    threads = next(iter(found.values())).threads
    return Measurement(cells, memory, options.device, threads, torch.get_num_threads(), load)


def _policy(config: TsarConfig, renderer: Renderer) -> Policy:
    """The adaptive pipeline on all threads of a renderer."""
    from renderer.stages.control import stages
    from tsar.policies.adaptive import Adaptive
    from tsar.policy import Setting

    return Adaptive(Setting(config, lambda config: stages(config, threads=renderer.threads)))


@dataclass
class _Adaptive:
    """A pipeline that goes on a few cycles at each call. Changes in place."""

    config: TsarConfig
    renderer: Renderer
    options: MeasurementOptions
    stage_s: list[dict[str, float]] = field(default_factory=list)
    counters: list[dict[str, int]] = field(default_factory=list)

    def __post_init__(self) -> None:
        from analysis.storage.records import unbroken
        from tsar.clock import fixed_clock
        from tsar.policy import run

        clock = fixed_clock(self.options.cycle_s)
        self._cycles = unbroken(run(_policy(self.config, self.renderer), self.renderer.trace, clock, 0.0, math.inf))

    def warm_up(self) -> None:
        for _ in islice(self._cycles, self.config.warmup_cycles):
            pass

    def __call__(self) -> None:
        for record in islice(self._cycles, self.options.cycles_per_turn):
            self.stage_s.append(record.stage_s)
            self.counters.append(record.counters)


@dataclass
class _Framed:
    """A framed renderer that shows one image at each call. Changes in place."""

    config: TsarConfig
    renderer: Renderer
    options: MeasurementOptions
    image_s: list[float] = field(default_factory=list)
    trace_s: list[float] = field(default_factory=list)
    counters: list[dict[str, int]] = field(default_factory=list)

    def __call__(self) -> None:
        from tsar.clock import StageTimer
        from tsar.policies.framed import Framed
        from tsar.policy import Moment, Setting

        number, stage, policy = len(self.image_s), StageTimer(), Framed(Setting(self.config))
        moment = Moment(number * self.options.cycles_per_turn * self.options.cycle_s, number, self.options.cycle_s)
        with stage("batch"):
            state, batch = policy.request(policy.start(), moment)
        with stage("tracing"):
            samples = self.renderer.trace(batch)
        policy.observe(state, batch, samples, moment, stage)
        self.image_s.append(stage.total)
        self.trace_s.append(stage.seconds["tracing"])
        self.counters.append(samples.counters)


def _needed_bytes(options: MeasurementOptions) -> float:
    """Memory that all settings take side by side, about."""
    configs = [options.pipeline(*setting) for setting in options.settings]
    cached = sum(config.cache_slots * config.samples * 24 for config in configs)
    return cached + sum(config.resolution_px**2 * _BYTES_PER_PIXEL for config in configs)


def measure_cells(
    options: MeasurementOptions, found: Mapping[int, Renderer], on_round: Callable[[int], None] = lambda done: None
) -> list[Cell]:
    """Runs every setting in turns; the first turn after the warm-up is not counted.

    Args:
        options: the settings.
        found: a renderer for each output side.
        on_round: told how many of ``repetitions + 1`` rounds are done, the first being the warm-up.
    """
    from analysis.command.timing import take_turns

    adaptive = {s: _Adaptive(options.pipeline(*s), found[s[1]], options) for s in options.settings}
    framed = {side: _Framed(options.pipeline(options.measured_batch, side), found[side], options) for side in found}
    for cell in adaptive.values():
        cell.warm_up()
    on_round(1)
    cases = {str(key): case for key, case in (*adaptive.items(), *framed.items())}
    take_turns(cases, options.repetitions, lambda done: on_round(done + 1))
    return [_cell(setting, cell, framed[setting[1]]) for setting, cell in adaptive.items()]


def _cell(setting: tuple[int, int], adaptive: _Adaptive, framed: _Framed) -> Cell:
    from analysis.comparison.experiment import RunOptions

    skip = adaptive.options.cycles_per_turn
    stages, segments = adaptive.stage_s[skip:], _segments(adaptive.counters[skip:])
    return Cell(
        *setting,
        stage_s={name: median(found[name] for found in stages) for name in stages[0]},
        cycle_s=median(sum(found.values()) for found in stages),
        segments=segments,
        parameters=RunOptions(adaptive.options.input, adaptive.config, trace_segments=segments).cost,
        image_s=median(framed.image_s[1:]),
        image_trace_s=median(framed.trace_s[1:]),
        image_segments=_segments(framed.counters[1:]),
        cycles=len(stages),
        images=len(framed.image_s) - 1,
    )


def watch_memory(
    options: MeasurementOptions, renderer: Renderer, span_s: float, on_cycle: Callable[[int], None] = lambda done: None
) -> MemoryTrace:
    """Resident memory over a run of the centre setting that takes ``span_s`` of animation time at most."""
    import psutil

    from analysis.storage.records import unbroken
    from tsar.clock import fixed_clock
    from tsar.policy import run

    resident, config = psutil.Process().memory_info, options.pipeline(*options.centre)
    before = resident().rss
    clock = fixed_clock(min(options.cycle_s, span_s / options.memory_cycles if span_s > 0 else math.inf))
    cycles, bytes_ = [], []
    endless = run(_policy(config, renderer), renderer.trace, clock, 0.0, math.inf)
    for record in islice(unbroken(endless), _total(config, options)):
        if record.cycle >= 0 and record.cycle % options.memory_every == 0:
            cycles.append(record.cycle)
            bytes_.append(resident().rss)
            on_cycle(record.cycle)
    return MemoryTrace(*options.centre, before, cycles, bytes_)


def _total(config: TsarConfig, options: MeasurementOptions) -> int:
    return config.warmup_cycles + options.memory_cycles + 1
