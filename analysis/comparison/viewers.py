"""What is made of a comparison as it goes by: the film, and the pictures that the page shows."""

from __future__ import annotations

from dataclasses import dataclass, field

from analysis.metrics.quality import View
from analysis.page.pictures import webp_bytes
from analysis.page.player import Step
from analysis.page.video import ComparisonFilm, FrameSink, Scales, maps, photographs

STEPS_MAX = 60
"""Positions of the slider in the report at most."""
STEP_PX = 256
"""Width of the pictures in the report."""


@dataclass
class Steps:
    """Keeps pictures of evenly spaced times for the page: every k-th, with the least k that keeps to ``most``.

    Changes in place.

    Attributes:
        own: the run whose decisions are shown.
        scales: bounds of the colour scales.
        count: how many reference times there will be.
        made: the pictures.
    """

    own: str
    scales: Scales
    count: int
    most: int = STEPS_MAX
    made: list[Step] = field(default_factory=list)

    def __call__(self, view: View) -> None:
        if view.number % -(-self.count // self.most) == 0:
            # encoded at once: the pixels of all steps together would take as much memory as the run
            pictures: dict[str, bytes | None] = {
                label: webp_bytes(pixels, lossless=False) for label, pixels in photographs(view, STEP_PX).items()
            }
            for label, pixels in maps(view, self.own, self.scales, STEP_PX).items():
                pictures[label] = None if pixels is None else webp_bytes(pixels, lossless=True)
            self.made.append(Step(view.number, pictures))


@dataclass
class Filming:
    """Sends a frame of the film to a sink every so many reference times. Changes in place.

    Attributes:
        film: composes frames.
        sink: where they go.
        stride: reference times from one frame to the next.
    """

    film: ComparisonFilm
    sink: FrameSink
    stride: int = 1
    _times_s: list[float] = field(default_factory=list)
    _errors: dict[str, list[float]] = field(default_factory=dict)

    def __call__(self, view: View) -> None:
        self._times_s.append(view.time_s)
        for name, mse in view.mse.items():
            self._errors.setdefault(name, []).append(mse)
        if view.number % self.stride == 0:
            self.sink.add(self.film.frame(view, self._times_s, self._errors))
