"""Group shaded: whole pictures beside Mitsuba 3, both on all cores.

The bumpy sphere is the same work on both sides: one camera ray and one shadow ray a sample. So is the room, along
paths with the same greatest number of bounces. In the driving scenes Mitsuba's paths also continue at diffuse surfaces,
which ours do not. A second row compares with Mitsuba's direct light alone, which follows no mirrors as ours does, and
bounds the comparison from the other side.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from analysis.bench import mitsuba as peer
from analysis.bench.options import BenchOptions
from analysis.bench.rows import Row, rate_row
from analysis.bench.scenes import bumpy_scene, driving_scenes, renderer_of, room_scene
from analysis.command.timing import take_turns
from scenes.canonical import Scene
from tsar.config import closed_choices

if TYPE_CHECKING:
    from analysis.command.progress import Bars, Task
    from renderer.trace import Renderer

DRIVING_S = 0.8
"""Animation time, seconds, at which the driving scenes are rendered: the car is in all pictures."""

_NO_TARGETS: Mapping[str, float | None] = dict.fromkeys(peer.VARIANTS)

_REST_S = 0.03  # Mitsuba's threads keep spinning after a rendering


@dataclass(frozen=True)
@closed_choices()
class Still:
    """One picture that both sides render.

    Attributes:
        name: of the row.
        integrator: that of Mitsuba.
        samples_per_axis: samples along a pixel's side; Mitsuba takes the same number in all.
        targets: least ratio by variant.
    """

    name: str
    scene: Scene
    time_s: float
    integrator: peer.IntegratorName
    samples_per_axis: int
    targets: Mapping[str, float | None]


def stills(options: BenchOptions) -> Iterator[Still]:
    """All pictures of the group."""
    bumpy, targets = bumpy_scene(), peer.VARIANTS
    for axis in (2, 4):
        yield Still(f"bumpy sphere, {axis**2} per pixel", bumpy, 0.0, "direct", axis, targets)
    yield Still("room along paths, 16 per pixel", room_scene(), 0.0, "path", 4, _NO_TARGETS)
    for name, scene in driving_scenes(options).items():
        yield Still(f"{name}, 4 per pixel", scene, DRIVING_S, "path", 2, targets)
        yield Still(f"{name}, 4 per pixel, peer without mirrors", scene, DRIVING_S, "direct", 2, _NO_TARGETS)


def shaded(options: BenchOptions, bars: Bars) -> Iterator[Row]:
    """Samples per second of whole pictures, beside each variant that runs here."""
    found = list(stills(options))
    task = bars.task("shaded", len(found) * options.repetitions)
    renderers: dict[int, Renderer] = {}
    for still in found:
        if id(still.scene) not in renderers:
            renderers[id(still.scene)] = renderer_of(still.scene, options)
        yield from compare(still, renderers[id(still.scene)], options, task)
    for renderer in renderers.values():
        renderer.close()


def compare(still: Still, renderer: Renderer, options: BenchOptions, task: Task) -> Iterator[Row]:
    """One picture beside all variants, in turns."""
    side, axis = options.resolution_px, still.samples_per_axis
    reasons = {variant: peer.missing(variant) for variant in peer.VARIANTS}
    pictures = {
        variant: peer.still(still.scene, still.time_s, side, still.integrator, variant)
        for variant, reason in reasons.items()
        if not reason
    }
    cases: dict[str, Callable[[], object]] = {"ours": lambda: renderer.render_frame(still.time_s, side, side, axis)}
    cases |= {variant: picture.repeated(axis**2) for variant, picture in pictures.items()}
    seconds = take_turns(cases, options.repetitions, task, rest_s=_REST_S)
    mine = renderer.render_frame(still.time_s, side, side, axis).numpy()
    for variant, reason in reasons.items():
        note = reason
        if variant in pictures:
            theirs = pictures[variant].render(axis**2)
            note = f"mean colour differs by {100.0 * mean_difference(mine, theirs):.2f} %"
        row = Row("shaded", f"{still.name}, {variant}", "M samples/s", 0.0, f"Mitsuba {variant}", note=note)
        work = side**2 * axis**2 / 1e6
        yield rate_row(row, work, seconds["ours"], seconds.get(variant), still.targets[variant])


def mean_difference(ours: np.ndarray, theirs: np.ndarray) -> float:
    """Greatest difference of the mean of a channel between two pictures ``(h, w, 3)``, as a share of theirs."""
    mine, other = ours.mean(axis=(0, 1)), theirs.mean(axis=(0, 1))
    return float(np.max(np.abs(mine - other) / np.maximum(other, 1e-12)))
