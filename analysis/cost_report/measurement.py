"""Measured cost of the pipeline over a grid of settings.

Settings take turns, so that changes in the machine's speed affect all settings alike. The renderer and the pipeline are
imported when a measurement begins.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import islice
from statistics import median
from typing import TYPE_CHECKING

from analysis.command.cli import bad_input, require_memory
from analysis.cost_report.options import MeasurementOptions
from analysis.cost_report.refit import Cell, MemoryTrace
from analysis.metrics.cost_model import RAYS, measured_parameters
from tsar.config import TsarConfig

if TYPE_CHECKING:
    from analysis.command.progress import Bars, Task
    from renderer.trace import Renderer
    from scenes.canonical import Scene
    from tsar.policy import Policy

_BYTES_PER_PIXEL = 320  # bytes: images and age fields in use, and the framed image


def _segments(counters: Sequence[Mapping[str, int]]) -> float:
    total = {name: sum(found.get(name, 0) for found in counters) for name in RAYS}
    return sum(total.values()) / total["primary_rays"]


@dataclass(frozen=True)
class Measurement:
    """The measurement, and the machine that made it.

    Attributes:
        cells: one for each setting.
        memory: None if it was left out.
        device, threads, torch_threads: device of tracing, threads that trace, threads of the other stages.
        load_average: load of the machine over the minute before; other programs disturb all times.
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
        InputError: the machine or the input cannot provide what the options ask for.
    """
    with bad_input():
        require_memory(_needed_bytes(options), f"measured_resolutions: {options.measured_resolutions}")
    from renderer.trace import Renderer
    from scenes import catalog

    with bad_input():
        scene = catalog.load(options.input)
        sides, threads = sorted({side for _, side in options.settings}), options.threads or None
        # the texture filter depends on the output side
        return scene, {side: Renderer(scene, options.device, threads, side) for side in sides}


def measure(options: MeasurementOptions, ready: tuple[Scene, Mapping[int, Renderer]], bars: Bars) -> Measurement:
    """Watches memory first, before other settings fill it, and then measures every setting."""
    import psutil
    import torch

    scene, found = ready
    load, memory = psutil.getloadavg()[0], None
    if options.memory_cycles:
        renderer, task = found[options.measured_resolution], bars.task("memory", options.memory_cycles)
        memory = watch_memory(options, renderer, scene.duration_s, task)
    cells = measure_cells(options, found, bars.task("measurement", options.repetitions + 1))
    threads = next(iter(found.values())).threads
    return Measurement(cells, memory, options.device, threads, torch.get_num_threads(), load)


def _policy(config: TsarConfig, renderer: Renderer) -> Policy:
    """The adaptive pipeline on all threads of a renderer."""
    from renderer.stages.control import stages
    from tsar.policies.thesis import Thesis
    from tsar.policy import Setting

    return Thesis(Setting(config, lambda config: stages(config, threads=renderer.threads)))


@dataclass
class _Adaptive:
    """A pipeline that runs a few more cycles at each call. Changes in place."""

    config: TsarConfig
    renderer: Renderer
    options: MeasurementOptions
    stage_s: list[dict[str, float]] = field(default_factory=list)
    counters: list[dict[str, int]] = field(default_factory=list)

    def __post_init__(self) -> None:
        from analysis.storage.invariants import unbroken
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

        number, timer, policy = len(self.image_s), StageTimer(), Framed(Setting(self.config))
        moment = Moment(number * self.options.cycles_per_turn * self.options.cycle_s, number, self.options.cycle_s)
        with timer("batch"):
            state, batch = policy.request(policy.start(), moment)
        with timer("tracing"):
            samples = self.renderer.trace(batch)
        policy.observe(state, batch, samples, moment, timer)
        self.image_s.append(timer.total)
        self.trace_s.append(timer.seconds["tracing"])
        self.counters.append(samples.counters)


def _needed_bytes(options: MeasurementOptions) -> float:
    """Approximate memory of all settings together, bytes."""
    configs = [options.pipeline(*setting) for setting in options.settings]
    cached = sum(config.cache_slots * config.samples * 24 for config in configs)
    return cached + sum(config.resolution_px**2 * _BYTES_PER_PIXEL for config in configs)


def measure_cells(options: MeasurementOptions, found: Mapping[int, Renderer], task: Task) -> list[Cell]:
    """Runs every setting in turns; the first turn after the warm-up is not counted.

    Args:
        options: the settings.
        found: a renderer for each output side.
        task: progress over ``repetitions + 1`` rounds, the first of which is the warm-up.
    """
    from analysis.command.timing import take_turns

    adaptive = {s: _Adaptive(options.pipeline(*s), found[s[1]], options) for s in options.settings}
    framed = {side: _Framed(options.pipeline(options.measured_batch, side), found[side], options) for side in found}
    for cell in adaptive.values():
        cell.warm_up()
    task.advance()
    cases = {str(key): case for key, case in (*adaptive.items(), *framed.items())}
    take_turns(cases, options.repetitions, task)
    return [_cell(setting, cell, framed[setting[1]]) for setting, cell in adaptive.items()]


def _cell(setting: tuple[int, int], adaptive: _Adaptive, framed: _Framed) -> Cell:
    from analysis.comparison.experiment import RunOptions

    skip = adaptive.options.cycles_per_turn
    stages, counters = adaptive.stage_s[skip:], adaptive.counters[skip:]
    segments, drawn = _segments(counters), sum(one["framelet_pixels"] for one in counters) / len(counters)
    cost = RunOptions(adaptive.options.input, adaptive.config, trace_segments=segments).cost
    return Cell(
        *setting,
        stage_s={name: median(found[name] for found in stages) for name in stages[0]},
        cycle_s=median(sum(found.values()) for found in stages),
        segments=segments,
        parameters=measured_parameters(cost, {"framelet_pixels": drawn}),
        image_s=median(framed.image_s[1:]),
        image_trace_s=median(framed.trace_s[1:]),
        image_segments=_segments(framed.counters[1:]),
        cycles=len(stages),
        images=len(framed.image_s) - 1,
    )


def watch_memory(options: MeasurementOptions, renderer: Renderer, span_s: float, task: Task) -> MemoryTrace:
    """Resident memory over a run of the centre setting that takes at most ``span_s`` seconds of animation time."""
    import psutil

    from analysis.storage.invariants import unbroken
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
            task.reach(record.cycle)
    return MemoryTrace(*options.centre, before, cycles, bytes_)


def _total(config: TsarConfig, options: MeasurementOptions) -> int:
    return config.warmup_cycles + options.memory_cycles + 1
