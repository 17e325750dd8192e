"""Pictures of a comparison as EXR files: those of every reference time, and some with layers, for denoisers and other
tools."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from analysis.comparison.options import RunOptions
from analysis.metrics.quality import DisplayedImages
from analysis.page.video import REFERENCE
from analysis.tracer.layers import scene_layers
from renderer.film.files import write_exr
from renderer.film.layers import write_layers
from renderer.posed import PosedRenderer, renderer_at
from renderer.trace import Renderer
from tsar.types import SampleMap


def exr_writers(
    options: RunOptions, renderer: Renderer | PosedRenderer, count: int
) -> list[Callable[[DisplayedImages], None]]:
    """What writes the EXR files that a run is asked for; each is called at every reference time.

    Args:
        options: of the run.
        renderer: the scene.
        count: number of reference times.
    """

    def frame(view: DisplayedImages) -> None:
        write_exr(options.out / "frames" / f"{view.number:06d}.exr", view.shown[options.policy][1].image)

    asked: list[Callable[[DisplayedImages], None]] = [frame] if options.write_frames else []
    return [*asked, LayeredStills(options, renderer, count)] if options.layered_stills else asked


class LayeredStills:
    """Writes ``NAME-NUMBER.exr`` for the reference and every display, at evenly spaced reference times.

    The picture has the layers of :func:`analysis.tracer.layers.scene_layers` at the reference time, where motion is
    that until the next one; ``age``, the seconds since the newest sample in each pixel was taken, infinite where none
    was; and ``samples``, the number of samples that a pixel shows: the effective number where a policy keeps means. A
    layer that a policy cannot tell is left out.

    Attributes:
        numbers: of those reference times.
    """

    def __init__(self, options: RunOptions, renderer: Renderer | PosedRenderer, count: int) -> None:
        """Removes the files of an earlier run.

        Args:
            options: of the run.
            renderer: the scene.
            count: number of reference times.
        """
        self._options, self._renderer, self._folder = options, renderer, options.out / "layers"
        moments = min(options.layered_stills, count)
        self.numbers = {(2 * moment + 1) * count // (2 * moments) for moment in range(moments)}
        for left in self._folder.glob("*.exr"):
            left.unlink()

    def __call__(self, view: DisplayedImages) -> None:
        """Writes the pictures if the time is one of them.

        Raises:
            FilmError: a file cannot be written.
        """
        if view.number not in self.numbers:
            return
        height, width = self._options.tsar.shape
        step_s = 1.0 / self._options.reference_rate_hz
        scene = scene_layers(renderer_at(self._renderer, view.time_s), width, height, view.time_s, step_s)
        axis = self._options.reference_samples_per_axis
        exact = {"age": np.zeros((height, width)), "samples": np.full((height, width), axis**2)}
        self._write(REFERENCE, view, {"": view.reference.numpy(), **scene, **exact})
        for name, (_, display) in view.shown.items():
            known = {} if display.sample_map is None else self._of_samples(display.sample_map, view.time_s)
            self._write(name, view, {"": display.image.numpy(), **scene, **known})

    def _write(self, name: str, view: DisplayedImages, layers: dict[str, NDArray]) -> None:
        write_layers(self._folder / f"{name}-{view.number:06d}.exr", layers)

    def _of_samples(self, samples: SampleMap, time_s: float) -> dict[str, NDArray]:
        """Age and number of the samples in each pixel."""
        config = self._options.tsar
        across = config.framelet_side * torch.exp2(samples.level.double()) / config.resolution_px
        count = across**2 if samples.inverse is None else 1.0 / samples.inverse
        return {
            name: over(values, config.shape)
            for name, values in (("age", time_s - samples.newest_s), ("samples", count))
        }


def over(values: Tensor, shape: tuple[int, int]) -> NDArray:
    """Values of equal squares, or of the whole picture, at its pixels ``(h, w)``."""
    rows, columns = (torch.arange(side) * parts // side for side, parts in zip(shape, values.shape, strict=True))
    return values[rows[:, None], columns].numpy()
