"""What decides where and when samples are spent: the interface of all renderers that are compared, and their one loop.

A policy is asked for a batch, told what the renderer answered, and asked for the image to show. State goes in and comes
out; what it costs and how late it shows what it sampled are declared beside it.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import ClassVar, Generic, TypeVar

from jaxtyping import Float
from torch import Tensor

from tsar.clock import CycleSeconds, StageTimer, checked, end_of_cycle
from tsar.config import TsarConfig, require
from tsar.stages import Stages, reference
from tsar.types import FrameletBatch, MapShown, SampleBatch, SampleMap, ShownImage, Spent, StepRecord, Trace, Viewpoint
from tsar.window import Window

State = TypeVar("State")

Truth = Callable[[float], Float[Tensor, "h w 3"]]
"""``time_s -> image``: the picture as it should be, linear RGB at output resolution."""


@dataclass(frozen=True)
class Price:
    """What the cost model charges a cycle of a policy.

    Attributes:
        samples: samples traced a cycle.
        adaptive_stages: whether selection, error estimate, response, tiling and reconstruction come on top, as table
            7.1 of Stephens 2011 prices them.
        pixel_flops, sample_flops: further operations per output pixel and per sample.
    """

    samples: int
    adaptive_stages: bool = False
    pixel_flops: float = 0.0
    sample_flops: float = 0.0


@dataclass(frozen=True)
class Setting:
    """What a policy is made from.

    Attributes:
        config: of the run.
        stages_of: what runs the stages around tracing of the adaptive pipeline, made when they are needed.
        truth: the picture at any time; None where nothing may look at it.
        trace: a renderer that is not charged, for policies that look at the truth.
        view: where the camera and all instances are at a time, seconds; None where the scene cannot tell.
    """

    config: TsarConfig
    stages_of: Callable[[TsarConfig], Stages] = reference
    truth: Truth | None = None
    trace: Trace | None = None
    view: Callable[[float], Viewpoint] | None = None


@dataclass(frozen=True)
class Moment:
    """When a cycle takes place.

    Attributes:
        time_s: animation time at its start, seconds.
        cycle: its number, negative during warm-up.
        cycle_s: length of the cycle before it, seconds: the unit of age.
    """

    time_s: float
    cycle: int
    cycle_s: float


def require_square(config: TsarConfig, policy: str) -> None:
    """Refuses a picture that is no square of a power of two, for policies that know no other.

    Raises:
        ConfigError: it is not.
    """
    height, width = config.shape
    expected = f"a square of resolution_px for the policy {policy}"
    require(config.window.whole, "width_px, height_px", expected, (width, height))


class WhenAsked(Mapping[str, MapShown]):
    """Maps that are made when somebody draws them: most cycles are never looked at."""

    def __init__(self, made_by: Mapping[str, Callable[[], MapShown]]) -> None:
        """Takes a function for each name."""
        self._made_by = made_by

    def __getitem__(self, name: str) -> MapShown:
        return self._made_by[name]()

    def __iter__(self) -> Iterator[str]:
        return iter(self._made_by)

    def __len__(self) -> int:
        return len(self._made_by)


@dataclass(frozen=True)
class Picture:
    """What a policy puts on the display.

    Attributes:
        image: ``(height, width, 3)`` float32 linear RGB, of the picture, or of the whole plane of which it is a window.
        sample_map: age and density of its samples, likewise; None where the policy cannot tell.
        counters: work done for it, by name; ``framelet_pixels`` are the pixels of all framelets that were accumulated.
        maps: what else the policy knows of every place, by name, for a page.
        carried: see :class:`tsar.types.ShownImage`.
    """

    image: Float[Tensor, "h w 3"]
    sample_map: SampleMap | None = None
    counters: Mapping[str, int] = field(default_factory=dict)
    maps: Mapping[str, MapShown] = field(default_factory=dict)
    carried: Callable[[Float[Tensor, "h w 3"]], Float[Tensor, "h w 3"]] | None = None


@dataclass(frozen=True)
class Cycle(Generic[State]):
    """One cycle as it went, for its record.

    Attributes:
        before, after: state at its start and at its end.
        samples: what the renderer answered.
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
        """Work done, by name: by the renderer, and for the image."""
        return {**self.samples.counters, **self.shown.counters}


