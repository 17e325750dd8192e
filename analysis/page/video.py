"""The comparison film: the reference and all runs side by side, with what one of them decided."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from PIL import Image, ImageDraw
from torch import Tensor

from analysis.metrics.quality import View, encode
from analysis.page.pictures import (
    AGE_MAP,
    DENSITY_MAP,
    RATE_MAP,
    Pixels,
    age_image,
    density_image,
    enlarge,
    font,
    tiling_image,
    with_scale,
)

INK, PAPER = (235, 235, 235), (24, 24, 24)
OWN = (255, 176, 64)
RIVALS = ((96, 176, 255), (140, 205, 95), (225, 130, 215), (240, 225, 90), (110, 220, 210), (235, 115, 105))
_MAPS = ("tiling by refresh rate", "spatial density", "temporal density", "age of samples")


def inks(runs: Sequence[str], own: str) -> list[tuple[int, int, int]]:
    """A colour for the curve of each run; colours repeat where there are many."""
    rivals = itertools.cycle(RIVALS)
    return [OWN if name == own else next(rivals) for name in runs]


class FrameSink(Protocol):
    """Where finished frames go, such as an MP4 writer."""

    def add(self, pixels: Pixels) -> None: ...


@dataclass(frozen=True)
class Scales:
    """Bounds of the colour scales, the same in every frame: least and greatest density, and age in seconds."""

    spatial: tuple[float, float]
    temporal: tuple[float, float]
    age_s: tuple[float, float] = (0.01, 1.0)


def to_pixels(image: Tensor) -> Pixels:
    """``(h, w, 3)`` uint8 sRGB of linear RGB; values that are not finite become black."""
    finite = image.nan_to_num(nan=0.0, posinf=0.0, neginf=0.0)
    return (encode(finite) * 255.0 + 0.5).clamp(0, 255).byte().contiguous().numpy()


def photographs(view: View, side_px: int) -> dict[str, Pixels]:
    """The reference and what every display shows, by label."""
    images = {"reference": view.reference} | {name: display.image for name, (_, display) in view.shown.items()}
    return {label: enlarge(to_pixels(image), side_px) for label, image in images.items()}


def maps(view: View, own: str, scales: Scales, side_px: int) -> dict[str, Pixels | None]:
    """What the run ``own`` decided and how old its samples are, by label; None where it does not say."""
    record, display = view.shown[own]
    tiling = spatial = temporal = age = None
    if record is not None:
        rates, densities = record.densities.temporal, record.densities
        tiling = tiling_image(record.tiling, rates, side_px, scales.temporal)
        tiling = with_scale(tiling, scales.temporal, "refreshes per cycle", RATE_MAP)
        spatial = density_image(densities.spatial, scales.spatial, side_px)
        spatial = with_scale(spatial, scales.spatial, "samples per element", DENSITY_MAP)
        temporal = density_image(rates, scales.temporal, side_px, RATE_MAP)
        temporal = with_scale(temporal, scales.temporal, "refreshes per cycle", RATE_MAP)
    if display.sample_map is not None:
        age = age_image(display.sample_map.newest_s, view.time_s, scales.age_s, side_px)
        age = with_scale(age, (1e3 * scales.age_s[0], 1e3 * scales.age_s[1]), "ms", AGE_MAP)
    return {
        "tiling by refresh rate": tiling,
        "spatial density": spatial,
        "temporal density": temporal,
        "age of samples": age,
    }


class ComparisonFilm:
    """Composes frames of two rows of panels: the reference, every run, what the run ``own`` decided, and last the
    errors so far, which take two panels where the number of runs is odd. Keeps no images.

    Attributes:
        width_px, height_px: size of a frame, even.
    """

    def __init__(
        self, side_px: int, scales: Scales, span_s: tuple[float, float], runs: Sequence[str], own: str
    ) -> None:
        """Takes the width of a panel, the colour scales, the span of time on the error panel's axis, and the runs."""
        self._side = max(96, side_px - side_px % 2)
        self._strip = 2 * max(9, self._side // 24)
        self._scales, self._span, self._own = scales, span_s, own
        self._inks = dict(zip(runs, inks(runs, own), strict=True))
        pictures = 1 + len(runs) + len(_MAPS)
        self._columns = pictures // 2 + 1
        self._errors = (2 * self._columns - pictures) * self._side
        self.width_px, self.height_px = self._columns * self._side, 2 * (self._side + self._strip)

    def frame(self, view: View, times_s: Sequence[float], errors: Mapping[str, Sequence[float]]) -> Pixels:
        """One frame; ``errors`` of each run up to now, at ``times_s``."""
        canvas = Image.new("RGB", (self.width_px, self.height_px), PAPER)
        draw = ImageDraw.Draw(canvas)
        shown = photographs(view, self._side) | maps(view, self._own, self._scales, self._side)
        for slot, (label, pixels) in enumerate(shown.items()):
            left, top = self._corner(slot)
            if pixels is not None:
                canvas.paste(Image.fromarray(pixels), (left, top + self._strip))
            self._label(draw, left, top, label if pixels is not None else f"{label}: missing")
        left, top = self._corner(len(shown))
        self._label(draw, left, top, f"squared error, t = {view.time_s:.3f} s")
        box = (left, top + self._strip, left + self._errors, top + self._strip + self._side)
        draw_errors(draw, box, self._span, times_s, {name: (errors[name], ink) for name, ink in self._inks.items()})
        return np.asarray(canvas)

    def _corner(self, slot: int) -> tuple[int, int]:
        return slot % self._columns * self._side, slot // self._columns * (self._side + self._strip)

    def _label(self, draw: ImageDraw.ImageDraw, left: int, top: int, text: str) -> None:
        size = self._strip * 2 // 3
        room = (self._side - size) / draw.textlength(text, font=font(size))
        fitting = font(max(6, int(size * min(1.0, room))))
        draw.text((left + size // 2, top + self._strip // 2), text, font=fitting, fill=INK, anchor="lm")


def draw_errors(
    draw: ImageDraw.ImageDraw,
    box: tuple[int, int, int, int],
    span_s: tuple[float, float],
    times_s: Sequence[float],
    curves: dict[str, tuple[Sequence[float], tuple[int, int, int]]],
) -> None:
    """Curves on a logarithmic axis of whole decades that covers what there is so far, drawn into ``box``."""
    size = max(9, (box[3] - box[1]) // 24)
    left, top, right, bottom = box[0] + 4 * size, box[1] + size, box[2] - size, box[3] - 2 * size
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
        place = (left + size, top + (row + 0.7) * 1.5 * size)
        draw.text(place, f"{name}  {series[-1]:.2e}", font=font(size), fill=ink, anchor="lm")
