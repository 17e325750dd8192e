"""A run of a policy on a scene: its images, the work of the renderer, and sums over its cycles."""

from __future__ import annotations

import dataclasses
import hashlib
import time
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import partial
from typing import TYPE_CHECKING, Any, Protocol

from analysis.command import limits
from analysis.metrics.cost_model import CostParameters, Ledger, cycle_seconds, expected_ledger, measured_parameters
from analysis.metrics.quality import Shown
from analysis.storage.invariants import InvariantCheck
from analysis.storage.records import RecordLimits
from analysis.study.cases import is_framed
from tsar.config import StagesName, TsarConfig, closed_choices
from tsar.error import count_nonfinite
from tsar.policies import POLICIES
from tsar.policies.stored import Stored
from tsar.policy import Policy, Price, Setting, run
from tsar.types import FrameletBatch, SampleBatch, Spent, StepRecord, Trace, Viewpoint

if TYPE_CHECKING:
    from tsar.policy import Truth


class Tracer(Protocol):
    """A renderer as runs see it: :class:`renderer.trace.Renderer`, or what stands for one."""

    @property
    def random(self) -> bool: ...
    def trace(self, batch: FrameletBatch, aspect: float = ...) -> SampleBatch: ...
    def viewpoint(self, time_s: float, aspect: float = ...) -> Viewpoint: ...


@dataclass
class Meter:
    """A renderer that counts work by kind, calls, seconds, and non-finite samples. Changes in place.

    Attributes:
        asked: a hash of the sample positions of each batch; None if they are not recorded.
    """

    trace: Trace
    asked: list[str] | None = None
    counters: Counter[str] = field(default_factory=Counter)
    calls: int = 0
    wall_s: float = 0.0
    nonfinite: int = 0

    def __call__(self, batch: FrameletBatch) -> SampleBatch:
        began = time.perf_counter()
        samples = self.trace(batch)
        self.wall_s += time.perf_counter() - began
        self.calls += 1
        self.counters.update(samples.counters)
        self.nonfinite += count_nonfinite(samples.color)
        if self.asked is not None:
            self.asked.append(hashlib.sha256(batch.position.contiguous().numpy().tobytes()).hexdigest()[:8])
        return samples


class Totals:
    """Sums over the cycles of a run within the measured span, and invariants of the recorded cycles. Changes in place.

    The warm-up is left out of the sums, but not of the invariants.

    Attributes:
        recorded: whether the policy records its cycles.
    """

    def __init__(self, config: TsarConfig) -> None:
        limits = RecordLimits(config.batch_size, config.budget, config.spatial_bounds, config.temporal_bounds)
        self._check = InvariantCheck(limits)
        self.cycles = self.warmup_cycles = self.nonfinite = self.nonfinite_fields = 0
        self.moved = self.saturated = 0
        self.recorded = False
        self.simulated_s = self.age_spread_s = 0.0
        self.stage_s: Counter[str] = Counter()
        self.counters: Counter[str] = Counter()

    def count(self, spent: Spent) -> None:
        """Adds the cost of one cycle."""
        if spent.cycle < 0:
            self.warmup_cycles += 1
            return
        self.cycles += 1
        self.simulated_s += spent.cost_s
        self.stage_s.update(spent.stage_s)
        self.counters.update(spent.counters)

    def add(self, record: StepRecord) -> None:
        """Adds the record of one cycle."""
        self._check.add(record)
        self.recorded = True
        if record.cycle < 0:
            return
        self.nonfinite += record.nonfinite
        self.nonfinite_fields += record.nonfinite_fields
        self.age_spread_s += record.age_spread_s
        self.moved += record.moved
        self.saturated += record.saturated

    @property
    def saturation(self) -> float:
        """Of the elements that decisions moved, over all cycles, the share that they drove to a bound; NaN if none
        moved."""
        return self.saturated / self.moved if self.moved else float("nan")

    def of_a_cycle(self, p: CostParameters) -> CostParameters:
        """Parameters of the cost model with the overdraw of the mean cycle."""
        if not self.cycles:
            return p
        return measured_parameters(p, {name: count / self.cycles for name, count in self.counters.items()})

    def seconds_of(self, span_s: float) -> float:
        """Wall seconds of the cycles in ``span_s`` simulated seconds; NaN if there was no cycle."""
        return sum(self.stage_s.values()) / self.simulated_s * span_s if self.simulated_s else float("nan")

    @property
    def invariants(self) -> dict[str, Any]:
        """The result of :meth:`analysis.storage.invariants.InvariantCheck.result`."""
        return self._check.result()


@dataclass(frozen=True)
@closed_choices()
class Machine:
    """The simulated machine.

    Attributes:
        ledger: how cost is counted.
        capacity: its speed, FLOP/s.
        cost: parameters of the cost model.
        samples_per_s: samples a second of a machine that is as fast as each policy needs; None for a machine of speed
            ``capacity``.
    """

    ledger: Ledger
    capacity: float
    cost: CostParameters
    samples_per_s: float | None = None

    def clock(self, price: Price) -> Callable[[Mapping[str, int], float], float]:
        """Function ``(counters, wall_s) -> seconds`` that gives the simulated duration of a cycle of a policy."""
        if self.samples_per_s is None:
            return cycle_seconds(self.ledger, self.capacity, self.cost, price)
        paced_s = price.samples / self.samples_per_s
        return lambda counters, wall_s: paced_s


