"""What a display shows, measured at every reference time as it goes by."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import torch
from torch import Tensor

from analysis.cases import Case
from analysis.causes import CAUSES, REGIONS, Split, Truths, flicker, split
from analysis.perceptual import flip, ssim
from analysis.pictures import Pixels, tiling_image
from analysis.quality import Hold, encode, pixel_errors, reference_times
from tsar.types import Display, StepRecord

Shown = tuple[StepRecord | None, Display]
"""A record, where the policy makes any, and its image."""

Keep = Callable[[int, dict[str, Pixels]], None]
"""Takes the number of a still and its pictures by name: shown, reference, and tiling where there is one."""

_MOTION_S = 0.1  # motion is judged over this long


class Seen:
    """What the display showed, measured. Changes in place."""

    def __init__(self) -> None:
        self.rows: list[dict[str, Any]] = []
        self.splits: list[Split] = []
        self.frames: tuple[list[Pixels], list[Pixels]] = ([], [])
        self.images, self.nonfinite = 0, 0

    def regions(self) -> dict[str, dict[str, float]]:
        """Mean over the times of each cause in each region, as a part of the whole error, and the region's share; times
        count by the pixels whose truth is known."""
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


def observe(
    case: Case,
    truths: Truths,
    displays: Iterator[Shown],
    keep: Keep,
) -> Seen:
    scale, seen, hold = case.scale, Seen(), Hold(displays)
    times = reference_times(case.start_s, case.start_s + scale.seconds, scale.reference_rate_hz)
    stills = {min(round(at * scale.reference_rate_hz), len(times) - 1): k for k, at in enumerate(case.stills_s)}
    step = max(1, round(_MOTION_S * scale.reference_rate_hz))
    scored = [round(at * scale.reference_rate_hz) for at in case.jod_span_s or (0.0, 0.0)]
    before: tuple[Any, Any] | None = None
    for number, time_s in enumerate(times.tolist()):
        record, display = hold.at(time_s)
        truth = truths.image(number)
        errors = pixel_errors(display.image, truth)
        image = display.image.nan_to_num(nan=0.0, posinf=0.0, neginf=0.0)
        shown, wanted = encode(image), encode(truth)
        row = {"time_s": time_s, "mse": errors.mse, "log_mse": errors.log_mse, "refresh": len(hold.refresh_s)}
        row["flicker"] = flicker(shown - wanted, before[0], wanted, before[1]) if before else np.nan
        before = shown - wanted, wanted
        if number % scale.stride == 0:
            row |= {"ssim": ssim(shown, wanted), "flip": flip(shown, wanted)}
            if display.samples is not None:
                found = split(image, display.samples, number, truths, case.tsar.framelet_side, step)
                seen.splits.append(found)
                row |= {**found.causes, "causes_mse": found.mse} if found.known else {}
                row["causes_known"] = found.known
        if scored[0] <= number < scored[1]:
            for kept, one in zip(seen.frames, (shown, wanted), strict=True):
                kept.append((one * 255.0 + 0.5).to(torch.uint8).numpy())
        if number in stills:
            keep(stills[number], _pictures(case, shown, wanted, record))
        seen.nonfinite += errors.nonfinite
        seen.rows.append(row)
    seen.images = len(hold.refresh_s)
    return seen


def _pictures(case: Case, shown: Tensor, wanted: Tensor, record: StepRecord | None) -> dict[str, Pixels]:
    encoded = {"shown": shown, "reference": wanted}
    pictures = {name: (image * 255.0 + 0.5).to(torch.uint8).numpy() for name, image in encoded.items()}
    if record is not None:
        side = max(256, case.tsar.resolution_px)
        pictures["tiling"] = tiling_image(record.tiling, record.densities.temporal, side, case.tsar.temporal_bounds)
    return pictures
