"""Options of one comparison of policies."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Literal

import tyro

from analysis.command import limits
from analysis.command.options import REFERENCES, Device, References, Threads, Unprefixed
from analysis.metrics import METRICS
from analysis.metrics.cost_model import (
    CAPACITY_DEFAULT,
    SEGMENTS_DEFAULT,
    CostParameters,
    Ledger,
    adaptive_flops,
    expected_ledger,
    nonadaptive_flops,
    parameters_of,
)
from analysis.metrics.display_model import DisplayModel
from analysis.study.cases import ADAPTIVE_STAGES
from analysis.study.view_options import ViewOptions
from tsar.config import RESOLUTION_DEFAULT, StagesName, TsarConfig, closed_choices, require
from tsar.policies import POLICIES

DEFAULT_POLICY = "tsar"
"""The most accurate policy (docs/results/rivals.md)."""
DEFAULT_RIVALS = ("framed", "thesis", "framed-super", "framed-quarter", "framed-taa-late")
"""The plain framed renderer, the policy of the dissertation, and fast framed renderers that are the best of their kind
on some input."""

OF_PICTURE = ("framed", "frameless")
"""Prefixes of the names of policies that store only the pixels of the picture."""


CHOICES = ("preset", "budget_flops", "budget_seconds", "mse_target")
"""Options that choose a point on the measured front."""


@dataclass(frozen=True)
@closed_choices()
class RunOptions(ViewOptions):
    """One comparison of a policy with its rivals at equal cost."""

    input: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="INPUT")]
    """Built-in input (corner-exit, chase, fly-by, approach or fast-crossing; or its number), a scene that was added, a
    scene file or a model; tsar list scenes names all."""
    tsar: Unprefixed[TsarConfig] = field(default_factory=TsarConfig)
    """Size, batch and seed of all policies, and the pipeline of the policy thesis."""
    seconds: float = 2.0
    """Animation time to measure, seconds."""
    start_s: float = 0.0
    """Animation time at which the measurement starts, seconds."""
    phase: float = 0.0
    """Phase of the animation; a number in [0, 1], for repetitions."""
    camera_path: Literal["", "turntable", "fly-through"] = ""
    """Motion of the camera of a scene file that has none."""
    ledger: Ledger = "thesis"
    """How cost is counted; wall takes measured time in place of simulated time."""
    capacity: float | None = None
    """Speed of the simulated machine, FLOP/s; by default 8.7e10 at 512², in proportion to the pixels at other sizes: 8
    framed images a second."""
    trace_segments: float = SEGMENTS_DEFAULT
    """Ray segments per sample; the thesis' inputs have about 4, its table says 5."""
    policy: str = DEFAULT_POLICY
    """Policy that decides what is sampled, by name."""
    rivals: tuple[str, ...] = DEFAULT_RIVALS
    """Rivals at equal cost; ratios are to the first. The default leaves out the policy itself."""
    metrics: tuple[str, ...] | None = None
    """Further metrics beside the squared errors, such as flip, ssim or jod; by default flip, and jod where the
    reference's rate is a whole fraction of the display's; without names, no further one is taken."""
    jod_s: float = 0.25
    """Length of the part in the middle of a run that metrics of sequences score, seconds; such as jod, for which an
    image of 512² takes half a second of one core."""
    display: DisplayModel = field(default_factory=DisplayModel)
    """The display that perceptual metrics of sequences assume."""
    metric_stride: int = 12
    """Interval, in reference images, at which metrics of images are taken."""
    reference_rate_hz: float = 60.0
    """Reference images per simulated second."""
    reference_samples_per_axis: int = 3
    """Samples along a pixel's side in the reference."""
    preset: Literal["", "draft", "balanced", "accurate"] = ""
    """A point on the measured front of cost and error, which sets batch, speed of the machine and options of the policy
    tsar. draft is its cheapest end, balanced its knee, accurate the other end."""
    budget_flops: float | None = None
    """Most operations of the whole run by the ledger: chooses the most accurate setting of the front within them."""
    budget_seconds: float | None = None
    """Most wall seconds of all cycles of the policy: chooses the most accurate setting of the front within them."""
    mse_target: float | None = None
    """Mean squared error to reach; chooses the cheapest setting of the front that reaches it."""
    parts: Annotated[tuple[tuple[str, bool | int | float], ...], tyro.conf.Suppress] = ()
    """Options of the policy tsar that differ from its defaults; a preset or a budget sets them."""
    device: Device = "cpu"
    threads: Threads = 0
    stages: StagesName = "compiled"
    """Implementation of the stages around tracing: compiled kernels, or the tensor operations of the reference."""
    write_frames: bool = False
    """Also write the image on the policy's display at every reference time to frames/, as EXR."""
    layered_stills: int = 0
    """Number of moments, evenly spaced, at which the reference and every picture shown are written to layers/, as
    EXR with colour, depth, normal, albedo, instance, motion, age and sample count."""
    film: bool = True
    """Write comparison.mp4."""
    page: Literal["near", "lossless"] = "near"
    """Pictures in report.html: near has codes off by about 1 of 255, lossless is exact and three times as large."""
    out: Path = Path("out/run")
    """Folder for the results."""
    references: References = REFERENCES

    def __post_init__(self) -> None:
        super().__post_init__()
        limits.within(
            self,
            seconds=limits.SPANS_S,
            start_s=limits.TIMES_S,
            phase=(0.0, 1.0),
            capacity=(1e-12, 1e24),
            trace_segments=limits.SEGMENTS,
            reference_rate_hz=limits.RATES_HZ,
            reference_samples_per_axis=(1, 16),
            metric_stride=(1, 10**6),
            jod_s=(1e-3, 1e9),
            threads=limits.THREADS,
            layered_stills=(0, 1000),
        )
        if self.rivals == DEFAULT_RIVALS:
            object.__setattr__(self, "rivals", tuple(name for name in DEFAULT_RIVALS if name != self.policy))
        runs = self.policy, *self.rivals
        for name in runs:
            POLICIES.require(name, "policy" if name == self.policy else "rivals")
        require(len(runs) == len(set(runs)), "rivals", "names that differ, and from the policy's", runs)
        for name in self.metrics or ():
            METRICS.require(name, "metrics")
        if "jod" in (self.metrics or ()):
            self.display.repeats(self.reference_rate_hz)
        self._check_choice()
        warmup = self.tsar.warmup_cycles
        require(warmup >= 4, "warmup_cycles", "at least 4 (the latency and one)", warmup)
        images = self.seconds * self.reference_rate_hz
        require(images >= 1e-6, "seconds", f"time for a reference image at {self.reference_rate_hz:g} Hz", self.seconds)
        limits.require_count("seconds", self.seconds, images, "reference images")
        if self.ledger != "wall":
            priced = expected_ledger(self.ledger)
            if not set(ADAPTIVE_STAGES).isdisjoint(runs):
                cycle_s = float(adaptive_flops(self.cost, priced)) / self.machine_flops
                limits.require_pace(*self._pace_option, cycle_s, self.start_s, self.seconds, warmup)
                last_s = (math.ceil(round(images, 6)) - 1) / self.reference_rate_hz
                fits = self.policy not in ADAPTIVE_STAGES or cycle_s <= last_s
                require(fits, "seconds", "time for a cycle before the last reference image", self.seconds)
            frame_s = float(nonadaptive_flops(self.cost, priced)) / self.machine_flops
            limits.require_count("capacity", self.machine_flops, self.seconds / frame_s, "framed images")
            least = f"a hundredth of a framed image in {self.seconds:g} s; one takes {frame_s:.3g} s"
            name, value = self._pace_option
            require(frame_s <= 100.0 * self.seconds, name, least, value)

    @property
    def _pace_option(self) -> tuple[str, object]:
        """Name and value of the option that makes cycles too long for the run: no other does at its default."""
        if self.capacity is not None:
            return "capacity", self.capacity
        return "seconds", self.seconds

    def _check_choice(self) -> None:
        """Checks that at most one option chooses a point, and that no other option sets the same values."""
        asked = [name for name in CHOICES if getattr(self, name) not in ("", None)]
        for name in asked[:1]:
            require(len(asked) == 1, name, f"only one of {', '.join(CHOICES)}", getattr(self, name))
            require(self.policy == DEFAULT_POLICY, "policy", f"{DEFAULT_POLICY} beside a {name}", self.policy)
            require(self.capacity is None, "capacity", f"none beside a {name}, which sets it", self.capacity)
            batch, default = self.tsar.batch_size, TsarConfig.batch_size
            require(batch == default, "batch_size", f"none beside a {name}, which sets it", batch)
            require(self.ledger != "wall", "ledger", f"a modelled one beside a {name}", self.ledger)
        limits.within(self, budget_flops=(1.0, 1e18), budget_seconds=(1e-6, 1e9), mse_target=(1e-12, 1.0))
        require(not (self.camera_path and self.camera_keys), "camera_path", "none beside camera_keys", self.camera_path)
        require(not self.parts or self.policy == DEFAULT_POLICY, "parts", f"none but of {DEFAULT_POLICY}", self.parts)

    @property
    def further_metrics(self) -> tuple[str, ...]:
        """Names of the metrics that are taken beside the squared errors."""
        if self.metrics is not None:
            return self.metrics
        return ("flip", "jod") if self.display.shows(self.reference_rate_hz) else ("flip",)

    @property
    def images_scored(self) -> int:
        """Number of reference images, in the middle of the run, that metrics of sequences score."""
        images = math.ceil(round(self.seconds * self.reference_rate_hz, 6))
        return min(images, max(1, round(self.jod_s * self.reference_rate_hz)))

    @property
    def machine_flops(self) -> float:
        """Speed of the simulated machine, FLOP/s."""
        default = CAPACITY_DEFAULT * self.tsar.pixels / RESOLUTION_DEFAULT**2
        return default if self.capacity is None else self.capacity

    @property
    def size(self) -> str:
        """The picture's size in the options that the user set."""
        c = self.tsar
        return (
            f"width_px x height_px: {c.width_px} x {c.height_px}" if c.width_px else f"resolution_px: {c.resolution_px}"
        )

    @property
    def pace(self) -> str:
        """What a size other than the default changes in the experiment, in words; empty if it changes nothing."""
        if self.capacity is not None or self.tsar.pixels == RESOLUTION_DEFAULT**2 or self.ledger == "wall":
            return ""
        if any(getattr(self, name) not in ("", None) for name in CHOICES):
            return ""
        rate = self.machine_flops / float(nonadaptive_flops(self.cost, expected_ledger(self.ledger)))
        return (
            f"{self.size}: the machine has {self.machine_flops:.3g} FLOP/s, for {rate:.3g} framed images a second, "
            f"as at {RESOLUTION_DEFAULT}² (--capacity sets it)"
        )

    @property
    def pixels_held(self) -> int:
        """Pixels that all runs store: those of the picture or, for most policies, of the square around it."""
        squares = sum(name.partition("-")[0] not in OF_PICTURE for name in (self.policy, *self.rivals))
        return squares * self.tsar.resolution_px**2 + (1 + len(self.rivals) - squares) * self.tsar.pixels

    @property
    def cost(self) -> CostParameters:
        """Parameters of the cost model for this run."""
        return parameters_of(self.tsar, self.trace_segments)


@dataclass(frozen=True)
class ReportOptions:
    """The finished runs that a page compares."""

    folders: Annotated[tuple[Path, ...], tyro.conf.Positional, tyro.conf.arg(metavar="FOLDER ...")]
    """Folders of finished runs."""
    out: Path = Path("out/report")
    """Folder for the results; it gets the page."""

    def __post_init__(self) -> None:
        require(len(self.folders) >= 1, "folders", "at least one", self.folders)
