"""Policies, which decide where and when samples are taken: the interface of all compared renderers, and their common
loop.

A policy requests a batch, receives the samples of the renderer, and returns the image to show. Its methods take and
return the state; its price and its latency are declared beside them.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Mapping
from contextlib import nullcontext
from dataclasses import dataclass, field, replace
from typing import ClassVar, Generic, TypeVar

from jaxtyping import Float
from torch import Tensor

from tsar.clock import CycleSeconds, StageTimer, checked, end_of_cycle
from tsar.config import TsarConfig, require
from tsar.stages import Stages, reference
from tsar.threads import one_thread
from tsar.types import FrameletBatch, MapShown, SampleBatch, SampleMap, ShownImage, Spent, StepRecord, Trace, Viewpoint
from tsar.window import Window

State = TypeVar("State")

Truth = Callable[[float], Float[Tensor, "h w 3"]]
"""``time_s -> image``: the picture as it should be, linear RGB at output resolution."""


@dataclass(frozen=True)
class Price:
    """The price of a policy's cycle for the cost model.

    Attributes:
        samples: samples traced per cycle.
        adaptive_stages: whether selection, error estimate, response, tiling and reconstruction are charged too, as
            priced in table 7.1 of Stephens 2011.
        pixel_flops, sample_flops: further operations per output pixel and per sample.
    """

    samples: int
    adaptive_stages: bool = False
    pixel_flops: float = 0.0
    sample_flops: float = 0.0


@dataclass(frozen=True)
class Setting:
    """The inputs from which a policy is created.

    Attributes:
        config: configuration of the run.
        stages_of: creates the stages of the adaptive pipeline around tracing, when they are needed.
        truth: true picture at any time; None where no policy may use it.
        trace: renderer that is not charged, for policies that use the truth.
        view: poses of the camera and all instances at a time in seconds; None where the scene does not give them.
        random: whether the renderer draws random numbers for its samples, so that those of one place differ.
    """

    config: TsarConfig
    stages_of: Callable[[TsarConfig], Stages] = reference
    truth: Truth | None = None
    trace: Trace | None = None
    view: Callable[[float], Viewpoint] | None = None
    random: Callable[[], bool] = lambda: False


@dataclass(frozen=True)
class Moment:
    """The time of a cycle.

    Attributes:
        time_s: animation time at its start, seconds.
        cycle: its number, negative during warm-up.
        cycle_s: length of the cycle before it, seconds: the unit of age.
    """

    time_s: float
    cycle: int
    cycle_s: float


def require_square(config: TsarConfig, policy: str) -> None:
    """Rejects a picture other than a square whose side is a power of two, for policies that support no other.

    Raises:
        ConfigError: the picture has another shape.
    """
    height, width = config.shape
    expected = f"a square of resolution_px for the policy {policy}"
    require(config.window.whole, "width_px, height_px", expected, (width, height))


class WhenAsked(Mapping[str, MapShown]):
    """Maps that are computed on access, because those of most cycles are never drawn."""

    def __init__(self, made_by: Mapping[str, Callable[[], MapShown]]) -> None:
        """``made_by`` has a function for the map of each name."""
        self._made_by = made_by

    def __getitem__(self, name: str) -> MapShown:
        return self._made_by[name]()

    def __iter__(self) -> Iterator[str]:
        return iter(self._made_by)

    def __len__(self) -> int:
        return len(self._made_by)


@dataclass(frozen=True)
class Picture:
    """The picture that a policy shows.

    Attributes:
        image: ``(height, width, 3)`` float32 linear RGB, for the picture, or for the whole plane of which it is a
            window.
        sample_map: age and density of its samples, likewise; None where the policy cannot tell.
        counters: work done for it, by name; ``framelet_pixels`` are the pixels of all framelets that were accumulated.
        maps: further maps of the policy's state, by name, for reports.
        carried: see :class:`tsar.types.ShownImage`.
    """

    image: Float[Tensor, "h w 3"]
    sample_map: SampleMap | None = None
    counters: Mapping[str, int] = field(default_factory=dict)
    maps: Mapping[str, MapShown] = field(default_factory=dict)
    carried: Callable[[Float[Tensor, "h w 3"]], Float[Tensor, "h w 3"]] | None = None


@dataclass(frozen=True)
class Cycle(Generic[State]):
    """One cycle and its results, for its record.

    Attributes:
        before, after: state at its start and at its end.
        samples: samples of the renderer.
        shown: image at its end.
        timer: measured seconds of its stages.
    """

    before: State
    after: State
    samples: SampleBatch
    shown: Picture
    timer: StageTimer

    @property
    def counters(self) -> dict[str, int]:
        """Counts of the work done by the renderer and for the image, by name."""
        return {**self.samples.counters, **self.shown.counters}


class Policy(ABC, Generic[State]):
    """A policy, which decides what is sampled.

    Attributes:
        latency_cycles: number of cycles between sampling and display.
        probe_cycles: number of throw-away cycles before a run, the last of which measures the duration of a cycle; the
            first may compile kernels.
        footprint: number of samples along a pixel's side for which textures are filtered; below 1 where samples are
            farther apart than pixels.
        price: price of a cycle.
    """

    latency_cycles: ClassVar[int] = 1
    probe_cycles: ClassVar[int] = 2

    def __init__(self, setting: Setting) -> None:
        """Takes the setting of the run."""
        self.config = setting.config

    @property
    def footprint(self) -> float:
        return 1.0

    @property
    def warmup_cycles(self) -> int:
        """Number of cycles before the start time, so that measurement begins in the steady state."""
        return self.config.warmup_cycles

    @property
    def own_threads(self) -> bool:
        """Whether its stages have threads of their own (:class:`tsar.stages.Stages`)."""
        return False

    @property
    def price(self) -> Price:
        """Price of a cycle; by default that of the adaptive pipeline."""
        return Price(self.config.batch_size * self.config.samples, adaptive_stages=True)

    @abstractmethod
    def start(self) -> State:
        """The state before the first cycle."""

    @abstractmethod
    def request(self, state: State, moment: Moment) -> tuple[State, FrameletBatch]:
        """The batch to render in a cycle."""

    @abstractmethod
    def observe(
        self, state: State, batch: FrameletBatch, samples: SampleBatch, moment: Moment, timer: StageTimer
    ) -> State:
        """Updates the state by the renderer's samples; ``timer`` receives the durations of the stages by name."""

    @abstractmethod
    def image(self, state: State, moment: Moment) -> Picture:
        """The image at the end of a cycle."""

    def fitted(self, shown: Picture) -> Picture:
        """The picture in the shape of the output: the window of a picture of the whole plane."""
        return cropped(shown, self.config.window)

    def probe(self, trace: Trace, time_s: float) -> tuple[Mapping[str, int], float]:
        """Cost of a cycle, from throw-away ones before a run: counts of work, and wall seconds."""
        state = self.start()
        for cycle in range(self.probe_cycles):
            done = step(self, state, trace, Moment(time_s, cycle, 1.0))
            state = done.after
        return done.counters, done.timer.total

    def record(self, cycle: Cycle[State], moment: Moment, cost_s: float) -> StepRecord | None:
        """The record of a cycle; None where there is none."""
        return None