class Policy(ABC, Generic[State]):
    """Who decides what is sampled.

    Attributes:
        latency_cycles: cycles between sampling and display.
        probe_cycles: throw-away cycles before a run, the last of which tells how long a cycle takes; the first may
            compile kernels.
        footprint: samples along a pixel's side that textures are filtered for; below 1 where samples are farther apart
            than pixels.
        price: what a cycle costs.
    """

    latency_cycles: ClassVar[int] = 1
    probe_cycles: ClassVar[int] = 2

    def __init__(self, setting: Setting) -> None:
        """Takes what the run is made from."""
        self.config = setting.config

    @property
    def footprint(self) -> float:
        return 1.0

    @property
    def warmup_cycles(self) -> int:
        """Cycles before the start time, so that measurement begins in the steady state."""
        return self.config.warmup_cycles

    @property
    def price(self) -> Price:
        """By default that of a cycle of the adaptive pipeline."""
        return Price(self.config.batch_size * self.config.samples, adaptive_stages=True)

    @abstractmethod
    def start(self) -> State:
        """The state before the first cycle."""

    @abstractmethod
    def request(self, state: State, moment: Moment) -> tuple[State, FrameletBatch]:
        """What is to be rendered in a cycle."""

    @abstractmethod
    def observe(
        self, state: State, batch: FrameletBatch, samples: SampleBatch, moment: Moment, timer: StageTimer
    ) -> State:
        """Takes in what the renderer answered; ``timer`` takes the seconds of the stages by name."""

    @abstractmethod
    def image(self, state: State, moment: Moment) -> Picture:
        """The image at the end of a cycle."""

    def fitted(self, shown: Picture) -> Picture:
        """What goes onto the display, of the shape of the output: the window of a picture of the whole plane."""
        return cropped(shown, self.config.window)

    def probe(self, trace: Trace, time_s: float) -> tuple[Mapping[str, int], float]:
        """What a cycle takes, from throw-away ones before a run: work counted, and wall seconds."""
        state = self.start()
        for cycle in range(self.probe_cycles):
            done = step(self, state, trace, Moment(time_s, cycle, 1.0))
            state = done.after
        return done.counters, done.timer.total

    def record(self, cycle: Cycle[State], moment: Moment, cost_s: float) -> StepRecord | None:
        """What is kept of a cycle; None where there is nothing to keep."""
        return None


def run(
    policy: Policy[State], trace: Trace, cycle_seconds: CycleSeconds, start_s: float, end_s: float
) -> Iterator[tuple[StepRecord | None, ShownImage]]:
    """Cycles from a warm start until the animation time passes ``end_s``.

    Warm-up cycles before ``start_s`` have negative numbers and are yielded too: the first images on the display come
    from them.

    Args:
        policy: who decides.
        trace: the renderer.
        cycle_seconds: the clock.
        start_s, end_s: span of animation time to cover, seconds.

    Raises:
        ValueError: the clock returned a value that is not finite and positive, or so small that time stands still.
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
    """The picture of one that may be of the whole plane."""
    if window.whole:
        return shown
    samples, carried = shown.sample_map, shown.carried
    if samples is not None:
        samples = SampleMap(window.parts(samples.newest_s), window.parts(samples.level))

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
    with timer("selection"):
        asked, batch = policy.request(state, moment)
    with timer("tracing"):
        samples = trace(batch)
    after = policy.observe(asked, batch, samples, moment, timer)
    with timer("reconstruction"):
        shown = policy.image(after, moment)
    return Cycle(state, after, samples, shown, timer)
