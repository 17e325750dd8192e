"""What is made of a comparison as it goes by: the film, and the pictures that the page shows.

Which framed rival has a panel is known when all errors are: that of the lowest median error. So the pictures of a film
are kept until then, on disk.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa

from analysis.comparison.rivalry import Panels
from analysis.metrics.quality import View
from analysis.page.pictures import Pixels, webp_bytes
from analysis.page.player import Step
from analysis.page.video import ComparisonFilm, FrameSink, Scales, maps, photographs, side_of

STEPS_MAX = 60
"""Positions of the slider in the report at most."""
STEP_PX = 256
"""Width of the pictures in the report."""


@dataclass
class Steps:
    """Keeps pictures of evenly spaced times for the page: every k-th, with the least k that keeps to ``most``.

    Changes in place.

    Attributes:
        own: the run whose decisions are shown first.
        scales: bounds of the colour scales.
        count: how many reference times there will be.
        made: the pictures, of all runs.
    """

    own: str
    scales: Scales
    count: int
    most: int = STEPS_MAX
    made: list[Step] = field(default_factory=list)

    def __call__(self, view: View) -> None:
        if view.number % -(-self.count // self.most) == 0:
            # encoded at once: the pixels of all steps together would take as much memory as the run
            photos = photographs(view, STEP_PX).items()
            pictures: dict[str, bytes | None] = {label: webp_bytes(pixels, lossless=False) for label, pixels in photos}
            for label, pixels in maps(view, self.own, self.scales, STEP_PX).items():
                pictures[label] = webp_bytes(pixels, lossless=True)
            self.made.append(Step(view.number, pictures))

    def chosen(self, panels: Panels) -> list[Step]:
        """Those of the runs that have a panel."""
        return [replace(step, pictures=panels.arranged(step.pictures)) for step in self.made]


class Reel:
    """Pictures kept aside on disk, without loss, in a file that nothing else sees. Changes in place."""

    def __init__(self, folder: Path) -> None:
        self._file = tempfile.TemporaryFile(dir=folder)
        self._codec = pa.Codec("zstd", compression_level=1)

    def keep(self, pixels: Pixels) -> tuple[int, int, tuple[int, ...]]:
        """Where a picture lies."""
        packed = self._codec.compress(np.ascontiguousarray(pixels), asbytes=True)
        place = self._file.seek(0, 2)
        self._file.write(packed)
        return place, len(packed), pixels.shape

    def picture(self, kept: tuple[int, int, tuple[int, ...]]) -> Pixels:
        """A picture that lies there."""
        place, size, shape = kept
        self._file.seek(place)
        whole = self._codec.decompress(self._file.read(size), int(np.prod(shape)), asbytes=True)
        return np.frombuffer(whole, np.uint8).reshape(shape)


class Filming:
    """Keeps the pictures of every so many reference times, and makes the film of them when all is over. Changes in
    place.

    Attributes:
        own: the run whose decisions are shown first.
        scales: bounds of the colour scales.
        side_px: width of a panel.
        stride: reference times from one frame to the next.
    """

    def __init__(self, own: str, scales: Scales, side_px: int, folder: Path, stride: int = 1) -> None:
        self.own, self.scales, self.side_px, self.stride = own, scales, side_of(side_px), stride
        self._reel = Reel(folder)
        self._frames: list[tuple[float, dict[str, Any]]] = []
        self._times_s: list[float] = []
        self._errors: dict[str, list[float]] = {}

    def __call__(self, view: View) -> None:
        self._times_s.append(view.time_s)
        for name, mse in view.mse.items():
            self._errors.setdefault(name, []).append(mse)
        if view.number % self.stride == 0:
            drawn = photographs(view, self.side_px) | maps(view, self.own, self.scales, self.side_px)
            kept = {label: self._reel.keep(pixels) for label, pixels in drawn.items()}
            self._frames.append((view.time_s, kept))

    def film(self, panels: Panels, span_s: tuple[float, float]) -> ComparisonFilm:
        """What composes its frames."""
        first = panels.arranged(self._frames[0][1])
        height_px = next(iter(first.values()))[2][0]
        runs, row = list(self._errors), len(panels.runs) + 1
        return ComparisonFilm(self.side_px, span_s, runs, self.own, list(first), row, height_px)

    def write(
        self, panels: Panels, film: ComparisonFilm, sink: FrameSink, advance: Callable[[], None] = lambda: None
    ) -> None:
        """Sends all frames to a sink."""
        for number, (time_s, kept) in enumerate(self._frames):
            pictures = {label: self._reel.picture(one) for label, one in panels.arranged(kept).items()}
            until = number * self.stride + 1
            sink.add(film.frame(time_s, pictures, self._times_s[:until], _until(self._errors, until)))
            advance()

    @property
    def frames(self) -> int:
        """How many the film will have."""
        return len(self._frames)


def _until(errors: Mapping[str, Sequence[float]], count: int) -> dict[str, Sequence[float]]:
    return {name: values[:count] for name, values in errors.items()}