def run(
    policy: Policy[State], trace: Trace, cycle_seconds: CycleSeconds, start_s: float, end_s: float
) -> Iterator[tuple[StepRecord | None, ShownImage]]:
    """Cycles from a warm start until the animation time passes ``end_s``.

    Warm-up cycles before ``start_s`` have negative numbers and are yielded too: the first images on the display come
    from them.

    Args:
        policy: policy to run.
        trace: the renderer.
        cycle_seconds: the clock.
        start_s, end_s: span of animation time to cover, seconds.

    Raises:
        ValueError: the clock returned a value that is not finite and positive, or too small to advance the time.
    """
    cycle_s = checked(cycle_seconds, *policy.probe(trace, start_s))
    state, cycle = policy.start(), -policy.warmup_cycles
    time_s = start_s + cycle * cycle_s
    while time_s < end_s:
        moment = Moment(time_s, cycle, cycle_s)
        done = step(policy, state, trace, moment)
        cycle_s = checked(cycle_seconds, done.counters, done.timer.total)
        record = policy.record(done, moment, cycle_s)
        shown = done.shown
        spent = Spent(cycle, cycle_s, dict(done.timer.seconds), done.counters)
        display_s = time_s + policy.latency_cycles * cycle_s
        fit = policy.fitted(shown)
        yield record, ShownImage(display_s, time_s, fit.image, fit.sample_map, fit.maps, spent, fit.carried)
        state, cycle, time_s = done.after, cycle + 1, end_of_cycle(time_s, cycle_s)


def cropped(shown: Picture, window: Window) -> Picture:
    """The window of a picture that may cover the whole plane."""
    if window.whole:
        return shown
    samples, carried = shown.sample_map, shown.carried
    if samples is not None:
        inverse = None if samples.inverse is None else window.parts(samples.inverse)
        samples = SampleMap(window.parts(samples.newest_s), window.parts(samples.level), inverse)

    def of_part(one: MapShown) -> MapShown:
        return replace(one, values=window.parts(one.values))

    def carried_part(image: Float[Tensor, "h w 3"]) -> Float[Tensor, "h w 3"]:
        assert carried is not None
        return window.cropped(carried(window.enlarged(image)))

    maps = WhenAsked({name: lambda name=name: of_part(shown.maps[name]) for name in shown.maps})
    image = window.cropped(shown.image)
    return replace(shown, image=image, sample_map=samples, maps=maps, carried=carried_part if carried else None)


def step(policy: Policy[State], state: State, trace: Trace, moment: Moment) -> Cycle[State]:
    """One cycle of a policy."""
    timer = StageTimer()
    with one_thread() if policy.own_threads else nullcontext():
        with timer("selection"):
            asked, batch = policy.request(state, moment)
        with timer("tracing"):
            samples = trace(batch)
        after = policy.observe(asked, batch, samples, moment, timer)
        with timer("reconstruction"):
            shown = policy.image(after, moment)
    return Cycle(state, after, samples, shown, timer)
