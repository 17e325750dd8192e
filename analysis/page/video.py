"""The comparison film: the reference and the runs side by side, with maps of their decisions."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from PIL import Image, ImageDraw
from torch import Tensor

from analysis.metrics.quality import DisplayedImages, encode
from analysis.page.pictures import (
    RATE_MAP,
    ByteMap,
    ColorScale,
    PagePixels,
    age_map,
    density_map,
    enlarge,
    font,
    scale_strip,
    stored,
    tiling_map,
)

REFERENCE = "reference"
AGES = "age of samples"
"""Label of the map whose scale is fitted to the data."""
INK, PAPER = (235, 235, 235), (24, 24, 24)
OWN = (255, 176, 64)
RIVALS = ((96, 176, 255), (140, 205, 95), (225, 130, 215), (240, 225, 90), (110, 220, 210), (235, 115, 105))
_COLUMNS = 4, 6
"""Least and greatest number of panels side by side; between them, the number of photographs."""


def inks(runs: Sequence[str], own: str) -> list[tuple[int, int, int]]:
    """A colour for the curve of each run; colours repeat if there are many."""
    rivals = itertools.cycle(RIVALS)
    return [OWN if name == own else next(rivals) for name in runs]


class FrameSink(Protocol):
    """Destination of finished frames, such as an MP4 writer."""

    def add(self, pixels: PagePixels) -> None: ...


@dataclass(frozen=True)
class Scales:
    """Bounds of the colour scales, the same in every frame: least and greatest densities, and ages in seconds. The
    palette of the ages spans only the range of the data."""

    spatial: tuple[float, float]
    temporal: tuple[float, float]
    age_s: tuple[float, float] = (1e-3, 100.0)


def to_pixels(image: Tensor) -> PagePixels:
    """``(h, w, 3)`` uint8 sRGB of linear RGB; values that are not finite become black."""
    finite = image.nan_to_num(nan=0.0, posinf=0.0, neginf=0.0)
    return (encode(finite) * 255.0 + 0.5).clamp(0, 255).byte().contiguous().numpy()


def images(view: DisplayedImages) -> dict[str, Tensor]:
    """The reference and the images on all displays, by name, linear RGB."""
    return {REFERENCE: view.reference} | {name: display.image for name, (_, display) in view.shown.items()}


def photographs(view: DisplayedImages, side_px: int) -> dict[str, PagePixels]:
    """The reference and the images on all displays, by name, at one size."""
    size = side_px, height_of(view, side_px)
    return {label: enlarge(to_pixels(image), *size) for label, image in images(view).items()}


def height_of(view: DisplayedImages, width_px: int) -> int:
    """Even height of a picture of the given width with the aspect of the reference, limited to between a quarter of the
    width and four times the width."""
    height, width = view.reference.shape[:2]
    return width_px if height == width else 2 * round(0.5 * width_px * min(max(height / width, 0.25), 4.0))


def maps(view: DisplayedImages, own: str, scales: Scales) -> dict[str, ByteMap]:
    """Maps of the runs' decisions, by label: the maps of the run ``own``, the ages of its samples, and tiling and
    densities of every run that records its cycles. The labels of other runs begin with their names."""
    found: dict[str, ByteMap] = {}
    height, width = view.reference.shape[:2]
    for name in (own, *(name for name in view.shown if name != own)):
        record, display = view.shown[name]
        before = "" if name == own else f"{name}: "
        if record is not None:
            rates, densities, rate = record.densities.temporal, record.densities, "refreshes per cycle"
            tiling = tiling_map(record.tiling, rates, max(height, width), scales.temporal)
            found[f"{before}tiling by refresh rate"] = tiling
            found[f"{before}spatial density"] = density_map(densities.spatial, scales.spatial, "samples per element")
            found[f"{before}temporal density"] = density_map(rates, scales.temporal, rate, RATE_MAP)
        if name == own:
            for label, one in display.maps.items():
                places = stored(one.values.numpy().astype(np.float64), one.bounds)
                found[label] = ByteMap(places, ColorScale.of(one.bounds, one.unit, RATE_MAP))
            if display.sample_map is not None:
                found[AGES] = age_map(display.sample_map.newest_s, view.time_s, scales.age_s)
    return found


class ComparisonFilm:
    """Composes frames of rows of panels: photographs first, then maps with their colour scales below them, and last the
    errors so far, which fill the rest of the last row. Keeps no images.

    Attributes:
        width_px, height_px: size of a frame, even.
        panel_height_px: height of a panel without its label and scale.
    """

    def __init__(
        self,
        side_px: int,
        span_s: tuple[float, float],
        runs: Sequence[str],
        own: str,
        labels: Sequence[str],
        row: int,
        height_px: int = 0,
        scales: Mapping[str, ColorScale] | None = None,
    ) -> None:
        """Takes the width of a panel and, if it differs, its height, the time span of the error panel's axis, the runs
        whose errors are drawn, the labels of all panels except that of the errors, the number of panels in a row,
        and the colour scales of maps by label."""
        self._side = side_of(side_px)
        self._height = height_px or self._side
        self._strip = 2 * max(9, self._side // 24)
        self._span, self._labels = span_s, list(labels)
        self._inks = dict(zip(runs, inks(runs, own), strict=True))
        self._columns = min(max(row, _COLUMNS[0]), _COLUMNS[1])
        rows = len(self._labels) // self._columns + 1
        self._errors = (rows * self._columns - len(self._labels)) * self._side
        self._scales = dict(scales or {})
        scaled = [any(label in self._scales for label in self._labels[r * self._columns :][: self._columns])
                  for r in range(rows)]  # fmt: skip
        self._tops = np.cumsum([0, *(self._height + self._strip * (2 if one else 1) for one in scaled)]).tolist()
        self.width_px, self.height_px = self._columns * self._side, self._tops[-1]
        self.panel_height_px = self._height

    def frame(
        self,
        time_s: float,
        pictures: Mapping[str, PagePixels],
        times_s: Sequence[float],
        errors: Mapping[str, Sequence[float]],
    ) -> PagePixels:
        """One frame, with ``errors`` of each run up to now at ``times_s``. ``pictures`` are by label; the place of a
        missing one stays empty."""
        canvas = Image.new("RGB", (self.width_px, self.height_px), PAPER)
        draw = ImageDraw.Draw(canvas)
        for slot, label in enumerate(self._labels):
            left, top = self._corner(slot)
            pixels = pictures.get(label)
            if pixels is not None:
                canvas.paste(Image.fromarray(pixels), (left, top + self._strip))
                self._draw_scale(canvas, left, top + self._strip + self._height, label)
            self._label(draw, left, top, label if pixels is not None else f"{label}: missing")
        left, top = self._corner(len(self._labels))
        self._label(draw, left, top, f"squared error, t = {time_s:.3f} s")
        box = (left, top + self._strip, left + self._errors, top + self._strip + self._height)
        draw_errors(draw, box, self._span, times_s, {name: (errors[name], ink) for name, ink in self._inks.items()})
        return np.asarray(canvas)

    def _corner(self, slot: int) -> tuple[int, int]:
        return slot % self._columns * self._side, self._tops[slot // self._columns]

    def _draw_scale(self, canvas: Image.Image, left: int, top: int, label: str) -> None:
        if label in self._scales:
            strip = scale_strip(self._side, self._strip, self._scales[label], INK, PAPER)
            canvas.paste(Image.fromarray(strip), (left, top))

    def _label(self, draw: ImageDraw.ImageDraw, left: int, top: int, text: str) -> None:
        size = self._strip * 2 // 3
        room = (self._side - size) / draw.textlength(text, font=font(size))
        fitting = font(max(6, int(size * min(1.0, room))))
        draw.text((left + size // 2, top + self._strip // 2), text, font=fitting, fill=INK, anchor="lm")


def side_of(side_px: int) -> int:
    """Width of a panel for a requested width: even, and wide enough for its label."""
    return max(96, side_px - side_px % 2)


def draw_errors(
    draw: ImageDraw.ImageDraw,
    box: tuple[int, int, int, int],
    span_s: tuple[float, float],
    times_s: Sequence[float],
    curves: dict[str, tuple[Sequence[float], tuple[int, int, int]]],
) -> None:
    """Draws curves into ``box``, on a logarithmic axis of whole decades that covers the values so far."""
    size = max(9, (box[3] - box[1]) // 24)
    left, top, right, bottom = box[0] + 4 * size, box[1] + size, box[2] - size, box[3] - 2 * size
    beside = box[2] - box[0] > 1.5 * (box[3] - box[1])  # values are printed only if there is room for them
    right -= 15 * size if beside else 0
    values = [value for series, _ in curves.values() for value in series if value > 0]
    low = math.floor(math.log10(min(values))) if values else -4
    high = max(low + 1, math.ceil(math.log10(max(values)))) if values else -1
    for decade in range(low, high + 1):
        y = bottom - (decade - low) / (high - low) * (bottom - top)
        draw.line((left, y, right, y), fill=(70, 70, 70))
        draw.text((left - size // 2, y), f"1e{decade}", font=font(size), fill=INK, anchor="rm")
    for share, anchor in ((0.0, "ls"), (0.5, "ms"), (1.0, "rs")):
        time_s = span_s[0] + share * (span_s[1] - span_s[0])
        place = (left + share * (right - left), box[3] - size // 2)
        draw.text(place, f"{time_s:.3g} s", font=font(size), fill=INK, anchor=anchor)
    if not times_s:
        return
    x = left + (np.asarray(times_s) - span_s[0]) / (span_s[1] - span_s[0]) * (right - left)
    for row, (name, (series, ink)) in enumerate(curves.items()):
        share = (np.log10(np.maximum(series, 10.0**low)) - low) / (high - low)
        points = np.stack((x, bottom - np.clip(share, 0, 1) * (bottom - top)), 1)
        draw.line([tuple(point) for point in points.tolist()], fill=ink, width=max(1, size // 7))
        place = ((right if beside else left) + size, top + (row + 0.7) * 1.5 * size)
        draw.text(place, f"{name}  {series[-1]:.2e}", font=font(size), fill=ink, anchor="lm")
