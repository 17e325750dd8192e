"""Wiring of one run: scene, renderer, adaptive pipeline, framed renderer, clocks, reference, records.

The only module of this package that knows the others; heavy imports wait until a run begins, so that the command line
answers at once.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import tyro

from analysis.cli import bad_input, full_disk, require_memory
from analysis.cost_model import CAPACITY_DEFAULT, CostParameters, Ledger, cycle_seconds, frame_seconds, parameters_of
from analysis.files import writable_folder, write_json
from tsar.config import TsarConfig, require

if TYPE_CHECKING:
    from analysis.compare import Meter, Streams, Totals
    from analysis.records import StepWriter
    from analysis.reference import Reference
    from renderer.trace import Renderer
    from scenes.canonical import Scene
    from tsar.types import Display, StepRecord

ROOT = Path(__file__).resolve().parent.parent
_BYTES_PER_PIXEL = 260  # images, age fields and films in flight at output resolution
_BYTES_PER_SAMPLE = 64  # positions, times and colours of a framed image


@dataclass(frozen=True)
class RunOptions:
    """One comparison of the adaptive renderer with the framed one at equal cost."""

    input: Annotated[str, tyro.conf.Positional]
    """Built-in input (by name or number) or a scene file."""
    tsar: Annotated[TsarConfig, tyro.conf.arg(name=""), tyro.conf.OmitArgPrefixes] = field(default_factory=TsarConfig)
    """The adaptive pipeline."""
    seconds: float = 2.0
    """Simulated time to measure, seconds."""
    start_s: float = 0.0
    """Where in the animation the measurement starts, seconds."""
    phase: float = 0.0
    """Phase of the animation, for repetitions."""
    clock: Literal["simulated", "wall"] = "simulated"
    """Simulated time by the cost model, or measured time (the same as the ledger wall)."""
    ledger: Ledger = "thesis"
    """How cost is counted."""
    capacity: float = CAPACITY_DEFAULT
    """Speed of the simulated machine, FLOP/s. The default shows 8 framed images a second at 512²."""
    trace_segments: float = 4.0
    """Ray segments per sample in the cost model; the thesis' inputs have about 4, its table says 5."""
    framed_samples_per_axis: int = 1
    """Samples along a pixel's side of the framed renderer; it shows fewer images as it takes more."""
    supersampled_samples_per_axis: int = 2
    """The same for a second, supersampled framed renderer at equal cost; 0 leaves it out."""
    reference_rate_hz: float = 60.0
    """Reference images per simulated second."""
    reference_samples_per_axis: int = 3
    """Samples along a pixel's side of the reference."""
    device: Literal["cpu", "cuda:0"] = "cpu"
    """Where rays are traced."""
    threads: int = 0
    """Threads for tracing; 0 takes one per core."""
    frames: bool = False
    """Also write what the adaptive display shows at every reference time to frames/, as EXR."""
    film: bool = True
    """Write comparison.mp4."""
    out: Path = Path("out/run")
    """Folder for the results."""
    cache: Path = Path(".cache/reference")
    """Folder for references, shared by all runs."""

    def __post_init__(self) -> None:
        for name in ("seconds", "capacity", "trace_segments", "reference_rate_hz"):
            value = getattr(self, name)
            require(0 < value < math.inf, name, "a positive, finite number", value)
        for name in ("start_s", "phase"):
            require(math.isfinite(getattr(self, name)), name, "a finite number", getattr(self, name))
        for name in ("framed_samples_per_axis", "reference_samples_per_axis"):
            require(1 <= getattr(self, name) <= 16, name, "between 1 and 16", getattr(self, name))
        for name in ("framed_samples_per_axis", "supersampled_samples_per_axis"):
            value = getattr(self, name)
            require(0 <= value <= 16 and value & (value - 1) == 0, name, "a power of two up to 16", value)
        require(self.threads >= 0, "threads", "at least 0", self.threads)
        require(
            self.tsar.warmup_cycles >= 4, "warmup_cycles", "at least 4 (the latency and one)", self.tsar.warmup_cycles
        )

    @property
    def counted(self) -> Ledger:
        """The ledger in force."""
        return "wall" if self.clock == "wall" else self.ledger

    @property
    def cost(self) -> CostParameters:
        """Parameters of the cost model for this run."""
        return parameters_of(self.tsar, self.trace_segments)

    @property
    def framed(self) -> dict[str, int]:
        """Framed renderers by name and their samples along a pixel's side; the first is the one compared to."""
        runs = {"framed": self.framed_samples_per_axis}
        if self.supersampled_samples_per_axis > 0:
            runs["framed supersampled"] = self.supersampled_samples_per_axis
        return runs


