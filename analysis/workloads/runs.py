"""The runs of the map of workloads."""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Iterator
from dataclasses import dataclass

from analysis.metrics.cost_model import SEGMENTS_DEFAULT, CostParameters, per_segment
from analysis.study.cases import ROWS, SCALES, Case, framed_config, is_framed
from analysis.study.fitting import fitting
from analysis.study.inputs import phase_of
from analysis.workloads.options import WorkloadOptions
from tsar.config import ConfigError

UNPRICED = ("framed", "framed-1", "framed-super")
"""Policies that are charged for samples alone: on a machine that keeps the framed renderer's rate, the price of a
sample does not affect them."""
_BATCH, _SIDE = ROWS[7]


@dataclass(frozen=True)
class Workload:
    """A place on the map.

    Attributes:
        sample_flops: price of a sample, FLOPs.
        image_hz: images a second of the framed renderer.
        side_px: side of the output at the thesis' own size, pixels.
    """

    sample_flops: float
    image_hz: float
    side_px: int


@dataclass(frozen=True)
class Run:
    """A case and its place on the map. ``case`` is None if no cycle of the policy fits into the run."""

    policy: str
    workload: Workload
    repetition: int
    input: str
    case: Case | None


def runs(options: WorkloadOptions) -> list[Run]:
    """Every run, of which several may share a case."""
    policies = dict.fromkeys(("framed", *options.policies))
    places = itertools.product(options.sides_px, options.image_hz, options.sample_flops)
    workloads = [Workload(flops, rate, side) for side, rate, flops in places]
    return [
        run
        for repetition in range(options.repetitions)
        for workload in workloads
        for name in options.inputs
        for run in _runs_at(options, tuple(policies), workload, name, repetition)
    ]


def _runs_at(
    options: WorkloadOptions, policies: tuple[str, ...], workload: Workload, name: str, repetition: int
) -> Iterator[Run]:
    scale = SCALES[options.scale].errors_alone
    scale = dataclasses.replace(scale, widest_px=max(scale.widest_px, workload.side_px))
    batch = _BATCH * workload.side_px**2 // _SIDE**2
    cache = max(options.tsar.cache_size, 4 * batch)
    base = dataclasses.replace(options.tsar, seed=repetition, cache_size=cache)
    config = scale.sized(batch, workload.side_px, base)
    segments = workload.sample_flops / float(per_segment(CostParameters()))
    for policy in policies:
        try:
            case = fitting(Case(
                input=name,
                policy=policy,
                tsar=framed_config(config.resolution_px) if is_framed(policy) else config,
                scale=scale,
                phase=phase_of(name, repetition, options.repetitions),
                framed_rate_hz=workload.image_hz,
                trace_segments=SEGMENTS_DEFAULT if policy in UNPRICED else segments,
            ))  # fmt: skip
        except ConfigError:
            case = None
        yield Run(policy, workload, repetition, name, case)
