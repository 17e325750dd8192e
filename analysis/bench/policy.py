"""Group tsar: the time of each stage of the policy ``tsar`` in a cycle, beside its tracing."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import fields, replace
from itertools import islice
from statistics import median
from typing import TYPE_CHECKING, Any

from analysis.bench.cycles import default_stages
from analysis.bench.options import BenchOptions
from analysis.bench.overhead import pipeline_config
from analysis.bench.rows import Row, limit_row
from analysis.bench.scenes import driving_scenes, renderer_of
from tsar.clock import fixed_clock
from tsar.config import TsarConfig
from tsar.filtering.stages import FilterStages
from tsar.policies.filter import Filter
from tsar.policy import Setting, run
from tsar.stages import Stages

if TYPE_CHECKING:
    from analysis.command.progress import Bars, Task
    from renderer.trace import Renderer

CYCLE_S = 0.005
"""Animation time of a cycle of ``tsar``, seconds: about that of the cost model at the defaults."""
MEASURED_CYCLES = 240
ALL_ELSE_LIMIT = 0.60
NAMES = {
    "advanced": "move",
    "chosen": "choose tiles",
    "taken_in": "take in",
    "drifted": "shadows",
    "detailed": "tell noise",
    "displayed": "smooth",
}
"""Stages of the filter by the names of their rows."""
TRACING, REST, ALL_ELSE = "tracing", "remaining", "all but tracing"


def policy(options: BenchOptions, bars: Bars) -> Iterator[Row]:
    """Wall time of the stages on the driving scenes, and the ratio of all other stages together to tracing."""
    scenes = driving_scenes(options)
    task = bars.task("tsar", len(scenes) * MEASURED_CYCLES)
    for name, scene in scenes.items():
        renderer = renderer_of(scene, options)
        found = policy_cycles(pipeline_config(options), renderer, task)
        renderer.close()
        yield from policy_rows(name, found)


def policy_cycles(config: TsarConfig, renderer: Renderer, task: Task) -> list[Mapping[str, float]]:
    """Seconds by stage of the cycles after the warm-up."""
    seconds: dict[str, float] = {}
    made = lambda config: timed(default_stages(config), seconds)  # noqa: E731
    setting = Setting(config, made, view=renderer.viewpoint, random=lambda: renderer.random)
    tsar, found = Filter(setting), []
    trace = run(tsar, renderer.trace, fixed_clock(CYCLE_S), 0.0, math.inf)
    for number, (_, display) in enumerate(islice(trace, tsar.warmup_cycles + MEASURED_CYCLES)):
        assert display.spent is not None
        whole = display.spent.stage_s
        if number >= tsar.warmup_cycles:
            found.append(divided(whole, seconds))
            task.advance()
        seconds.clear()
    return found


def timed(stages: Stages, seconds: dict[str, float]) -> Stages:
    """The same stages; those of the filter add their time to ``seconds``, by name."""

    def noting(name: str, stage: Callable[..., Any]) -> Callable[..., Any]:
        def noted(*arguments: Any) -> Any:
            start = time.perf_counter()
            found = stage(*arguments)
            seconds[name] = seconds.get(name, 0.0) + time.perf_counter() - start
            return found

        return noted

    filtering = {
        field.name: noting(field.name, getattr(stages.filtering, field.name)) for field in fields(FilterStages)
    }
    return replace(stages, filtering=FilterStages(**filtering))


def divided(whole: Mapping[str, float], stages: Mapping[str, float]) -> dict[str, float]:
    """Seconds of a cycle by the names of the rows: tracing, the filter's stages, the rest, and all but tracing."""
    rest = sum(whole.values()) - whole["tracing"]
    named = {label: stages.get(name, 0.0) for name, label in NAMES.items()}
    return {TRACING: whole["tracing"], **named, REST: rest - sum(stages.values()), ALL_ELSE: rest}


def policy_rows(name: str, found: Sequence[Mapping[str, float]]) -> Iterator[Row]:
    """Milliseconds of each stage on one scene, and all but tracing against its limit."""
    taken_ms = {label: 1e3 * median(cycle[label] for cycle in found) for label in found[0]}
    for label, value in taken_ms.items():
        yield Row("tsar", f"{name}, {label}", "ms", value, repetitions=len(found), less_is_better=True)
    note = f"{taken_ms[ALL_ELSE]:.2f} ms beside {taken_ms[TRACING]:.2f} ms of tracing"
    row = Row("tsar", f"{name}, share", "share of tracing", 0.0, "limit", note=note)
    yield limit_row(row, [cycle[ALL_ELSE] / cycle[TRACING] for cycle in found], ALL_ELSE_LIMIT)