@dataclass(frozen=True)
class Setup:
    """What a run needs before it starts."""

    scene: Scene
    renderer: Renderer
    supersampled: Renderer | None


def prepare(options: RunOptions) -> Setup:
    """Checks the machine, loads the scene and builds its renderers.

    Raises:
        InputError: something asked for cannot be had.
    """
    with bad_input():
        writable_folder(options.out, "out")
        writable_folder(options.cache, "cache")
        pixels, finest = options.tsar.resolution_px**2, max(options.framed.values())
        need = pixels * (_BYTES_PER_PIXEL + _BYTES_PER_SAMPLE * finest**2)
        require_memory(need, f"resolution_px: {options.tsar.resolution_px}")
    from renderer.trace import Renderer
    from scenes import catalog

    with bad_input():
        scene = catalog.load(options.input, options.phase)
        threads, side = options.threads or None, options.tsar.resolution_px
        renderer = Renderer(scene, options.device, threads, footprint_resolution_px=side)
        supersampled, axis = None, options.supersampled_samples_per_axis
        if axis:
            supersampled = Renderer(scene, options.device, threads, footprint_resolution_px=side * axis)
    return Setup(scene, renderer, supersampled)


def run_experiment(options: RunOptions) -> dict[str, Any]:
    """Runs the comparison and writes everything to ``options.out``.

    Returns:
        The summary that is also in ``summary.json``.

    Raises:
        InputError: something asked for cannot be had.
    """
    setup = prepare(options)
    from analysis import progress
    from analysis.compare import Totals
    from analysis.quality import reference_times
    from analysis.records import RecordLimits, StepWriter, check_invariants
    from analysis.summary import Measured
    from renderer.film import FilmError

    (options.out / "summary.json").unlink(missing_ok=True)
    times_s = reference_times(options.start_s, options.start_s + options.seconds, options.reference_rate_hz)
    with progress.bars() as bars, full_disk(options.out, FilmError):
        reference = _reference(options, setup, len(times_s), bars)
        limits = RecordLimits(
            options.tsar.batch_size, options.tsar.budget, options.tsar.spatial_bounds, options.tsar.temporal_bounds
        )
        totals = Totals()
        with StepWriter(options.out / "steps.parquet", limits) as writer:
            streams, meters = _streams(options, setup, totals, writer)
            comparison = _compare(options, times_s, reference, streams, bars)
    with full_disk(options.out):
        invariants = check_invariants(options.out / "steps.parquet")
        measured = Measured(comparison, totals, meters, options.framed, invariants, reference.nonfinite, options.cost)
        return _write(options, setup, measured)


def finished(options: RunOptions) -> dict[str, Any] | None:
    """The summary of a complete run of these options by this commit, or None."""
    import json

    from analysis.records import provenance

    now = provenance(ROOT, dataclasses.asdict(options))
    try:
        found = json.loads((options.out / "summary.json").read_text())
        same = all(found["provenance"][name] == now[name] for name in ("commit", "config_hash"))
    except (OSError, ValueError, KeyError, TypeError):
        return None
    return found if same and not now["uncommitted_changes"] else None


