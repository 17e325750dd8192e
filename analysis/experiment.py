"""Wiring of one run: scene, renderer, adaptive pipeline, framed renderer, clocks, reference, records.

The only module of this package that knows the others; heavy imports wait until a run begins, so that the command line
answers at once.
"""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from analysis.cli import InputError, bad_input, full_disk, require_memory
from analysis.cost_model import cycle_seconds, frame_seconds
from analysis.files import own_folder, writable_folder
from analysis.run_options import RunOptions
from analysis.start import first_imports, first_made
from analysis.store import Store

if TYPE_CHECKING:
    from analysis.compare import Meter, Streams, Totals
    from analysis.records import StepWriter
    from analysis.reference import Reference
    from renderer.trace import Renderer
    from scenes.canonical import Scene
    from tsar.types import Display, StepRecord

ROOT = Path(__file__).resolve().parent.parent
_SUMMARY = "summary.json"
_FILES = ("steps.parquet", "error.png", "report.html", "comparison.mp4")
_BYTES_PER_PIXEL = 260  # images, age fields and films in flight at output resolution
_BYTES_PER_CACHED_SAMPLE = 20  # colours and wavelet coefficients
_BYTES_PER_SAMPLE = 64  # positions, times and colours of a framed image


@dataclass(frozen=True)
class Setup:
    """What a run needs before it starts."""

    scene: Scene
    renderer: Renderer
    losses: tuple[str, ...] = ()


def prepare(options: RunOptions) -> Setup:
    """Checks the machine, loads the scene and builds the renderer of the adaptive run.

    Raises:
        InputError: something asked for cannot be had.
    """
    with bad_input():
        pixels, finest = options.tsar.resolution_px**2, max(options.framed.values())
        need = pixels * (_BYTES_PER_PIXEL + _BYTES_PER_SAMPLE * finest**2)
        require_memory(need, f"resolution_px: {options.tsar.resolution_px}")
        slots = options.tsar.cache_slots
        require_memory(slots * options.tsar.samples * _BYTES_PER_CACHED_SAMPLE, f"cache_size: {slots} framelets")
        own_folder(options.out, "out")
        writable_folder(options.cache, "cache")
    with first_imports():
        from scenes import catalog

    with bad_input():
        scene, losses = catalog.load_any(options.input, options.phase, options.camera_path)
        for loss in losses:
            print(loss)
        return Setup(scene, _renderer(options, scene, 1), losses)


def _renderer(options: RunOptions, scene: Scene, axis: int) -> Renderer:
    """A renderer that filters textures for ``axis`` samples along a pixel's side."""
    with first_imports():
        from renderer.trace import Renderer

    side = options.tsar.resolution_px * axis
    return Renderer(scene, options.device, options.threads or None, footprint_resolution_px=side)


def run_experiment(options: RunOptions, began_s: float | None = None) -> dict[str, Any]:
    """Runs the comparison and writes everything to ``options.out``.

    Args:
        options: what to run.
        began_s: since when the first cycle is waited for, on the clock of :func:`time.monotonic`; by default now.

    Returns:
        The summary that is also in ``summary.json``.

    Raises:
        InputError: something asked for cannot be had.
    """
    began_s = time.monotonic() if began_s is None else began_s
    setup = prepare(options)
    with first_imports():
        from analysis import progress
        from analysis.compare import Streams, Totals
        from analysis.quality import reference_times
        from analysis.records import RecordLimits, StepWriter, check_invariants
        from analysis.summary import Measured
        from renderer.film import FilmError

    for name in (_SUMMARY, *_FILES):
        (options.out / name).unlink(missing_ok=True)  # of an earlier run
    times_s = reference_times(options.start_s, options.start_s + options.seconds, options.reference_rate_hz)
    with progress.bars() as bars, full_disk(options.out, FilmError):
        limits = RecordLimits(
            options.tsar.batch_size, options.tsar.budget, options.tsar.spatial_bounds, options.tsar.temporal_bounds
        )
        totals = Totals()
        with StepWriter(options.out / "steps.parquet", limits) as writer:
            adaptive, first_cycle_s = first_made(_adaptive(options, setup, totals, writer), began_s, bars.say)
            reference = _reference(options, setup, len(times_s), bars)
            framed, meters = _framed(options, setup)
            comparison = _compare(options, times_s, reference, Streams(adaptive, framed), bars)
    if totals.cycles == 0:
        (options.out / "steps.parquet").unlink()
        (options.out / "comparison.mp4").unlink(missing_ok=True)
        raise InputError(f"seconds: expected time for a cycle before the last reference image, got {options.seconds:g}")
    with full_disk(options.out):
        invariants = check_invariants(options.out / "steps.parquet")
        measured = Measured(comparison, totals, meters, options.framed, invariants, reference.nonfinite, options.cost)
        return _write(options, setup, measured, first_cycle_s)


