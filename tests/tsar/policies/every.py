"""Every policy of the table, with both sets of stages where it has them, on scenes of flat layers of 64 pixels."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import pytest
import torch
from torch import Tensor

from renderer.stages.control import stages
from tests.oracles.screens import Screen
from tests.tsar.policies.test_behaviour import CONFIG, SIDE
from tsar.config import StagesName
from tsar.policies import POLICIES
from tsar.policy import Policy, Setting
from tsar.types import FrameletBatch, SampleBatch, Trace

STAGED = ("tsar", "filter", "tsar-densities", "tsar-wavelets", "tsar-densities-wavelets", "surfel", "thesis")
"""Policies whose stages are compiled too."""
BOTH = ("tsar", "filter", "thesis")
"""Of these, those that both sets are tried with; the others are made of the same stages."""


def _kinds(name: str) -> tuple[StagesName, ...]:
    return ("compiled", "reference") if name in BOTH else ("compiled",) if name in STAGED else ("reference",)


def _slow(name: str, kind: StagesName) -> bool:
    return (name, kind) == ("tsar", "reference") or name == "tsar-densities-wavelets"


CASES = [
    pytest.param(name, kind, marks=[pytest.mark.slow] if _slow(name, kind) else [])
    for name in POLICIES.names()
    for kind in _kinds(name)
]

Spoil = Callable[[Tensor, Tensor, Tensor], Tensor]
"""``(color, x, y) -> color``: what becomes of samples at places in pixels."""


def spoiled(screen: Screen, spoil: Spoil) -> Trace:
    """A renderer of a screen whose samples are spoiled."""

    def trace(batch: FrameletBatch) -> SampleBatch:
        found = screen.trace(batch)
        x, y = (batch.position * SIDE).floor().unbind(-1)
        return replace(found, color=spoil(found.color.clone(), x, y))

    return trace


def made(policy: str, kind: StagesName, screen: Screen, trace: Trace | None = None) -> Policy:
    """A policy with all that any of them asks for; the truth is that of the screen."""

    def truth(time_s: float) -> Tensor:
        return screen.picture(time_s, SIDE, 1)

    return POLICIES[policy](
        Setting(CONFIG, lambda config: stages(config, kind, 1), truth, trace or screen.trace, screen.view)
    )


def share_of_a_batch(policy: Policy) -> float:
    """How long its cycles are, beside those of a batch."""
    return policy.price.samples / CONFIG.budget


def places(spots: dict[tuple[int, int], float]) -> Spoil:
    """Single pixels that have other values."""

    def spoil(color: Tensor, x: Tensor, y: Tensor) -> Tensor:
        for (column, row), value in spots.items():
            color[(x == column) & (y == row)] = value
        return color

    return spoil


def away_from(spots: list[tuple[int, int]], pixels: int) -> Tensor:
    """Which pixels lie farther than so many from all of some."""
    row, column = torch.meshgrid(torch.arange(SIDE), torch.arange(SIDE), indexing="ij")
    far = torch.ones(SIDE, SIDE, dtype=torch.bool)
    for x, y in spots:
        far &= torch.maximum((column - x).abs(), (row - y).abs()) > pixels
    return far