@dataclass(frozen=True)
class PolicyRun:
    """A policy at work. Its stream is consumed once.

    Attributes:
        price: price of a cycle.
        latency_cycles: cycles between sampling and display.
        meter: the counting renderer that it uses.
        totals: sums over its cycles.
        images: stream of records, if it makes any, and images.
    """

    price: Price
    latency_cycles: int
    meter: Meter
    totals: Totals
    images: Iterator[Shown]

    @property
    def nonfinite_samples(self) -> int:
        """Number of non-finite samples: of the cycles within the span if the policy records cycles, else of all
        cycles."""
        return self.totals.nonfinite if self.totals.recorded else self.meter.nonfinite


def begin(
    name: str,
    config: TsarConfig,
    renderer_of: Callable[[float], Tracer],
    machine: Machine,
    span_s: tuple[float, float],
    truth: Truth | None = None,
    stages: StagesName = "compiled",
    threads: int = 1,
    on_record: Callable[[StepRecord], None] = lambda record: None,
    parts: Mapping[str, bool | int | float] | None = None,
    formats: Mapping[str, str] | None = None,
) -> PolicyRun:
    """A run of a policy, not yet started.

    Args:
        name: name of the policy.
        config: configuration of the run.
        renderer_of: makes a renderer that filters textures for a given number of samples along a pixel's side.
        machine: the simulated machine.
        span_s: beginning and end of the animation time to cover, seconds.
        truth: the truth, for policies that may use it.
        stages: implementation of the stages around tracing.
        threads: threads that share these stages.
        on_record: called with the record of every recorded cycle.
        parts: options of the policy ``tsar`` that differ from its defaults; None for the defaults.
        formats: formats of values that the policy keeps, if they differ from its own; with any, its requests are
            recorded.

    Raises:
        ConfigError: no policy has that name, its cycles do not fit into the span, or it keeps no such values.
    """
    policy, trace = made(name, config, renderer_of, truth, stages, threads, parts, formats)
    meter, totals = Meter(trace, [] if formats else None), Totals(config)
    clock = machine.clock(policy.price)
    require_pace(name, policy.price, machine, span_s, config.warmup_cycles)
    images = _noted(policy, meter, clock, span_s, totals, on_record)
    return PolicyRun(policy.price, policy.latency_cycles, meter, totals, images)


def made(
    name: str,
    config: TsarConfig,
    renderer_of: Callable[[float], Tracer],
    truth: Truth | None = None,
    stages: StagesName = "compiled",
    threads: int = 1,
    parts: Mapping[str, bool | int | float] | None = None,
    formats: Mapping[str, str] | None = None,
) -> tuple[Policy[Any], Trace]:
    """A policy, and the renderer that it is to be given; arguments as of :func:`begin`.

    Raises:
        ConfigError: no policy has that name, or it keeps no such numbers.
    """
    from renderer.stages.control import stages as stages_of

    height, width = config.shape
    aspect = width / height
    setting = Setting(
        config,
        lambda config: stages_of(config, stages, threads),
        truth,
        lambda batch: renderer_of(1).trace(batch, aspect),
        lambda time_s: renderer_of(1).viewpoint(time_s, aspect),
        lambda: renderer_of(1).random,
    )
    make: Callable[[Setting], Policy[Any]] = partial(_changed, parts=parts) if parts else POLICIES[name]
    policy = Stored(setting, make, formats) if formats else make(setting)
    renderer = renderer_of(policy.footprint)
    return policy, lambda batch: renderer.trace(batch, aspect)


def require_pace(name: str, price: Price, machine: Machine, span_s: tuple[float, float], warmup_cycles: int) -> None:
    """Refuses a policy whose cycles are too long, too many or too short for a run, at its own price.

    Framed renderers are never refused: a run shorter than a frame shows the frame made before it.

    Args:
        name, price: name and price of the policy.
        machine: the simulated machine; one that measures time, or keeps up with every policy, refuses none.
        span_s: beginning and end of the run, seconds.
        warmup_cycles: cycles before the run.

    Raises:
        ConfigError: the cycles do not fit.
    """
    if machine.ledger == "wall" or machine.samples_per_s is not None or is_framed(name):
        return
    cycle_s = dataclasses.replace(machine, ledger=expected_ledger(machine.ledger)).clock(price)({}, 0.0)
    limits.require_pace("policy", name, cycle_s, span_s[0], span_s[1] - span_s[0], warmup_cycles)


def _changed(setting: Setting, parts: Mapping[str, Any]) -> Policy[Any]:
    from tsar.filtering.options import DEFAULT
    from tsar.policies.filter import Filter

    return Filter(setting, dataclasses.replace(DEFAULT, **parts))


def _noted(
    policy: Policy[Any],
    trace: Trace,
    clock: Callable[[Mapping[str, int], float], float],
    span_s: tuple[float, float],
    totals: Totals,
    on_record: Callable[[StepRecord], None],
) -> Iterator[Shown]:
    for record, display in run(policy, trace, clock, *span_s):
        if record is not None:
            on_record(record)
            totals.add(record)
        if display.spent is not None:
            totals.count(display.spent)
        yield record, display
