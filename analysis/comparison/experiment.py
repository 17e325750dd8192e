"""Wiring of one run: scene, renderer, policies, clocks, reference, records.

Heavy imports wait until a run begins, so that the command line answers at once.
"""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

from analysis.command.cli import InputError, bad_input, full_disk
from analysis.command.start import first_imports, first_made
from analysis.comparison.options import RunOptions
from analysis.comparison.setup import Setup, prepare
from analysis.comparison.stored import FILES, Recording, added_by, complete_run, content_of
from analysis.metrics import METRICS
from analysis.storage.results import SUMMARY

if TYPE_CHECKING:
    from analysis.command.progress import Bars
    from analysis.comparison.summary import Measured
    from analysis.metrics.arrays import Floats
    from analysis.metrics.causes import Truths
    from analysis.metrics.quality import DisplayedImages
    from analysis.storage.records import RecordLimits
    from analysis.storage.reference import Reference
    from analysis.study.runs import PolicyRun
    from scenes.canonical import Scene


def run_experiment(options: RunOptions, began_s: float | None = None) -> dict[str, Any]:
    """Runs the comparison and writes everything to ``options.out``.

    Args:
        options: what to run.
        began_s: start of the wait for the first cycle, on the clock of :func:`time.monotonic`, seconds; by default now.

    Returns:
        The content of ``summary.json``.

    Raises:
        InputError: the machine or the input cannot provide what the options ask for.
    """
    return measure(options, began_s)[0]


def measure(
    options: RunOptions,
    began_s: float | None = None,
    scene: Scene | None = None,
    viewers: Sequence[Callable[[DisplayedImages], None]] = (),
) -> tuple[dict[str, Any], Measured]:
    """As :func:`run_experiment`; also returns everything that was measured.

    Args:
        options: what to run.
        began_s: start of the wait for the first cycle, seconds.
        scene: by default that of the options' input.
        viewers: each is called at every reference time with the images on all displays.
    """
    began_s = time.monotonic() if began_s is None else began_s
    with first_imports(), bad_input():
        from analysis.comparison.choosing import settled

        options, chosen = settled(options)
    setup = prepare(options, scene)
    with first_imports():
        from analysis.command import progress
        from analysis.comparison.stills import exr_writers
        from analysis.metrics.quality import reference_times
        from analysis.storage.records import StepWriter
        from renderer.film.files import FilmError

    for name in (SUMMARY, *FILES):
        (options.out / name).unlink(missing_ok=True)  # left by an earlier run
    times_s = reference_times(options.start_s, options.start_s + options.seconds, options.reference_rate_hz)
    with progress.bars() as bars, full_disk(options.out, FilmError):
        with StepWriter(options.out / "steps.parquet", _limits(options)) as writer:
            recording = Recording(writer)
            runs = _runs(options, setup, recording)
            own, first_cycle_s = first_made(runs[options.policy].images, began_s, bars.say)
            runs[options.policy] = dataclasses.replace(runs[options.policy], images=own)
            reference = _reference(options, setup, len(times_s), bars)
            files = exr_writers(options, setup.renderer_of(1), len(times_s))
            measured = _compare(options, times_s, reference, runs, bars, [*viewers, *files])
            measured = dataclasses.replace(measured, recorded=recording.name)
    if measured.seen[options.policy].images == 0 or (measured.totals.recorded and measured.totals.cycles == 0):
        (options.out / "steps.parquet").unlink(missing_ok=True)
        (options.out / "comparison.mp4").unlink(missing_ok=True)
        raise InputError(f"seconds: expected time for a cycle before the last reference image, got {options.seconds:g}")
    with full_disk(options.out):
        return _write(options, setup, measured, first_cycle_s, chosen), measured


def _limits(options: RunOptions) -> RecordLimits:
    from analysis.storage.records import RecordLimits

    c = options.tsar
    return RecordLimits(c.batch_size, c.budget, c.spatial_bounds, c.temporal_bounds)


def _reference(options: RunOptions, setup: Setup, count: int, bars: Any) -> Reference:
    from analysis.storage.reference import ReferenceSpec, obtain, renderer_hash
    from analysis.study.scenery import scene_hash

    (height, width), axis = options.tsar.shape, options.reference_samples_per_axis
    spec = ReferenceSpec(
        scene=f"{options.input} phase {options.phase:g}",
        scene_hash=scene_hash(options.input, setup.scene, options.integrator == "path"),
        renderer_hash=renderer_hash(setup.renderer_of(1), options.device),
        start_s=options.start_s,
        rate_hz=options.reference_rate_hz,
        count=count,
        width_px=width,
        height_px=height,
        samples_per_axis=axis,
    )
    task = bars.task("reference", count)
    with bad_input():
        renderer = setup.renderer_of(1)
        return obtain(options.references, spec, lambda t: renderer.render_frame(t, width, height, axis), task)


