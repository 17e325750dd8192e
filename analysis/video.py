"""The comparison film: reference, framed and adaptive side by side, with what the adaptive pipeline decided."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from PIL import Image, ImageDraw
from torch import Tensor

from analysis.pictures import (
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
from analysis.quality import encode
from tsar.types import Densities, Tiling

INK, PAPER = (235, 235, 235), (24, 24, 24)
ADAPTIVE, FRAMED = (255, 176, 64), (96, 176, 255)

PHOTOGRAPHS = ("reference", "framed", "TSAR")
"""The panels that are images of the scene; the others are maps."""


class FrameSink(Protocol):
    """Where finished frames go, such as an MP4 writer."""

    def add(self, pixels: Pixels) -> None: ...


@dataclass(frozen=True)
class View:
    """What all displays show at one time.

    Attributes:
        time_s: simulated time.
        reference, framed, adaptive: ``(h, w, 3)`` linear RGB.
        tiling, densities: of the cycle whose image is on the display.
        newest_s: animation time of the newest sample in each part of the adaptive image, ``(s, s)``; None: not known.
    """

    time_s: float
    reference: Tensor
    framed: Tensor
    adaptive: Tensor
    tiling: Tiling
    densities: Densities
    newest_s: Tensor | None = None


@dataclass(frozen=True)
class Scales:
    """Bounds of the colour scales, the same in every frame: least and greatest density, and age in seconds."""

    spatial: tuple[float, float]
    temporal: tuple[float, float]
    age_s: tuple[float, float] = (0.01, 1.0)


def to_pixels(image: Tensor) -> Pixels:
    """``(h, w, 3)`` uint8 sRGB of linear RGB; what is not finite is black."""
    finite = image.nan_to_num(nan=0.0, posinf=0.0, neginf=0.0)
    return (encode(finite) * 255.0 + 0.5).clamp(0, 255).byte().contiguous().numpy()


def panels(view: View, scales: Scales, side_px: int) -> dict[str, Pixels | None]:
    """Every picture of a view by its label, ``side_px`` wide; None where the view lacks what it shows."""
    spatial = density_image(view.densities.spatial, scales.spatial, side_px)
    temporal = density_image(view.densities.temporal, scales.temporal, side_px, RATE_MAP)
    tiling = tiling_image(view.tiling, view.densities.temporal, side_px, scales.temporal)
    age, age_ms = None, (1e3 * scales.age_s[0], 1e3 * scales.age_s[1])
    if view.newest_s is not None:
        age = with_scale(age_image(view.newest_s, view.time_s, scales.age_s, side_px), age_ms, "ms", AGE_MAP)
    return {
        "reference": enlarge(to_pixels(view.reference), side_px),
        "framed": enlarge(to_pixels(view.framed), side_px),
        "TSAR": enlarge(to_pixels(view.adaptive), side_px),
        "tiling by refresh rate": with_scale(tiling, scales.temporal, "refreshes per cycle", RATE_MAP),
        "spatial density": with_scale(spatial, scales.spatial, "samples per element", DENSITY_MAP),
        "temporal density": with_scale(temporal, scales.temporal, "refreshes per cycle", RATE_MAP),
        "age of samples": age,
    }


class ComparisonFilm:
    """Composes frames of two rows of four panels; the last holds the error so far. Keeps no images.

    Attributes:
        width_px, height_px: size of a frame, even.
    """

    def __init__(self, side_px: int, scales: Scales, span_s: tuple[float, float]) -> None:
        """Takes the width of a panel, the colour scales and the span of time on the error panel's axis."""
        self._side = max(96, side_px - side_px % 2)
        self._strip = 2 * max(9, self._side // 24)
        self._scales, self._span = scales, span_s
        self.width_px, self.height_px = 4 * self._side, 2 * (self._side + self._strip)

    def frame(self, view: View, times_s: Sequence[float], adaptive: Sequence[float], framed: Sequence[float]) -> Pixels:
        """One frame; ``adaptive`` and ``framed`` are the errors up to now, at ``times_s``."""
        canvas = Image.new("RGB", (self.width_px, self.height_px), PAPER)
        draw = ImageDraw.Draw(canvas)
        for slot, (label, pixels) in enumerate(panels(view, self._scales, self._side).items()):
            left, top = self._corner(slot)
            if pixels is not None:
                canvas.paste(Image.fromarray(pixels), (left, top + self._strip))
            self._label(draw, left, top, label if pixels is not None else f"{label}: missing")
        left, top = self._corner(7)
        self._label(draw, left, top, f"squared error, t = {view.time_s:.3f} s")
        box = (left, top + self._strip, left + self._side, top + self._strip + self._side)
        draw_errors(draw, box, self._span, times_s, {"framed": (framed, FRAMED), "TSAR": (adaptive, ADAPTIVE)})
        return np.asarray(canvas)

    def _corner(self, slot: int) -> tuple[int, int]:
        return slot % 4 * self._side, slot // 4 * (self._side + self._strip)

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
