"""Errors of the images on all displays at every reference time: the one engine that compares runs with a reference.

All runs advance together, and two images of each are held at a time, however long the runs are.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from analysis.metrics import METRICS
from analysis.metrics.arrays import Floats
from analysis.metrics.causes import CAUSES, REGIONS, Split, Truths, flicker, split
from analysis.metrics.quality import DisplayedImages, Hold, Shown, encode, pixel_errors
from analysis.page.pictures import PagePixels
from tsar.policies.resampling import widened
from tsar.types import ShownImage

_MOTION_S = 0.1  # seconds over which motion is judged


Viewer = Callable[[DisplayedImages], None]


@dataclass(frozen=True)
class Measuring:
    """The measurements beside both mean squared errors.

    Attributes:
        metrics: names of image metrics, each taken at every ``stride``-th reference time.
        stride: interval, in reference times, at which they are taken.
        causes: whether the causes of the error are measured at the same times, and its flicker at all times.
        framelet_side: samples along a framelet's side, for the causes.
        kept: indices of the first and the end of the reference times whose encoded images are kept for metrics of
            sequences.
    """

    metrics: tuple[str, ...] = ()
    stride: int = 1
    causes: bool = False
    framelet_side: int = 16
    kept: tuple[int, int] = (0, 0)


@dataclass
class DisplayRecord:
    """The measurements of one display. Changes in place.

    Attributes:
        rows: a line for each reference time: ``time_s``, ``mse``, ``log_mse``, the number of images shown so far, and
            metrics.
        refresh_s: display times of the images that have been shown, seconds.
        nonfinite: number of non-finite values in all images shown.
        splits: causes of the error.
        frames: kept encoded images of the display and of the reference.
    """

    rows: list[dict[str, Any]] = field(default_factory=list)
    refresh_s: list[float] = field(default_factory=list)
    nonfinite: int = 0
    splits: list[Split] = field(default_factory=list)
    frames: tuple[list[PagePixels], list[PagePixels]] = field(default_factory=lambda: ([], []))

    @property
    def images(self) -> int:
        """Number of images that have been shown."""
        return len(self.refresh_s)

    def column(self, name: str) -> Floats:
        """A column, one value for each reference time; NaN where it was not measured."""
        return np.array([row.get(name, np.nan) for row in self.rows], np.float64)

    def regions(self) -> dict[str, dict[str, float]]:
        """Mean over time of each cause in each region, as a part of the whole error, and of the region's share; times
        are weighted by the number of pixels whose truth is known."""
        weight = [found.known for found in self.splits]
        if not sum(weight):
            return {}

        def mean(values: list[float]) -> float:
            return float(np.average(values, weights=weight))

        return {
            region: {cause: mean([found.regions[region][cause] for found in self.splits]) for cause in CAUSES}
            | {"share": mean([found.share[region] for found in self.splits])}
            for region in REGIONS
        }


def enlarged(images: Iterable[Shown], side: int) -> Iterator[Shown]:
    """Pictures on a square display of ``side`` pixels, enlarged bilinearly if they are smaller.

    Raises:
        ValueError: the side is not a multiple of that of the pictures.
    """
    for record, shown in images:
        own = shown.image.shape[0]
        if own != side:
            if side % own:
                raise ValueError(f"display: expected a multiple of {own} pixels, got {side}")
            across = widened(shown.image.permute(2, 0, 1), side // own)
            image = widened(across.transpose(1, 2), side // own).permute(2, 1, 0).contiguous()
            shown = replace(shown, image=image, sample_map=None, maps={}, carried=None)
        yield record, shown


def watch(
    runs: Mapping[str, Iterable[Shown]],
    truths: Truths,
    times_s: NDArray[np.float64],
    measuring: Measuring,
    viewers: Sequence[Viewer] = (),
) -> dict[str, DisplayRecord]:
    """Measures the image on each display at every reference time.

    Args:
        runs: streams of images by name.
        truths: reference images.
        times_s: reference times, seconds.
        measuring: the measurements.
        viewers: each is called at every reference time with the images on all displays.

    Raises:
        ValueError: no image is shown yet at the first time.
    """
    holds = {name: Hold(run) for name, run in runs.items()}
    watchers = {name: _Watcher(truths, times_s, measuring, hold) for name, hold in holds.items()}
    for number, time_s in enumerate(times_s.tolist()):
        truth = truths.image(number)
        wanted = encode(truth)
        shown = {name: hold.at(time_s) for name, hold in holds.items()}
        mse = {name: watchers[name].measure(number, display, truth, wanted) for name, (_, display) in shown.items()}
        view = DisplayedImages(number, time_s, truth, shown, mse)
        for viewer in viewers:
            viewer(view)
    return {name: watcher.seen for name, watcher in watchers.items()}


class _Watcher:
    """Measures one display. Changes in place."""

    def __init__(self, truths: Truths, times_s: Floats, measuring: Measuring, hold: Hold) -> None:
        self.seen = DisplayRecord(refresh_s=hold.refresh_s)
        self._truths, self._times_s, self._measuring = truths, times_s, measuring
        self._before: tuple[Tensor, Tensor] | None = None
        self._hold = hold
        rate_hz = 1.0 / (times_s[1] - times_s[0]) if len(times_s) > 1 else 0.0
        self._step = max(1, round(_MOTION_S * rate_hz))

    def measure(self, number: int, display: ShownImage, truth: Tensor, wanted: Tensor) -> float:
        """Measures one reference time: the image shown, the linear and the encoded reference. Returns the MSE."""
        seen, asked = self.seen, self._measuring
        errors, shown = pixel_errors(display.image, truth, wanted)
        row = {"time_s": float(self._times_s[number]), "mse": errors.mse, "log_mse": errors.log_mse}
        row["refresh"] = seen.images
        if asked.causes:
            before = self._before
            row["flicker"] = flicker(shown - wanted, before[0], wanted, before[1]) if before else np.nan
            self._before = shown - wanted, wanted
        if number % asked.stride == 0:
            row |= {name: METRICS[name].of_image(shown, wanted) for name in asked.metrics}
            if asked.causes and display.sample_map is not None:
                row |= self._causes(number, display)
        if asked.kept[0] <= number < asked.kept[1]:
            for kept, one in zip(seen.frames, (shown, wanted), strict=True):
                kept.append((one * 255.0 + 0.5).to(torch.uint8).numpy())
        seen.nonfinite = self._hold.nonfinite
        seen.rows.append(row)
        return errors.mse

    def _causes(self, number: int, display: ShownImage) -> dict[str, float]:
        assert display.sample_map is not None
        image = display.image.nan_to_num(nan=0.0, posinf=0.0, neginf=0.0)
        found = split(image, display.sample_map, number, self._truths, self._measuring.framelet_side, self._step)
        self.seen.splits.append(found)
        known = {**found.causes, "causes_mse": found.mse} if found.known else {}
        return {**known, "causes_known": found.known}