def _reference(options: RunOptions, setup: Setup, count: int, bars: Any) -> Reference:
    from analysis.reference import ReferenceSpec, content_hash, obtain, renderer_hash

    side, axis = options.tsar.resolution_px, options.reference_samples_per_axis
    spec = ReferenceSpec(
        scene=f"{options.input} phase {options.phase:g}",
        scene_hash=content_hash(setup.scene),
        renderer_hash=renderer_hash(ROOT, options.device),
        start_s=options.start_s,
        rate_hz=options.reference_rate_hz,
        count=count,
        resolution_px=side,
        samples_per_axis=axis,
    )
    show = bars.task("reference", count)
    with bad_input():
        return obtain(
            options.cache, spec, lambda t: setup.renderer.render_frame(t, side, side, axis), lambda done, _: show(done)
        )


def _streams(options: RunOptions, setup: Setup, totals: Totals, writer: StepWriter) -> tuple[Streams, dict[str, Meter]]:
    """The runs that are compared, not started yet, and the meters of the framed ones."""
    from analysis.compare import Meter, Streams
    from tsar.baselines.framed import run as run_framed
    from tsar.pipeline import run

    config, cost, ledger = options.tsar, options.cost, options.counted
    span = options.start_s, options.start_s + options.seconds
    renderers = {"framed": setup.renderer, "framed supersampled": setup.supersampled}
    meters, framed = {}, {}
    for name, axis in options.framed.items():
        chosen = renderers[name]
        assert chosen is not None
        meters[name] = Meter(chosen.trace)
        clock = frame_seconds(ledger, options.capacity, cost, axis)
        framed[name] = run_framed(config, meters[name], clock, *span, samples_per_axis=axis)
    cycles = run(config, setup.renderer.trace, cycle_seconds(ledger, options.capacity, cost), *span)
    return Streams(_recorded(cycles, totals, writer), framed), meters


def _recorded(
    cycles: Iterator[tuple[StepRecord, Display]], totals: Totals, writer: StepWriter
) -> Iterator[tuple[StepRecord, Display]]:
    for record, display in cycles:
        writer.add(record)
        totals.add(record)
        yield record, display


def _compare(options: RunOptions, times_s: Any, reference: Reference, streams: Streams, bars: Any) -> Any:
    from contextlib import nullcontext

    from analysis.compare import compare
    from analysis.video import ComparisonFilm, Scales
    from renderer.film import Mp4Writer, write_exr

    scales = Scales(options.tsar.spatial_bounds, options.tsar.temporal_bounds)
    stride = max(1, round(options.reference_rate_hz / 60.0))
    film = ComparisonFilm(
        min(options.tsar.resolution_px, 512), scales, (options.start_s, options.start_s + options.seconds)
    )
    fps = options.reference_rate_hz / stride
    place = options.out / "comparison.mp4"
    show = bars.task("comparison", len(times_s))

    def on_view(number: int, view: Any) -> None:
        show(number + 1)
        if options.frames:
            write_exr(options.out / "frames" / f"{number:06d}.exr", view.adaptive)

    with Mp4Writer(place, fps, film.width_px, film.height_px) if options.film else nullcontext() as sink:
        return compare(times_s, reference.images, streams, scales, film, sink, on_view, stride)


def _write(options: RunOptions, setup: Setup, measured: Any) -> dict[str, Any]:
    """Figures, report and summary, the summary last: where it is, the run is complete."""
    from analysis import results
    from analysis.records import provenance
    from analysis.summary import summarise

    config = dataclasses.asdict(options)
    source = provenance(
        ROOT,
        config,
        scene=setup.scene.name or options.input,
        phase=options.phase,
        seed=options.tsar.seed,
        device=options.device,
        threads=setup.renderer.threads,
    )
    derived = {"level_max": options.tsar.level_max, "tile_count_max": options.tsar.tile_count_max}
    summary = {
        "ledger": options.counted,
        "capacity_flops": options.capacity,
        **summarise(measured),
        "cost_parameters": options.cost,
        "config": {**config, "resolved": derived},
        "provenance": source,
    }
    results.write_figures(options.out, summary, measured)
    results.write_page(options.out, summary, measured)
    write_json(options.out / "summary.json", summary)
    return summary
