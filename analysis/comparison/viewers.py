"""The film of a comparison, and the pictures of its page, made while it runs.

The framed rival of the lowest median error has a panel. It is known only when all errors are known, so the pictures of
a film are kept on disk until then.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from analysis.comparison.rivalry import Panels
from analysis.metrics.quality import DisplayedImages
from analysis.page.comparer import Panel, Step
from analysis.page.pictures import ByteMap, ColorScale, PagePixels, enlarge, picture_bytes
from analysis.page.video import (
    AGES,
    REFERENCE,
    ComparisonFilm,
    FrameSink,
    Scales,
    images,
    maps,
    photographs,
    side_of,
    to_pixels,
)

STEPS_MAX = 60
"""Most positions of the slider in the report."""
EXACT = "lossless"
"""The report keeps pictures and maps exactly."""
MAP_PX = 256
"""Otherwise larger maps, which are noisy, are thinned to this many pixels along a side."""


@dataclass
class Steps:
    """Keeps pictures for the page at every k-th reference time, at full resolution, with the least k that keeps to
    ``most``. An image that stays on a display is kept once.

    Changes in place.

    Attributes:
        own: the run whose decisions are shown first.
        scales: bounds of the colour scales.
        count: number of reference times.
        exact: whether pictures are kept without loss, and maps at full size.
        made: the pictures of all runs.
        map_scales: colour scales of the maps, by label.
    """

    own: str
    scales: Scales
    count: int
    most: int = STEPS_MAX
    exact: bool = False
    made: list[Step] = field(default_factory=list)
    map_scales: dict[str, ColorScale] = field(default_factory=dict)
    _ages: NDArray[np.int64] = field(default_factory=lambda: np.zeros(256, np.int64))
    _last: dict[str, tuple[Any, bytes]] = field(default_factory=dict)

    def __call__(self, view: DisplayedImages) -> None:
        if view.number % -(-self.count // self.most) == 0:
            # encoded at once: the pixels of all steps together would take as much memory as the run
            pictures: dict[str, bytes | None] = {name: self._kept(name, image) for name, image in images(view).items()}
            for label, one in maps(view, self.own, self.scales).items():
                apart = 1 if self.exact else -(-max(one.places.shape) // MAP_PX)
                pictures[label] = picture_bytes(one.places[::apart, ::apart], exact=True)
                self.map_scales[label] = one.scale
                if label == AGES:
                    self._ages += np.bincount(one.places.ravel(), minlength=256)
            self.made.append(Step(float(view.time_s), pictures))

    def _kept(self, name: str, image: Any) -> bytes:
        before = self._last.get(name)
        if before is None or before[0] is not image:
            self._last[name] = before = (image, picture_bytes(to_pixels(image), self.exact))
        return before[1]

    def panels(self, runs: Sequence[str]) -> list[Panel]:
        """The reference, runs and maps; the scale of ages is fitted to the data."""
        found = [Panel(REFERENCE), *(Panel(name, truth=REFERENCE) for name in runs)]
        for label, scale in self.map_scales.items():
            found.append(Panel(label, scale=scale.fitted(self._ages) if label == AGES else scale))
        return found


class Reel:
    """Pictures on disk, without loss, in an anonymous temporary file. Changes in place."""

    def __init__(self, folder: Path) -> None:
        self._file = tempfile.TemporaryFile(dir=folder)
        self._codec = pa.Codec("zstd", compression_level=1)

    def keep(self, pixels: PagePixels) -> tuple[int, int, tuple[int, ...]]:
        """Stores a picture; returns its offset, length and shape."""
        packed = self._codec.compress(np.ascontiguousarray(pixels), asbytes=True)
        place = self._file.seek(0, 2)
        self._file.write(packed)
        return place, len(packed), pixels.shape

    def picture(self, kept: tuple[int, int, tuple[int, ...]]) -> PagePixels:
        """The stored picture."""
        place, size, shape = kept
        self._file.seek(place)
        whole = self._codec.decompress(self._file.read(size), int(np.prod(shape)), asbytes=True)
        return np.frombuffer(whole, np.uint8).reshape(shape)


class Filming:
    """Keeps the pictures at every ``stride``-th reference time, and makes a film of them at the end. Changes in place.

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
        self._scales: dict[str, ColorScale] = {}
        self._ages = np.zeros(256, np.int64)
        self._times_s: list[float] = []
        self._errors: dict[str, list[float]] = {}

    def __call__(self, view: DisplayedImages) -> None:
        self._times_s.append(view.time_s)
        for name, mse in view.mse.items():
            self._errors.setdefault(name, []).append(mse)
        if view.number % self.stride == 0:
            mapped = maps(view, self.own, self.scales)
            drawn = photographs(view, self.side_px) | {label: one.places for label, one in mapped.items()}
            self._scales |= {label: one.scale for label, one in mapped.items()}
            if AGES in mapped:
                self._ages += np.bincount(mapped[AGES].places.ravel(), minlength=256)
            kept = {label: self._reel.keep(pixels) for label, pixels in drawn.items()}
            self._frames.append((view.time_s, kept))

    def film(self, panels: Panels, span_s: tuple[float, float]) -> ComparisonFilm:
        """The object that composes its frames."""
        first = panels.arranged(self._frames[0][1])
        height_px = next(iter(first.values()))[2][0]
        runs, row = list(self._errors), len(panels.runs) + 1
        return ComparisonFilm(self.side_px, span_s, runs, self.own, list(first), row, height_px, self.map_scales)

    @property
    def map_scales(self) -> dict[str, ColorScale]:
        """Scales of the maps so far; that of ages is fitted to the data."""
        return {label: one.fitted(self._ages) if label == AGES else one for label, one in self._scales.items()}

    def write(
        self, panels: Panels, film: ComparisonFilm, sink: FrameSink, advance: Callable[[], None] = lambda: None
    ) -> None:
        """Sends all frames to a sink."""
        scales, height_px = self.map_scales, film.panel_height_px
        for number, (time_s, kept) in enumerate(self._frames):
            pictures = {label: self._reel.picture(one) for label, one in panels.arranged(kept).items()}
            for label in scales.keys() & pictures.keys():
                coloured = ByteMap(pictures[label], scales[label]).pixels()
                pictures[label] = enlarge(coloured, self.side_px, height_px)
            until = number * self.stride + 1
            sink.add(film.frame(time_s, pictures, self._times_s[:until], _until(self._errors, until)))
            advance()

    @property
    def frames(self) -> int:
        """Number of frames of the film."""
        return len(self._frames)


def _until(errors: Mapping[str, Sequence[float]], count: int) -> dict[str, Sequence[float]]:
    return {name: values[:count] for name, values in errors.items()}