def _runs(options: RunOptions, setup: Setup, recording: Recording) -> dict[str, PolicyRun]:
    """All runs, not yet started."""
    with first_imports():
        from analysis.study.runs import Machine, begin

    machine = Machine(options.ledger, options.machine_flops, options.cost)
    span_s = options.start_s, options.start_s + options.seconds
    with bad_input():
        return {
            name: begin(
                name,
                options.tsar,
                setup.renderer_of,
                machine,
                span_s,
                stages=options.stages,
                threads=setup.renderer_of(1).threads,
                on_record=recording.of(name),
                parts=dict(options.parts) if name == options.policy else None,
            )
            for name in (options.policy, *options.rivals)
        }


def _compare(
    options: RunOptions,
    times_s: Floats,
    reference: Reference,
    runs: dict[str, PolicyRun],
    bars: Bars,
    further: Sequence[Callable[[DisplayedImages], None]],
) -> Measured:
    from analysis.comparison.rivalry import Panels
    from analysis.comparison.scores import scores
    from analysis.comparison.summary import Measured
    from analysis.comparison.viewers import EXACT, Filming, Steps
    from analysis.page.video import Scales
    from analysis.study.displays import Measuring, watch
    from renderer.film.files import Mp4Writer

    scales = Scales(options.tsar.spatial_bounds, options.tsar.temporal_bounds)
    stride = max(1, round(options.reference_rate_hz / 60.0))
    span_s = options.start_s, options.start_s + options.seconds
    side_px = min(options.tsar.shape[1], 512)
    filming = [Filming(options.policy, scales, side_px, options.out, stride)] if options.film else []
    steps = Steps(options.policy, scales, len(times_s), exact=options.page == EXACT)
    task = bars.task("comparison", len(times_s))

    def on_view(view: DisplayedImages) -> None:
        task.advance()

    viewers = [on_view, steps, *further, *filming]
    images = {name: run.images for name, run in runs.items()}
    of_images = tuple(name for name in options.further_metrics if METRICS[name].image)
    of_sequences = tuple(name for name in options.further_metrics if METRICS[name].sequence)
    first = (len(times_s) - options.images_scored) // 2
    kept = first, first + (options.images_scored if of_sequences else 0)
    measuring = Measuring(metrics=of_images, stride=options.metric_stride, kept=kept)
    seen = watch(images, _truths(options, reference), times_s, measuring, viewers)
    panels = Panels.of({name: one.column("mse") for name, one in seen.items()}, options.policy)
    for one in filming:
        made, drawn = one.film(panels, span_s), bars.task("film", one.frames)
        fps = options.reference_rate_hz / stride
        with Mp4Writer(options.out / "comparison.mp4", fps, made.width_px, made.height_px) as sink:
            one.write(panels, made, sink, drawn.advance)
    sequences = {name: scores(name, seen, options, bars.task(name, len(seen)).advance) for name in of_sequences}
    shown = steps.made, steps.panels(list(seen))
    return Measured(options.policy, times_s, seen, runs, *shown, reference.nonfinite, options.cost, sequences)


def _truths(options: RunOptions, reference: Reference) -> Truths:
    import numpy as np
    import torch

    from analysis.metrics.causes import Truths

    def image(number: int) -> torch.Tensor:
        return torch.from_numpy(reference.images[number].astype(np.float32))

    return Truths(image, options.start_s, options.reference_rate_hz, reference.spec.count)


def _write(options: RunOptions, setup: Setup, measured: Any, first_cycle_s: float, chosen: Any) -> dict[str, Any]:
    """Figures, report and summary."""
    from analysis.comparison import results
    from analysis.comparison.choosing import what_came
    from analysis.comparison.rivalry import best_rival
    from analysis.comparison.summary import summarise
    from analysis.storage.provenance import provenance

    config = dataclasses.asdict(options)
    source = provenance(
        config,
        added_by(options),
        scene=setup.scene.name or options.input,
        phase=options.phase,
        seed=options.tsar.seed,
        device=options.device,
        threads=setup.renderer_of(1).threads,
        content=content_of(options, setup.scene),
    )
    tiling = {"level_max": options.tsar.level_max, "tile_count_max": options.tsar.tile_count_max}
    derived = {**tiling, "metrics": options.further_metrics}
    summary = {
        "ledger": options.ledger,
        "capacity_flops": options.machine_flops,
        **summarise(measured),
        **best_rival(measured),
        "choice": what_came(chosen, measured, options.machine_flops, options.seconds) if chosen else None,
        "start": {"first_cycle_s": first_cycle_s},
        "cost_parameters": options.cost,
        "config": {**config, "resolved": derived},
        "provenance": source,
    }
    results.write_figures(options.out, summary, measured)
    results.write_page(options.out, summary, measured)
    return complete_run(options, summary)
