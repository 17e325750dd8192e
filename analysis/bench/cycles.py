"""A pipeline that the benchmark runs a few cycles at a time, and a renderer of negligible cost."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from itertools import islice

import torch

from analysis.storage.invariants import unbroken
from tsar.clock import StageTimer, fixed_clock
from tsar.config import TsarConfig
from tsar.policies.thesis import Thesis
from tsar.policy import Setting, run
from tsar.stages import Stages
from tsar.types import Densities, Errors, FrameletBatch, SampleBatch, StepRecord, Trace

CYCLE_S = 0.02
"""Animation time of a cycle of ``thesis``, seconds: about that of the cost model at the defaults."""
_TILINGS_PER_CALL = 20


def steady(config: TsarConfig) -> TsarConfig:
    """The configuration with a warm-up that fills the cache."""
    return replace(config, warmup_cycles=max(config.warmup_cycles, -(-config.cache_slots // config.batch_size)))


def default_stages(config: TsarConfig) -> Stages:
    """The stages that a run uses by default, on all cores."""
    from renderer.compute.device import core_count
    from renderer.stages.control import stages

    return stages(config, threads=core_count())


def cycles(config: TsarConfig, trace: Trace, cycle_s: float = CYCLE_S) -> Iterator[StepRecord]:
    """Records of an endless run, including those of the warm-up, which have negative numbers."""
    policy = Thesis(Setting(config, default_stages))
    return unbroken(run(policy, trace, fixed_clock(cycle_s), 0.0, math.inf))


@dataclass
class RunningPipeline:
    """A pipeline past its warm-up that runs a few more cycles at each call. Changes in place.

    Attributes:
        stage_s: wall seconds of every stage, one entry a cycle.
    """

    config: TsarConfig
    trace: Trace
    cycles_per_turn: int = 4
    stage_s: list[dict[str, float]] = field(default_factory=list)

    def __post_init__(self) -> None:
        self._cycles = cycles(self.config, self.trace)
        for _ in islice(self._cycles, self.config.warmup_cycles):
            pass

    def __call__(self) -> None:
        self.stage_s += [record.stage_s for record in islice(self._cycles, self.cycles_per_turn)]

    def turns(self) -> list[list[dict[str, float]]]:
        """Stage seconds by turn, without the first, which is not counted."""
        width = self.cycles_per_turn
        return [self.stage_s[first : first + width] for first in range(width, len(self.stage_s), width)]


class Tilings:
    """Decisions over one density field with zero errors, which leave it unchanged; each call times its tilings.

    Attributes:
        seconds: time of a tiling, one entry a call.
    """

    def __init__(self, config: TsarConfig, field: torch.Tensor) -> None:
        self.seconds: list[float] = []
        self._config, self._decide = config, default_stages(config).decide
        self._densities = Densities(field, torch.full_like(field, 0.5))
        self._errors = Errors(*torch.zeros(2, field.numel()).unbind(0))

    def __call__(self) -> None:
        timer = StageTimer()
        for _ in range(_TILINGS_PER_CALL):
            self._decide(self._densities, self._errors, self._densities.temporal, self._config, timer)
        self.seconds.append(timer.seconds["tiling"] / _TILINGS_PER_CALL)


def synthetic_trace(batch: FrameletBatch) -> SampleBatch:
    """Ripples that run over the picture: enough for densities to move, at negligible cost."""
    phase = 40.0 * batch.position[..., 0] * batch.position[..., 1] + 6.0 * batch.times.to(torch.float32)
    value = 0.5 + 0.5 * torch.sin(phase)
    return SampleBatch(value[..., None].expand(*value.shape, 3), {"primary_rays": value.numel()})
