"""Shared by comparisons of two sets of stages: tolerances, and common initial states."""

from __future__ import annotations

import torch

from tsar.cache import FrameletCache
from tsar.config import TsarConfig
from tsar.decision import Decision
from tsar.selection import Request, request
from tsar.tiling import build
from tsar.types import Densities, Errors, Tiling

CACHE_FIELDS = ("level", "index", "time_s", "dead", "color", "coefficients", "slot_of_node")


def same_tiling(ours: Tiling, theirs: Tiling) -> bool:
    return torch.equal(ours.level, theirs.level) and torch.equal(ours.index, theirs.index)


def assert_same_densities(ours: Densities, theirs: Densities, config: TsarConfig) -> None:
    # near a double root of its quadratic an element moves by the square root of the rounding
    torch.testing.assert_close(ours.spatial, theirs.spatial, rtol=1e-7, atol=0.0)
    torch.testing.assert_close(ours.temporal, theirs.temporal, rtol=1e-7, atol=0.0)
    assert abs(ours.surplus - theirs.surplus) <= 1e-12 * config.budget


def assert_same_cache(ours: FrameletCache, theirs: FrameletCache) -> None:
    for field in CACHE_FIELDS:
        if field == "coefficients":
            torch.testing.assert_close(ours.coefficients, theirs.coefficients, rtol=0.0, atol=1e-6)
        else:
            assert torch.equal(getattr(ours, field), getattr(theirs, field)), field


def assert_same_request(ours: Request, theirs: Request) -> None:
    for field in ("selected", "history", "level", "index", "position"):
        assert torch.equal(getattr(ours, field), getattr(theirs, field)), field


def decided_by_reference(densities: Densities, history: torch.Tensor, config: TsarConfig) -> Decision:
    """What follows from densities that are given."""
    tiling = build(densities.spatial, config)
    return Decision(densities, tiling, request(tiling, densities.temporal, history, config))


def errors_of(kind: str, g: torch.Generator, elements: int) -> Errors:
    noise = 2 * torch.rand(2, elements, generator=g) - 1
    noise[:, torch.rand(elements, generator=g) < 0.6] = 0.0
    if kind == "all ask":
        noise = noise.abs()
    if kind == "all free":
        noise = -noise.abs()
    if kind == "few ask much":
        noise = torch.where(torch.rand(elements, generator=g) < 0.01, noise.abs(), -1e-3 * noise.abs())
    if kind == "none":
        noise.zero_()
    return Errors(noise[0].contiguous(), noise[1].contiguous())