def finished(options: RunOptions) -> dict[str, Any] | None:
    """The summary of a run of these options, by this code and of this scene as they are now; or None.

    It is complete where all of its files are as they were written; those that are damaged are named.

    Raises:
        InputError: the scene cannot be read.
    """
    with first_imports():
        from scenes import catalog

    with bad_input():
        scene, _ = catalog.load_any(options.input, options.phase, options.camera_path)
        store = Store(options.out, content_of(options, scene))
        found = store.read_json(_SUMMARY, {"provenance": dict, "invariants": {"ok": bool}, "files": list[str]})
    return found if found and all(store.find(name) is not None for name in found["files"]) else None


def content_of(options: RunOptions, scene: Scene) -> str:
    """Hash of all that decides what a run gives: options, the scene's content, and the code."""
    from analysis.files import plain
    from analysis.reference import content_hash
    from analysis.source import code_hash

    kept = {name: value for name, value in plain(options).items() if name not in ("out", "cache")}
    return content_hash((kept, scene, code_hash(run_experiment)))


def write_summary(options: RunOptions, summary: dict[str, Any]) -> dict[str, Any]:
    """Lists the files of a run that has ended, and writes its summary last: from then on the run is complete.

    Returns:
        What is in the summary: what was given, and the files.
    """
    store = Store(options.out, summary["provenance"]["content"])
    files = [name for name in _FILES if (options.out / name).exists()]
    for name in files:
        store.add(name)
    summary = {**summary, "files": files}
    store.write_json(_SUMMARY, summary)
    return summary


def _reference(options: RunOptions, setup: Setup, count: int, bars: Any) -> Reference:
    from analysis.reference import ReferenceSpec, content_hash, obtain, renderer_hash

    side, axis = options.tsar.resolution_px, options.reference_samples_per_axis
    spec = ReferenceSpec(
        scene=f"{options.input} phase {options.phase:g}",
        scene_hash=content_hash(setup.scene),
        renderer_hash=renderer_hash(setup.renderer, options.device),
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


def _adaptive(
    options: RunOptions, setup: Setup, totals: Totals, writer: StepWriter
) -> Iterator[tuple[StepRecord, Display]]:
    """The adaptive run, recorded cycle by cycle."""
    with first_imports():
        from renderer.control import stages
        from tsar.pipeline import run

    chosen = stages(options.tsar, options.stages, setup.renderer.threads)
    clock = cycle_seconds(options.counted, options.capacity, options.cost)
    span = options.start_s, options.start_s + options.seconds
    for record, display in run(options.tsar, setup.renderer.trace, clock, *span, chosen):
        writer.add(record)
        totals.add(record)
        yield record, display


def _framed(options: RunOptions, setup: Setup) -> tuple[dict[str, Iterator[Display]], dict[str, Meter]]:
    """The framed runs, not started yet, and their meters."""
    from analysis.compare import Meter
    from tsar.baselines.framed import run as run_framed

    span = options.start_s, options.start_s + options.seconds
    meters, framed = {}, {}
    for name, axis in options.framed.items():
        with bad_input():
            chosen = _renderer(options, setup.scene, axis) if name != "framed" else setup.renderer
        meters[name] = Meter(chosen.trace)
        clock = frame_seconds(options.counted, options.capacity, options.cost, axis)
        framed[name] = run_framed(options.tsar, meters[name], clock, *span, samples_per_axis=axis)
    return framed, meters


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


def _write(options: RunOptions, setup: Setup, measured: Any, first_cycle_s: float) -> dict[str, Any]:
    """Figures, report and summary."""
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
        content=content_of(options, setup.scene),
    )
    derived = {"level_max": options.tsar.level_max, "tile_count_max": options.tsar.tile_count_max}
    summary = {
        "ledger": options.counted,
        "capacity_flops": options.capacity,
        **summarise(measured),
        "start": {"first_cycle_s": first_cycle_s},
        "cost_parameters": options.cost,
        "config": {**config, "resolved": derived},
        "provenance": source,
    }
    results.write_figures(options.out, summary, measured)
    results.write_page(options.out, summary, measured)
    return write_summary(options, summary)
