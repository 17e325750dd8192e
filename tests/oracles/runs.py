"""Runs of policies by name, for tests that are not about how a policy is made."""

from __future__ import annotations

from collections.abc import Iterator

from tsar.clock import CycleSeconds
from tsar.config import TsarConfig
from tsar.policies import POLICIES
from tsar.policy import Policy, Setting, Truth, run
from tsar.stages import REFERENCE, Stages
from tsar.types import ShownImage, StepRecord, Trace


def made(
    name: str, config: TsarConfig, stages: Stages = REFERENCE, truth: Truth | None = None, trace: Trace | None = None
) -> Policy:
    return POLICIES[name](Setting(config, lambda config: stages, truth, trace))


def play(
    name: str,
    config: TsarConfig,
    trace: Trace,
    clock: CycleSeconds,
    start_s: float,
    end_s: float,
    stages: Stages = REFERENCE,
    truth: Truth | None = None,
) -> Iterator[tuple[StepRecord | None, ShownImage]]:
    return run(made(name, config, stages, truth, trace), trace, clock, start_s, end_s)


def images(*arguments, **more) -> Iterator[ShownImage]:
    """As :func:`play`, without the records."""
    return (display for _, display in play(*arguments, **more))
