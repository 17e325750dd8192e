"""A policy whose state is stored in another precision between its stages, to measure the effect of fewer bits.

The arithmetic of the stages is unchanged; the values that they pass on are rounded. With float64 the reference stages
run, in float64 as far as their tensors allow, because compiled ones support only float32. Positions on the image stay
float32, and so does the reconstruction of ``thesis``, which only decides which framelets are out of date.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from copy import copy
from dataclasses import replace
from functools import partial
from typing import Any

import torch
from torch import Tensor

from tsar.cache import FrameletCache
from tsar.checks import require
from tsar.clock import StageTimer
from tsar.config import TsarConfig
from tsar.decision import Decision
from tsar.formats import NUMBER_FORMATS, rounded
from tsar.named import require_known
from tsar.policy import Cycle, Moment, Picture, Policy, Price, Setting
from tsar.reconstruction import Reconstruction
from tsar.stages import Stages, reference
from tsar.types import Densities, Errors, FrameletBatch, SampleBatch, StepRecord

FIELDS: dict[str, tuple[str, ...]] = {
    "samples": (),
    "colors": ("estimates.color", "cache.color"),
    "variances": ("estimates.aged", "estimates.inverse", "estimates.roughness", "remaining"),
    "change": ("change.excess", "change.span_s", "change.rate", "drift_s", "rate"),
    "points": ("surfels.point",),
    "places": ("surfels.position", "surfels.step"),
    "times": ("estimates.time_s", "change.seen_s", "cache.time_s"),
    "wavelets": ("cache.coefficients",),
    "errors": (),
    "densities": ("densities.spatial", "densities.temporal"),
    "picture": ("shown",),
}
"""Quantities that can be stored in another format, with their fields in the states of ``tsar``, ``filter`` and
``thesis``. ``samples`` are the answers of the renderer, ``errors`` the input of the response, and ``picture`` is the
displayed image."""
ALL = "all"
Decide = Callable[[Densities, Errors, Tensor, TsarConfig, StageTimer], Decision]
Reconstruct = Callable[[FrameletCache, TsarConfig, float], Reconstruction]


class Stored(Policy[Any]):
    """Another policy with parts of its state stored in other formats."""

    def __init__(self, setting: Setting, make: Callable[[Setting], Policy[Any]], formats: Mapping[str, str]) -> None:
        """Creates the policy; ``formats`` maps some names of :data:`FIELDS`, or ``all``, to a format.

        Raises:
            ConfigError: a name or a format is unknown, or the policy has no such field.
        """
        self._formats: dict[str, str] = {}
        for name, form in formats.items():
            require_known(name, "formats", (ALL, *FIELDS))
            require(form in NUMBER_FORMATS, f"formats.{name}", ", ".join(NUMBER_FORMATS), form)
            self._formats |= dict.fromkeys(FIELDS, form) if name == ALL else {name: form}
        super().__init__(setting)
        self._policy = make(replace(setting, stages_of=partial(self._stages_of, setting.stages_of)))
        state = self._policy.start()
        for name in formats:
            kept = name in ("samples", "picture", ALL) or any(_has(state, field) for field in (*FIELDS[name], name))
            require(kept, f"formats.{name}", "a field that the policy has", type(self._policy).__name__.lower())

    def _stages_of(self, stages_of: Callable[[TsarConfig], Stages], config: TsarConfig) -> Stages:
        stages = stages_of(config)
        if "float64" in self._formats.values():
            stages = reference(config)
            stages = replace(stages, reconstruct=partial(_reconstructed, stages.reconstruct))
        if "errors" not in self._formats:
            return stages
        return replace(stages, decide=partial(_decided, stages.decide, self._formats["errors"]))

    @property
    def latency_cycles(self) -> int:  # pyright: ignore[reportIncompatibleVariableOverride]
        return self._policy.latency_cycles

    @property
    def probe_cycles(self) -> int:  # pyright: ignore[reportIncompatibleVariableOverride]
        return self._policy.probe_cycles

    @property
    def footprint(self) -> float:
        return self._policy.footprint

    @property
    def warmup_cycles(self) -> int:
        return self._policy.warmup_cycles

    @property
    def price(self) -> Price:
        return self._policy.price

    def start(self) -> Any:
        return self._held(self._policy.start())

    def request(self, state: Any, moment: Moment) -> tuple[Any, FrameletBatch]:
        state, batch = self._policy.request(state, moment)
        return self._held(state), batch

    def observe(self, state: Any, batch: FrameletBatch, samples: SampleBatch, moment: Moment, timer: StageTimer) -> Any:
        color = rounded(samples.color, self._formats["samples"]) if "samples" in self._formats else samples.color
        return self._held(self._policy.observe(state, batch, replace(samples, color=color), moment, timer))

    def image(self, state: Any, moment: Moment) -> Picture:
        shown = self._policy.image(state, moment)
        if "picture" not in self._formats:
            return shown
        return replace(shown, image=rounded(shown.image, self._formats["picture"]).to(torch.float32))

    def fitted(self, shown: Picture) -> Picture:
        return self._policy.fitted(shown)

    def record(self, cycle: Cycle[Any], moment: Moment, cost_s: float) -> StepRecord | None:
        return self._policy.record(cycle, moment, cost_s)

    def _held(self, state: Any) -> Any:
        for name, form in self._formats.items():
            for field in FIELDS[name]:
                if _has(state, field):
                    state = _with(state, field.split("."), form)
        return state


def _has(state: Any, field: str) -> bool:
    for name in field.split("."):
        if not hasattr(state, name):
            return False
        state = getattr(state, name)
    return True


def _with(state: Any, path: list[str], form: str) -> Any:
    """A state with one field, a dotted path, rounded to a format; the cache of framelets changes in place."""
    value = getattr(state, path[0])
    value = rounded(value, form) if len(path) == 1 else _with(value, path[1:], form)
    if isinstance(state, FrameletCache):
        setattr(state, path[0], value)
        return state
    return replace(state, **{path[0]: value})


def _reconstructed(
    reconstruct: Reconstruct, cache: FrameletCache, config: TsarConfig, cycle_s: float
) -> Reconstruction:
    single = copy(cache)  # flags that reconstruction sets in the copy are set in both
    single.color = cache.color.to(torch.float32)
    return reconstruct(single, config, cycle_s)


def _decided(
    decide: Decide,
    form: str,
    densities: Densities,
    errors: Errors,
    history: Tensor,
    config: TsarConfig,
    timer: StageTimer,
) -> Decision:
    held = Errors(rounded(errors.spatial, form), rounded(errors.temporal, form))
    return decide(densities, held, history, config, timer)
