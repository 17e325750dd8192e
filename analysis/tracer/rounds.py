"""Stills rendered in rounds, which are stored after each so that an interrupted still continues; and their layers."""

from __future__ import annotations

import io
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from analysis.command.progress import Bars, Task
from analysis.storage.reference import content_hash
from analysis.storage.source import code_hash
from analysis.storage.store import Store
from analysis.tracer.layers import scene_layers
from analysis.tracer.posing import Posing
from analysis.tracer.render_options import RenderOptions
from renderer.film.files import count_nonfinite, write_image
from renderer.film.layers import write_layers
from renderer.frames import cut, tiles_of
from renderer.rounds import Made, Rounds, render_rounds
from renderer.sampling.plan import SamplePlan

if TYPE_CHECKING:
    from collections.abc import Mapping

_FIELDS = ("total", "coded", "squares", "count")


class StillRounds:
    """Renders the stills of a sequence in rounds.

    Attributes:
        frames: a task that shows nothing, because the bar counts samples.
    """

    def __init__(
        self, posing: Posing, plan: SamplePlan, options: RenderOptions, size_px: tuple[int, int], bars: Bars
    ) -> None:
        """Shows a bar of all samples that may be needed."""
        self.posing, self.plan, self.options, self.size_px = posing, plan, options, size_px
        self.frames = Task()
        tiles = len(tiles_of(options.crop or (0, 0, *size_px), size_px[0]))
        self._budget = tiles * 256 * options.samples
        self._task = bars.task("samples", options.frames * self._budget)
        self._made: Made | None = None
        self._time_s = 0.0
        code = code_hash(StillRounds, render_rounds)
        self._key = content_hash((options.job, posing.content, code))

    def picture(self, number: int, time_s: float) -> Tensor:
        """The still of the given number, continued from an interrupted run of the same job."""
        name = f"frame{number:05d}.rounds"
        store = Store(self.options.out, content_hash((self._key, number)))
        store.require_own([name])
        state, start = _restored(store.read(name)), self._task.done
        before = 0 if state is None else int(state.count.sum()) * 256 * self.plan.samples_per_pixel
        self._task.advance(before)

        def done(samples: int, state: Rounds) -> None:
            self._task.advance(samples)
            with store.make(name) as making:
                making.path.write_bytes(_stored(state))

        renderer = self.posing.at(time_s)
        self._made = render_rounds(
            renderer, self.plan, self.options.in_rounds, *self.size_px, time_s, renderer.shutter_s, number,
            self.options.error_target, self.options.crop, state, done,
        )  # fmt: skip
        self._task.reach(start + self._budget)
        self._time_s = time_s
        store.discard([name])
        return self._made.image

    def write(self, path: Path, image: Tensor) -> int:
        """Writes the still that was made last, with its layers if they were requested."""
        if not self.options.layers or self._made is None:
            return write_image(path, image)
        write_layers(path, {"": image.numpy(), **self._layers(self._made)})
        return count_nonfinite(image)

    def _layers(self, made: Made) -> Mapping[str, NDArray]:
        width, height = self.size_px
        layers = scene_layers(self.posing.at(self._time_s), width, height, self._time_s, 1.0 / self.options.fps)
        crop = self.options.crop
        whole = {name: cut(torch.from_numpy(np.ascontiguousarray(part)), crop).numpy() for name, part in layers.items()}
        return whole | {"samples": made.samples.numpy(), "variance": made.variance.numpy()}


def _stored(state: Rounds) -> bytes:
    buffer = io.BytesIO()
    np.savez(buffer, **{name: getattr(state, name) for name in _FIELDS})  # type: ignore[arg-type]
    return buffer.getvalue()


def _restored(content: bytes | None) -> Rounds | None:
    if content is None:
        return None
    with np.load(io.BytesIO(content)) as found:
        return Rounds(*(found[name] for name in _FIELDS))
