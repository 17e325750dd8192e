"""Compiled and reference stages side by side: cycle by cycle from the same state, so that rounding cannot add up.

As a command, ``python -m tests.renderer.stages.twins FIRST COUNT CYCLES``, for each of COUNT random configurations a
line when it begins and a line of what differs.
"""

from __future__ import annotations

import copy
import faulthandler
import sys
from collections.abc import Iterator

import torch

from renderer.stages.control import compiled_stages
from tests.oracles import pictures, runs
from tests.oracles.configurations import legal_configuration
from tsar.clock import StageTimer
from tsar.config import TsarConfig
from tsar.estimators import template_power
from tsar.policies.thesis import State
from tsar.selection import request
from tsar.stages import REFERENCE
from tsar.tiling import build
from tsar.types import Densities, FrameletBatch

CYCLE_S = 1 / 60


def differences(config: TsarConfig, number: int, cycles: int) -> Iterator[str]:
    """Differences between the two sets of stages over some cycles, or an invariant that either breaks."""
    stages, state = compiled_stages(config, 1 + number % 2), runs.made("thesis", config).start()
    for cycle in range(cycles):
        batch = state.due.at(cycle * CYCLE_S, cycle, config)
        color = _color(batch, number + cycle)
        theirs = copy.deepcopy(state.cache)
        found = stages.observe(batch, color, state.cache, config, StageTimer())
        wanted = REFERENCE.observe(batch, color, theirs, config, StageTimer())
        for name in ("spatial", "temporal"):
            pair = getattr(found.errors, name), getattr(wanted.errors, name)
            yield from _near(f"{name} error", *pair, 0.0, tolerance(config, name))
        yield from _same("non-finite samples", found.nonfinite, wanted.nonfinite)
        for name in ("level", "index", "time_s", "dead", "color", "slot_of_node"):
            yield from _same(f"cache.{name}", getattr(state.cache, name), getattr(theirs, name))
        yield from _near("cache.coefficients", state.cache.coefficients, theirs.coefficients, 0.0, 1e-6)
        given = state.densities, found.errors, state.due.history, config
        ours, other = (one.decide(*given, StageTimer()) for one in (stages, REFERENCE))
        for name in ("spatial", "temporal"):
            pair = getattr(ours.densities, name), getattr(other.densities, name)
            yield from _near(f"{name} density", *pair, 1e-7, 0.0)
        tiling = build(ours.densities.spatial, config)
        due = request(tiling, ours.densities.temporal, state.due.history, config)
        for name in ("level", "index"):
            yield from _same(f"tiling.{name}", getattr(ours.tiling, name), getattr(tiling, name))
        for name in ("selected", "history", "level", "index", "position"):
            yield from _same(f"request.{name}", getattr(ours.due, name), getattr(due, name))
        yield from _same("batch", int(ours.due.selected.unique().numel()), config.batch_size)
        for densities in (ours.densities, other.densities):
            yield from _broken(densities, config)
        theirs = copy.deepcopy(state.cache)
        image, plain = stages.reconstruct(state.cache, config, CYCLE_S), REFERENCE.reconstruct(theirs, config, CYCLE_S)
        yield from _near("image", image.image, plain.image, 1e-5, 1e-6)
        yield from _same("ages", image.sample_map.newest_s, plain.sample_map.newest_s)
        yield from _same("dead", state.cache.dead, theirs.dead)
        sums = [s.account(ours.densities, found.errors, image.sample_map.newest_s, config) for s in (stages, REFERENCE)]
        yield from _same("non-finite fields", sums[0].nonfinite + sums[1].nonfinite, 0)
        yield from _same("spread of ages", sums[0].age_spread_s, sums[1].age_spread_s)
        state = State(ours.densities, ours.tiling, ours.due, state.cache)


def tolerance(config: TsarConfig, axis: str) -> float:
    """How far errors may lie apart. Luminance is compressed to within 2^-22, and an error changes by at most about
    eight times that over the root of the tolerated power: a template below what luminance rounds by sees the rounding.
    """
    slope, offset = (getattr(config.error, f"{axis}_{name}") for name in ("slope", "offset"))
    parts = 1 if config.error.extent == "tile" else config.samples // 4
    tolerated = template_power(config.samples, parts, offset, slope, config.error) / (config.samples // 4 // parts)
    least = tolerated.min() if config.error.octaves == "greatest" else tolerated.sum()
    return 2e-5 + 8.0 * 2.0**-22 / float(least) ** 0.5


def _color(batch: FrameletBatch, number: int) -> torch.Tensor:
    """A moving, a still or a plain picture, sometimes with NaN samples."""
    moving = pictures.textured_motion
    picture = (moving, pictures.static_stripes, moving, pictures.constant)[number % 4]
    color = pictures.tracer(picture)(batch).color.contiguous()
    if number % 5 == 0:
        color[:: 1 + number % 3, number % 7 :: 97] = (torch.nan, torch.inf, 1e35)[number % 3]
    return color


def _same(name: str, ours: object, theirs: object) -> Iterator[str]:
    equal = torch.equal(ours, theirs) if isinstance(ours, torch.Tensor) else ours == theirs
    if not equal:
        yield f"{name} differs" + ("" if isinstance(ours, torch.Tensor) else f": {ours} and {theirs}")


def _near(name: str, ours: torch.Tensor, theirs: torch.Tensor, relative: float, absolute: float) -> Iterator[str]:
    off = (ours - theirs).abs() - relative * theirs.abs()
    if not bool((off <= absolute).all()):
        yield f"{name} differs by up to {float((ours - theirs).abs().max()):g}"


def _broken(densities: Densities, config: TsarConfig) -> Iterator[str]:
    residual = abs(float(densities.combined().sum()) + densities.surplus - config.budget) / config.budget
    if not residual <= 1e-9:
        yield f"conservation is off by {residual:g}"
    share = densities.surplus / config.budget
    if not -1e-12 <= share <= config.response.surplus_max + 1e-12:
        yield f"surplus is {share:g} of the budget"
    for name in ("spatial", "temporal"):
        (low, high), field = getattr(config, f"{name}_bounds"), getattr(densities, name)
        if not (low * (1 - 1e-12) <= float(field.min()) and float(field.max()) <= high * (1 + 1e-12)):
            yield f"{name} density out of bounds"


def main() -> None:
    faulthandler.enable()
    first, count, cycles = map(int, sys.argv[1:])
    for number in range(first, first + count):
        print(f"{number} begins", flush=True)
        found = sorted(set(differences(legal_configuration(number), number, cycles)))
        print(f"{number} {'; '.join(found) or 'same'}", flush=True)


if __name__ == "__main__":
    main()
