"""Runs the parts of ``scripts/spectrum.py`` and writes their results."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from analysis.command.cli import bad_input, full_disk, require_memory
from analysis.command.progress import Bars, bars
from analysis.page.figures import save
from analysis.spectrum import plots
from analysis.spectrum.estimate_check import check_estimate, measure_example, measure_input
from analysis.spectrum.options import SpectrumOptions
from analysis.spectrum.spectra import (
    PHOTOGRAPHS,
    Spectrum,
    group_statistics,
    input_spectra,
    open_input,
    picture_spectrum,
    shown,
)
from analysis.storage.files import write_json
from analysis.storage.results import SUMMARY, own_results
from analysis.storage.summary import with_source

_BYTES_PER_SAMPLE = 32  # of a volume; 27 were measured, including its transform and a windowed copy
_BYTES_PER_PIXEL = 400
_EXAMPLES = 4
_FRAMES_SHOWN = 3


def run_study(options: SpectrumOptions) -> dict[str, Any]:
    """Runs the requested parts and writes figures and ``summary.json`` to ``options.out``.

    Raises:
        InputError: a picture cannot be used, or a size does not fit into memory.
    """
    if options.does("slopes"):
        require_memory(_BYTES_PER_PIXEL * options.tsar.resolution_px**2, f"resolution_px: {options.tsar.resolution_px}")
    if options.does("ideal"):
        need = _BYTES_PER_SAMPLE * options.ideal_samples**2 * options.ideal_frames
        require_memory(
            need,
            f"ideal_samples, ideal_frames: a tile of {options.ideal_samples}² samples at {options.ideal_frames} times",
        )
    if options.does("agreement"):
        need = 16 * _BYTES_PER_SAMPLE * options.agreement_samples**2 * options.agreement_frames
        require_memory(need, f"agreement_samples: {options.agreement_samples}")
    with bad_input():
        own_results(options.out, ("slopes.png", "spectra.png", "ideal_*.png", "agreement.png"))
        pictures = _pictures(options) if options.does("slopes") else []
    (options.out / SUMMARY).unlink(missing_ok=True)
    found: dict[str, Any] = {}
    with bars() as shown_bars, full_disk(options.out):
        if options.does("slopes"):
            found["slopes"] = _slopes(options, pictures, shown_bars)
        if options.does("ideal"):
            found["ideal"] = _ideal(options, shown_bars)
        if options.does("agreement"):
            found["agreement"] = _agreement(options, shown_bars)
        derived = {"level_max": options.tsar.level_max, "cycle_s": options.cycle_s()}
        source = {"scene": ", ".join(options.inputs), "seed": options.tsar.seed, "device": "cpu"}
        summary = with_source(found, options, **source)
        summary["config"]["resolved"] = derived
        write_json(options.out / SUMMARY, summary)
    return summary


def _pictures(options: SpectrumOptions) -> list[Spectrum]:
    from scenes.loading import asset

    photographs = [picture_spectrum(asset(name), "photographs") for name in PHOTOGRAPHS]
    return photographs + [picture_spectrum(path, "pictures given") for path in options.images]


def _slopes(options: SpectrumOptions, pictures: list[Spectrum], shown_bars: Bars) -> dict[str, Any]:
    levels = options.tsar.level_max - options.tsar.level_min + 1
    frames = len(options.sampled) * options.frames_per_input
    task = shown_bars.task("slopes", len(options.inputs) * (frames + levels))
    own = [spectrum for name in options.inputs for spectrum in input_spectra(options, name, task)]
    groups = list(dict.fromkeys(spectrum.group for spectrum in own))
    ordered = pictures + sorted(own, key=lambda spectrum: groups.index(spectrum.group))
    save(plots.slope_figure(ordered), options.out / "slopes.png")
    examples = [*pictures[:_EXAMPLES], *first_of_each(own)][: 2 * _EXAMPLES]
    save(plots.example_spectra_figure(examples), options.out / "spectra.png")
    rows = [
        {"name": s.name, "group": s.group, "source": s.source, "slope": s.slope, "slope_linear": s.slope_linear}
        for s in ordered
    ]
    return {"groups": group_statistics(ordered), "spectra": rows}


def first_of_each(spectra: Sequence[Spectrum]) -> list[Spectrum]:
    """The first frame of each input, of those with the most samples a pixel, which are the last with pictures."""
    frames = [one for one in spectra if one.picture is not None]
    return list({one.source: one for one in reversed(frames) if one.group == frames[-1].group}.values())[::-1]


def _ideal(options: SpectrumOptions, shown_bars: Bars) -> dict[str, Any]:
    renderer, _ = open_input(options, options.input)
    task = shown_bars.task("ideal", options.ideal_frames)
    example = measure_example(options, renderer.trace, task)
    times_s = [options.ideal_start_s + options.span_s * i / (_FRAMES_SHOWN - 1) for i in range(_FRAMES_SHOWN)]
    side = options.tsar.resolution_px
    frames = [shown(renderer.render_frame(time_s, side, side, 2).numpy()) for time_s in times_s]
    renderer.close()
    save(plots.tile_figure(frames, times_s, example), options.out / "ideal_tile.png")
    save(plots.norm_figure(example), options.out / "ideal_norm.png")
    save(plots.surface_figure(example), options.out / "ideal_surface.png")
    save(plots.estimate_figure(example), options.out / "ideal_estimate.png")
    return example.summary()


def _agreement(options: SpectrumOptions, shown_bars: Bars) -> dict[str, Any]:
    batches = -(-(options.tiles_per_input // 4) // 16)
    task = shown_bars.task("agreement", 4 * batches * options.agreement_frames * len(options.inputs))
    tiles = {}
    for number, name in enumerate(options.inputs):
        renderer, duration_s = open_input(options, name)
        tiles[name] = measure_input(options, number, renderer.trace, duration_s, task)
        renderer.close()
    found = check_estimate(tiles, options.tau)
    save(plots.agreement_figure(tiles, found, options.tau), options.out / "agreement.png")
    density = tiles[options.inputs[0]].theta.numpy()
    pixels = options.tsar.resolution_px / 2**options.agreement_level
    rates = [
        {"samples_per_pixel_side": space / pixels, "refresh_ms": 1e3 * options.span_s / time} for space, time in density
    ]
    return {"rates": rates, **found}
