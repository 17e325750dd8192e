"""Shared by tests of the compiled stages: configurations of every kind, and runs that provide states."""

from __future__ import annotations

import copy
from collections.abc import Iterator
from dataclasses import dataclass, replace

from renderer.stages.control import compiled_stages
from tests.oracles import pictures, runs
from tsar.config import ErrorConfig, ReconstructionConfig, ResponseConfig, TilingConfig, TsarConfig
from tsar.policies.thesis import State
from tsar.policy import Cycle, step
from tsar.policy import Moment as When

CYCLE_S = 1 / 60


def small(**more) -> TsarConfig:
    return TsarConfig(**{"batch_size": 32, "resolution_px": 256, "warmup_cycles": 4, **more})


CONFIGS = {
    "default": TsarConfig(),
    "small": small(),
    "large framelets": small(batch_size=64, framelet_side=32),
    "coarse field": small(sdf_side=32, batch_size=16, resolution_px=128),
    "fine field": small(sdf_side=256),
    "greatest power": small(error=ErrorConfig(norm="linf")),
    "difference": small(error=ErrorConfig(form="difference")),
    "difference of greatest power": small(error=ErrorConfig(norm="linf", form="difference", temporal_offset=-7.0)),
    "octave by octave": small(error=ErrorConfig(octaves="greatest")),
    "tile by tile": small(error=ErrorConfig(extent="tile")),
    "tile by tile, octave by octave, greatest power": small(
        error=ErrorConfig(norm="linf", octaves="greatest", extent="tile", form="difference")
    ),
    "slow and biased": small(response=ResponseConfig(gain=0.3, bias=0.7, surplus_max=0.1)),
    "biased to time": small(response=ResponseConfig(bias=-1.0, temporal_min=0.25)),
    "one level": small(tiling=TilingConfig(level_min=3, level_max=3)),
    "coarse levels": small(batch_size=16, tiling=TilingConfig(level_min=1, level_max=3)),
    "finer than pixels": small(resolution_px=64, batch_size=16, tiling=TilingConfig(level_min=1, level_max=5)),
    "four samples along a pixel": small(tiling=TilingConfig(rate_max=4)),
    "few tiles": small(tiling=TilingConfig(tile_count_max=64, threshold_samples=64.0)),
    "no smoothing": small(reconstruction=ReconstructionConfig(1)),
    "wide smoothing": small(reconstruction=ReconstructionConfig(65)),
}
"""Configurations by their special property."""


@dataclass(frozen=True)
class Moment:
    """A cycle by the reference: the state before it with a copy of its cache, its results, and the state after it."""

    number: int
    before: State
    outcome: Cycle[State]
    after: State


def moments(config: TsarConfig, first: int, cycles: int, picture=pictures.textured_motion) -> Iterator[Moment]:
    """Cycles from number ``first`` on; those before, in which cache and densities take shape, are compiled ones."""
    trace, plain = pictures.tracer(picture), runs.made("thesis", config)
    fast, state = runs.made("thesis", config, compiled_stages(config)), plain.start()
    for number in range(first):
        state = step(fast, state, trace, When(number * CYCLE_S, number, CYCLE_S)).after
    for number in range(first, first + cycles):
        before = replace(state, cache=copy.deepcopy(state.cache))
        outcome = step(plain, state, trace, When(number * CYCLE_S, number, CYCLE_S))
        state = outcome.after
        yield Moment(number, before, outcome, state)
