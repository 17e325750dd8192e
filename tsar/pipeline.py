"""The pipeline as a recipe: render, estimate, cache, respond, re-tile, select, reconstruct.

Contains no mathematics; every stage is a function of its own module.

Source: Stephens 2011, sec. 3.4.4 and fig. 3.13.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from tsar.accounting import Account
from tsar.cache import FrameletCache
from tsar.clock import CycleSeconds, StageTimer, checked
from tsar.config import TsarConfig
from tsar.reconstruction import Reconstruction
from tsar.response import initial_densities
from tsar.selection import Request, initial_history, request
from tsar.stages import REFERENCE, Stages
from tsar.tiling import build
from tsar.types import Densities, Display, Errors, SampleBatch, StepRecord, Tiling, Trace

LATENCY_CYCLES = 3
"""TSAR shows what was sampled three cycles ago (sec. 3.4.4)."""


@dataclass(frozen=True)
class State:
    """What one cycle hands to the next. Frozen, but the cache within changes in place."""

    densities: Densities
    tiling: Tiling
    due: Request
    cache: FrameletCache


@dataclass(frozen=True)
class Outcome:
    """What one cycle produced, beside the next state."""

    samples: SampleBatch
    errors: Errors
    nonfinite: int
    reconstruction: Reconstruction
    stages: StageTimer


def initial_state(config: TsarConfig) -> State:
    """A uniform field, its tiling, what is due at first, and an empty cache."""
    densities = initial_densities(config)
    tiling = build(densities.spatial, config)
    due = request(tiling, densities.temporal, initial_history(config), config)
    return State(densities, tiling, due, FrameletCache(config))


def step(
    state: State,
    config: TsarConfig,
    trace: Trace,
    time_s: float,
    cycle: int,
    cycle_s: float,
    stages: Stages = REFERENCE,
) -> tuple[State, Outcome]:
    """One cycle at animation time ``time_s``; ``cycle_s`` is the length of the last cycle, the unit of age."""
    stage = StageTimer()
    with stage("selection"):
        batch = state.due.at(time_s, cycle, config)
    with stage("tracing"):
        samples = trace(batch)
    observed = stages.observe(batch, samples.color, state.cache, config, stage)
    decided = stages.decide(state.densities, observed.errors, state.due.history, config, stage)
    with stage("reconstruction"):
        image = stages.reconstruct(state.cache, config, cycle_s)
    after = State(decided.densities, decided.tiling, decided.due, state.cache)
    return after, Outcome(samples, observed.errors, observed.nonfinite, image, stage)


def run(
    config: TsarConfig,
    trace: Trace,
    cycle_seconds: CycleSeconds,
    start_s: float,
    end_s: float,
    stages: Stages = REFERENCE,
) -> Iterator[tuple[StepRecord, Display]]:
    """Cycles from a warm start until the animation time passes ``end_s``.

    Warm-up cycles before ``start_s`` have negative numbers and are yielded too: the first images on the display come
    from them.

    Args:
        config: everything that decides the run.
        trace: the renderer.
        cycle_seconds: the clock.
        start_s, end_s: span of animation time to cover, seconds.
        stages: what runs the stages.
    """
    cycle_s = _probe(config, trace, cycle_seconds, start_s, stages)
    state = initial_state(config)
    cycle, time_s = -config.warmup_cycles, start_s - config.warmup_cycles * cycle_s
    while time_s < end_s:
        before = state
        state, outcome = step(state, config, trace, time_s, cycle, cycle_s, stages)
        cycle_s = checked(cycle_seconds, outcome.samples.counters, outcome.stages.total)
        shown = outcome.reconstruction
        account = stages.account(state.densities, outcome.errors, shown.samples.newest_s, config)
        record = _record(before, state, outcome, account, config, cycle, time_s, cycle_s)
        yield record, Display(time_s + LATENCY_CYCLES * cycle_s, time_s, shown.image, shown.samples)
        cycle, time_s = cycle + 1, time_s + cycle_s


def _probe(config: TsarConfig, trace: Trace, cycle_seconds: CycleSeconds, start_s: float, stages: Stages) -> float:
    """Length of a cycle, from two throw-away ones (the first may compile kernels)."""
    state = initial_state(config)
    for cycle in range(2):
        state, outcome = step(state, config, trace, start_s, cycle, 1.0, stages)
    return checked(cycle_seconds, outcome.samples.counters, outcome.stages.total)


def _record(
    before: State,
    after: State,
    outcome: Outcome,
    account: Account,
    config: TsarConfig,
    cycle: int,
    time_s: float,
    cycle_s: float,
) -> StepRecord:
    surplus = after.densities.surplus
    return StepRecord(
        cycle=cycle,
        sim_time_s=time_s,
        cost_s=cycle_s,
        tiling=before.tiling,
        selected=before.due.selected,
        densities=after.densities,
        errors=outcome.errors,
        surplus=surplus,
        conservation_residual=abs(account.combined + surplus - config.budget) / config.budget,
        stage_s=dict(outcome.stages.seconds),
        counters=dict(outcome.samples.counters),
        nonfinite=outcome.nonfinite,
        nonfinite_fields=account.nonfinite,
        age_spread_s=account.age_spread_s,
    )
