"""The policy of the dissertation, ``thesis``: its pipeline as a recipe.

This module contains no mathematics: every stage is a function of its own module.

Source: Stephens 2011, sec. 3.4.4 and fig. 3.13.

Deviation: a picture whose sides are not equal powers of two is stretched over the least such square that holds it, so
that tiles have the picture's aspect ratio.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import torch

from tsar.accounting import movement
from tsar.cache import FrameletCache
from tsar.clock import StageTimer
from tsar.policies.resampling import averaged
from tsar.policy import Cycle, Moment, Picture, Policy, Setting
from tsar.response import initial_densities
from tsar.selection import Request, initial_history, request
from tsar.tiling import build
from tsar.types import Densities, Errors, FrameletBatch, SampleBatch, SampleMap, StepRecord, Tiling


@dataclass(frozen=True)
class State:
    """The state that one cycle passes to the next. Frozen, except that the cache changes in place.

    Attributes:
        densities, tiling: sample densities, and the tiling built from them.
        due: tiles that are rendered next.
        cache: framelets from which the display is reconstructed.
        errors, nonfinite: errors and number of non-finite samples of the last batch; None and 0 before the first.
    """

    densities: Densities
    tiling: Tiling
    due: Request
    cache: FrameletCache
    errors: Errors | None = None
    nonfinite: int = 0


class Thesis(Policy[State]):
    """The faithful pipeline: render, estimate, cache, respond, re-tile, select, reconstruct."""

    latency_cycles = 3
    """The display shows the samples of three cycles ago (sec. 3.4.4)."""

    def __init__(self, setting: Setting) -> None:
        super().__init__(setting)
        self._stages = setting.stages_of(setting.config)

    @property
    def own_threads(self) -> bool:
        return self._stages.own_threads

    def start(self) -> State:
        """A uniform field, its tiling, the first tiles that are due, and an empty cache."""
        densities = initial_densities(self.config)
        tiling = build(densities.spatial, self.config)
        due = request(tiling, densities.temporal, initial_history(self.config), self.config)
        return State(densities, tiling, due, FrameletCache(self.config))

    def request(self, state: State, moment: Moment) -> tuple[State, FrameletBatch]:
        return state, state.due.at(moment.time_s, moment.cycle, self.config)

    def observe(
        self, state: State, batch: FrameletBatch, samples: SampleBatch, moment: Moment, timer: StageTimer
    ) -> State:
        seen = self._stages.observe(batch, samples.color, state.cache, self.config, timer)
        made = self._stages.decide(state.densities, seen.errors, state.due.history, self.config, timer)
        return State(made.densities, made.tiling, made.due, state.cache, seen.errors, seen.nonfinite)

    def image(self, state: State, moment: Moment) -> Picture:
        made = self._stages.reconstruct(state.cache, self.config, moment.cycle_s)
        share = self.config.pixels / self.config.resolution_px**2
        return Picture(made.image, made.sample_map, {name: round(share * one) for name, one in made.counters.items()})

    def fitted(self, shown: Picture) -> Picture:
        """The reconstructed square, averaged over the pixels of a picture of another shape."""
        if self.config.window.whole:
            return shown
        samples, (height, width) = shown.sample_map, self.config.shape
        assert samples is not None
        row, column = (torch.arange(side) * len(samples.level) // side for side in (height, width))
        newest_s, level = (one[row[:, None], column] for one in (samples.newest_s, samples.level))
        return replace(shown, image=averaged(shown.image, height, width), sample_map=SampleMap(newest_s, level))

    def record(self, cycle: Cycle[State], moment: Moment, cost_s: float) -> StepRecord:
        before, after, config = cycle.before, cycle.after, self.config
        assert after.errors is not None and cycle.shown.sample_map is not None
        newest_s = cycle.shown.sample_map.newest_s
        account = self._stages.account(after.densities, after.errors, newest_s, config)
        surplus, moved = after.densities.surplus, movement(before.densities, after.densities, config)
        return StepRecord(
            cycle=moment.cycle,
            sim_time_s=moment.time_s,
            cost_s=cost_s,
            tiling=before.tiling,
            selected=before.due.selected,
            densities=after.densities,
            errors=after.errors,
            surplus=surplus,
            conservation_residual=abs(account.combined + surplus - config.budget) / config.budget,
            stage_s=dict(cycle.timer.seconds),
            counters=cycle.counters,
            nonfinite=after.nonfinite,
            nonfinite_fields=account.nonfinite,
            age_spread_s=account.age_spread_s,
            moved=moved.elements,
            saturated=moved.saturated,
        )
