"""Group features: kernels for the features of a scene against kernels for all features, traced sample by sample."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING

import torch

from analysis.bench.options import BenchOptions
from analysis.bench.rows import Row, rate_row
from analysis.bench.scenes import driving_scenes
from analysis.command.timing import take_turns
from scenes.canonical import Scene
from scenes.effects import scenes as effects

if TYPE_CHECKING:
    from analysis.command.progress import Bars
    from renderer.trace import Renderer

_SIDE_PX, _SAMPLES_PER_AXIS = 192, 2


def _scenes(options: BenchOptions) -> dict[str, Scene]:
    """The driving scenes, and also those of the effects where no scene is named."""
    shown = {} if options.scenes else {name: effects.load(name) for name in effects.EFFECTS}
    return {**driving_scenes(options), **shown}


def features(options: BenchOptions, bars: Bars) -> Iterator[Row]:
    """Rows that time pictures of every scene by both kernels; the note says whether their bits are the same."""
    from renderer.kernels.entry import compiled_count
    from renderer.tables.requirements import required
    from renderer.trace import Renderer

    scenes = _scenes(options)
    task = bars.task("features", len(scenes) * options.repetitions)
    for name, scene in scenes.items():
        both = {
            kind: Renderer(scene, options.device, packets=False, specialise=kind == "required")
            for kind in ("required", "all")
        }
        pictures = {kind: _picture(renderer) for kind, renderer in both.items()}
        seconds = take_turns(pictures, options.repetitions, task, lead_in=True)
        same = torch.equal(pictures["required"](), pictures["all"]())
        for renderer in both.values():
            renderer.close()
        note = f"{required(scene).bit_count()} features, {'same picture' if same else 'PICTURES DIFFER'}, set number "
        row = Row("features", name, "M samples/s", 0.0, "all features", note=f"{note}{compiled_count()}")
        work = (_SIDE_PX * _SAMPLES_PER_AXIS) ** 2 / 1e6
        yield rate_row(row, work, seconds["required"], seconds["all"])


def _picture(renderer: Renderer) -> Callable[[], torch.Tensor]:
    return lambda: renderer.render_frame(0.25, _SIDE_PX, _SIDE_PX, _SAMPLES_PER_AXIS)
