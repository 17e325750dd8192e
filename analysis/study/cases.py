"""Cases of a study: one policy on one input at one setting, as data that can be named and sent to other processes."""

from __future__ import annotations

import dataclasses
import hashlib
import json
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path

from analysis.command import limits
from analysis.metrics.cost_model import (
    SEGMENTS_DEFAULT,
    CostParameters,
    Ledger,
    adaptive_flops,
    expected_ledger,
    nonadaptive_flops,
    parameters_of,
)
from analysis.metrics.display_model import DisplayModel
from analysis.storage.files import plain
from analysis.storage.source import Brought, brought
from analysis.study.inputs import is_added, is_file, require_input, tables_of
from tsar.choices import chosen
from tsar.config import TilingConfig, TsarConfig, closed_choices, require, tiles_at_least
from tsar.policies import POLICIES

ROWS = (
    (32, 256), (32, 512), (32, 1024), (64, 256), (64, 512), (64, 1024), (128, 256), (128, 512), (128, 1024),
    (256, 512), (256, 1024), (512, 512), (512, 1024), (768, 512), (768, 1024), (1024, 1024),
)  # fmt: skip
"""Batch size and output side of the rows of table 7.2, in its order. Source: Stephens 2011, table 7.2."""


@dataclass(frozen=True)
class Scale:
    """The size of a study.

    ``divisor`` scales down everything that is counted in pixels or samples: it divides the side of the image and of the
    fields, and its square divides batch, cache, tiles and the machine's speed. A row is then the same row seen through
    a smaller window: samples per pixel, cycles per framed image and the tiling do not change.

    Attributes:
        divisor: a power of two; 1 is the thesis' own size.
        seconds: measured simulated time, seconds.
        reference_rate_hz: reference images per second.
        reference_samples_per_axis: samples along a pixel's side of the finest output resolution.
        stride: interval, in reference images, at which FLIP, SSIM and the causes are taken.
        widest_px: side of the study's finest pictures at the thesis' own size, pixels; by default that of table 7.2.
    """

    divisor: int
    seconds: float
    reference_rate_hz: float
    reference_samples_per_axis: int
    stride: int
    widest_px: int = max(side for _, side in ROWS)

    @property
    def reference_px(self) -> int:
        """Side of the reference, which is that of the finest pictures. Coarser ones use its average (Stephens 2011,
        sec. 7.2.3)."""
        return self.widest_px // self.divisor

    @property
    def errors_alone(self) -> Scale:
        """The same scale, with FLIP, SSIM and the causes taken at the first reference image only."""
        return dataclasses.replace(self, stride=1 << 30)

    def config(self, row: int, base: TsarConfig) -> TsarConfig:
        """Configuration of a row of table 7.2: batch and resolution from the row, the rest from ``base``.

        A bound on the tiles that is too low for a row's batch is raised to the smallest tiling that holds it.
        """
        return self.sized(*ROWS[row], base)

    def sized(self, batch: int, side: int, base: TsarConfig) -> TsarConfig:
        """As :meth:`config`, with a batch and an output side of the thesis' size."""
        require(not base.width_px, "width_px", "none in a study, whose pictures are squares", base.width_px)
        area, divisor = self.divisor**2, self.divisor
        level_min = max(1, base.tiling.level_min - (divisor.bit_length() - 1))
        support = base.reconstruction.age_support_px // divisor
        small = dataclasses.replace(
            base,
            batch_size=batch // area,
            resolution_px=side // divisor,
            sdf_side=base.sdf_side // divisor,
            cache_size=base.cache_size // area,
            tiling=dataclasses.replace(base.tiling, level_min=level_min, tile_count_max=0),
            reconstruction=dataclasses.replace(base.reconstruction, age_support_px=support + 1 - support % 2),
        )
        if divisor == 1 and not base.tiling.tile_count_max:
            return small
        tiles = min((base.tiling.tile_count_max or max(512, 4 * batch)) // area, 4**small.level_max)
        tiles = max(tiles, tiles_at_least(small.batch_size, level_min))
        return dataclasses.replace(small, tiling=dataclasses.replace(small.tiling, tile_count_max=tiles))


def is_framed(policy: str) -> bool:
    """Whether a policy makes whole frames, which depend on the resolution alone."""
    return policy == "framed" or policy.startswith("framed-")


def framed_config(side_px: int) -> TsarConfig:
    """A configuration for a framed renderer, which reads only the resolution; the rest is fixed."""
    return TsarConfig(batch_size=16, resolution_px=side_px, tiling=TilingConfig(tile_count_max=16))


ADAPTIVE_STAGES = ("thesis", "oracle")
"""Policies whose stages have the prices of table 7.1, so that the length of their cycles is known before a run."""

SCALES: dict[str, Scale] = {
    "thesis": Scale(1, seconds=2.0, reference_rate_hz=60.0, reference_samples_per_axis=2, stride=6),
    "half": Scale(2, seconds=2.0, reference_rate_hz=60.0, reference_samples_per_axis=3, stride=6),
    "quick": Scale(4, seconds=2.0, reference_rate_hz=30.0, reference_samples_per_axis=3, stride=6),
}


@dataclass(frozen=True)
class MovingScene:
    """A scene in motion.

    Attributes:
        input: name of a scene, or a file.
        phase: phase of the animation.
        camera_path: camera motion for a file without one.
    """

    input: str
    phase: float = 0.0
    camera_path: str = ""


Tracing = tuple[tuple[str, bool | int | str], ...]
"""Settings of tracing that differ from the scene and from the renderer's defaults, by name in alphabetical order."""
TRACING = ("depth", "light_cells", "packets", "structure", "texels")
"""Names in :data:`Tracing`. ``depth``: of reflections; ``light_cells``: along each axis of a light that has an extent,
0 for one random point of it; ``packets`` and ``structure`` as of :class:`renderer.trace.Renderer`; ``texels``: one of
:data:`tsar.formats.NUMBER_FORMATS` that holds textures."""


@dataclass(frozen=True)
@closed_choices()
class Case:
    """One policy on one input at one setting: everything that decides its result.

    Attributes:
        input: name of a built-in input or another scene, or a file.
        phase: phase of the animation.
        policy: name of the policy that decides what is sampled.
        tsar: configuration; framed renderers read its resolution.
        scale: sizes of the study to which the case belongs.
        ledger: how cost is counted.
        framed_rate_hz: images a second of the framed renderer with one sample a pixel; sets the machine's speed.
        trace_segments: ray segments per sample in the cost model.
        start_s: animation time at which the measurement starts, seconds.
        jod_span_s: beginning and end, in seconds after the start, of the part of the run that ColorVideoVDP scores,
            which costs more a second than all the rest; None for no score.
        display: the display that the score assumes.
        stills_s: times whose pictures are kept, seconds after the start.
        parts: options of the policy ``tsar`` that differ from its defaults, by name in alphabetical order
            (:class:`tsar.filtering.records.FilterOptions`).
        budget_s: seconds over which surfaces and lights are compared to divide the error
            (:mod:`analysis.metrics.budget`); None for no such division.
        camera_path: camera motion for a file without one.
        tracing: settings of tracing; the reference is always traced as the scene says.
        formats: formats of values that the policy keeps, if they differ from its own, by name in alphabetical order
            (:class:`tsar.policies.stored.Stored`). With any, the requests of each cycle are recorded.
        display_px: side of the display, on which pictures of another size are shown enlarged; 0 for that of the
            pictures. With a display the causes of the error are not measured.
        samples_per_s: samples a second of every policy, whatever they cost; None if the machine sets the pace.
    """

    input: str
    policy: str
    tsar: TsarConfig
    scale: Scale
    phase: float = 0.0
    ledger: Ledger = "thesis"
    framed_rate_hz: float = 8.0
    trace_segments: float = SEGMENTS_DEFAULT
    start_s: float = 0.0
    jod_span_s: tuple[float, float] | None = None
    display: DisplayModel = field(default_factory=DisplayModel)
    stills_s: tuple[float, ...] = ()
    parts: tuple[tuple[str, bool | int | float], ...] = ()
    budget_s: float | None = None
    camera_path: str = ""
    tracing: Tracing = ()
    formats: tuple[tuple[str, str], ...] = ()
    display_px: int = 0
    samples_per_s: float | None = None

    def __post_init__(self) -> None:
        require(not self.parts or self.policy == "tsar", "parts", "none but of tsar", self.parts)
        budget = self.budget_s
        require(budget is None or 0.0 < budget <= 10.0, "budget_s", "seconds in (0, 10]", budget)
        require_input(self.input)
        require({name for name, _ in self.tracing} <= set(TRACING), "tracing", ", ".join(TRACING), self.tracing)
        POLICIES.require(self.policy)
        require(self.ledger != "wall", "ledger", "one with repeatable results (not wall)", self.ledger)
        require(0 < self.framed_rate_hz < 1e6, "framed_rate_hz", "a positive rate", self.framed_rate_hz)
        pace = self.samples_per_s
        require(pace is None or 0.0 < pace < 1e15, "samples_per_s", "a positive number", pace)
        if pace is None and self.policy in ADAPTIVE_STAGES:
            cycle_s = float(adaptive_flops(self.cost, expected_ledger(self.ledger))) / self.capacity
            pace = cycle_s, self.start_s, self.scale.seconds, self.tsar.warmup_cycles
            limits.require_pace("framed_rate_hz", self.framed_rate_hz, *pace)
        span = self.jod_span_s
        ok = span is None or 0 <= span[0] < span[1] <= self.scale.seconds
        require(ok, "jod_span_s", f"a beginning and an end within the {self.scale.seconds:g} s of a run", span)
        require(not self.tsar.width_px, "width_px", "none in a study, whose pictures are squares", self.tsar.width_px)
        require(self.scale.reference_px % self.tsar.resolution_px == 0, "resolution_px", "a divisor of the reference's",
                self.tsar.resolution_px)  # fmt: skip
        shown = self.shown_px
        fits = shown % self.tsar.resolution_px == 0 == self.scale.reference_px % shown
        require(fits, "display_px", "a multiple of the pictures' side, and a divisor of the reference's", shown)

    @property
    def animation(self) -> MovingScene:
        """The scene and its motion."""
        return MovingScene(self.input, self.phase, self.camera_path)

    @property
    def shown_px(self) -> int:
        """Side of the display."""
        return self.display_px or self.tsar.resolution_px

    @property
    def cost(self) -> CostParameters:
        """Parameters of the cost model. A pixel is charged for the age support of the full size, which covers fewer
        pixels at a smaller size."""
        own = parameters_of(self.tsar, self.trace_segments)
        return dataclasses.replace(own, recon_age_support=own.recon_age_support * self.scale.divisor)

    @property
    def capacity(self) -> float:
        """FLOP/s of the machine on which the framed renderer keeps its rate at this resolution."""
        return float(nonadaptive_flops(self.cost, expected_ledger(self.ledger))) * self.framed_rate_hz

    @property
    def name(self) -> str:
        """Name for messages: policy and changes, input, batch, resolution, seed and phase."""
        c = self.tsar
        batch = "" if is_framed(self.policy) else f"-b{c.batch_size}"
        changes = (f"-{name}-{_value_name(value)}" for name, value in (*self.parts, *self.tracing, *self.formats))
        scene = Path(self.input).stem
        text = f"{self.policy}{''.join(changes)}-{scene}{batch}-{c.resolution_px}px-seed{c.seed}-phase{self.phase:.3f}"
        return text.replace(" ", "-")

    @property
    def added(self) -> list[Brought]:
        """The additions of other packages that it uses, which no hash of the source covers."""
        return brought((POLICIES, self.policy), *chosen(self.tsar), *tables_of(self.input))

    def key(self, source: str) -> str:
        """Name of its files: a readable part, and a hash of everything that decides the result, with the source
        code."""
        content = (content_of(self.animation),) if is_file(self.input) or is_added(self.input) else ()
        text = json.dumps([plain(self), source, *plain(self.added), *content], sort_keys=True)
        return f"{self.name}-{hashlib.sha256(text.encode()).hexdigest()[:12]}"


def _value_name(value: bool | int | float | str) -> str:
    return value if isinstance(value, str) else f"{value:g}"


@lru_cache(maxsize=16)
def content_of(animation: MovingScene) -> str:
    """Hash of a scene that the source does not cover."""
    from analysis.storage.reference import content_hash
    from scenes import catalog
    from scenes.models.scenes_of_models import content_of as content

    scene, _ = catalog.load_any(animation.input, animation.phase, animation.camera_path)
    return content_hash(content(animation.input, scene, False))
