"""A moment that is held, and compared with the truth."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from analysis.live.overlays import Key, codes
from analysis.metrics import METRICS
from analysis.metrics.quality import encode, pixel_errors
from analysis.page.pictures import PagePixels, palette
from tsar.types import LUMINANCE

if TYPE_CHECKING:
    from torch import Tensor

    from analysis.live.engine import Engine

TRUTH, SIGNED, SQUARED = "truth", "signed error", "squared error"
VIEWS = (TRUTH, SIGNED, SQUARED)
"""What a side can show in place of its picture while a moment is held."""
_SIGNED, _SQUARED = 0.25, (1e-5, 0.1)  # bounds of their colour scales
_PALETTES = {SIGNED: "RdBu_r", SQUARED: "inferno"}
KEYS = {
    SIGNED: Key("luminance of the error, −0.25 to 0.25", _PALETTES[SIGNED]),
    SQUARED: Key("sum over channels, 1e-5 to 0.1", _PALETTES[SQUARED]),
}
"""What their colours mean."""


@dataclass(frozen=True)
class Frozen:
    """A moment.

    Attributes:
        time_s: of the live view, seconds.
        pictures: of each side, and of the truth, linear RGB.
        errors: of each side, by name.
        names: of the policies then, by side.
        missing: metrics that were not taken, and why.
    """

    time_s: float
    pictures: Mapping[str, Tensor]
    errors: Mapping[str, Mapping[str, float]]
    names: Mapping[str, str]
    missing: tuple[str, ...]

    def drawn(self, side: str, view: str) -> PagePixels:
        """``(h, w, 3)`` uint8 of one of :data:`VIEWS`."""
        if view == TRUTH:
            return codes(self.pictures[TRUTH])
        apart = (encode(self.pictures[side]) - encode(self.pictures[TRUTH])).numpy()
        if view == SIGNED:
            share = (apart @ np.array(LUMINANCE) + _SIGNED) / (2 * _SIGNED)
            return palette(_PALETTES[SIGNED])[np.clip(share * 255.0 + 0.5, 0, 255).astype(np.int64)]
        low, high = np.log(_SQUARED)
        share = (np.log(np.maximum(np.square(apart).sum(axis=-1), _SQUARED[0])) - low) / (high - low)
        return palette(_PALETTES[SQUARED])[np.clip(share * 255.0 + 0.5, 0, 255).astype(np.int64)]


def held(engine: Engine) -> Frozen:
    """Holds the engine, renders the truth of this moment, and measures both sides against it."""
    engine.rest()
    look = engine.look()
    shown = {side: seen.shown[1].image for side, seen in look.sides.items() if seen is not None}
    truth = engine.truth()
    names = [name for name in METRICS if METRICS[name].image]
    missing = tuple(f"{name} (of sequences: replay a session)" for name in METRICS if name not in names)
    errors = {side: measured(image, truth, names) for side, image in shown.items() if image.shape == truth.shape}
    policies = {side: run.name for side, run in look.runs.items() if run is not None}
    return Frozen(look.time_s, {**shown, TRUTH: truth}, errors, policies, missing)


def measured(shown: Tensor, truth: Tensor, names: list[str]) -> dict[str, float]:
    """All errors of an image, by name: mean squares, and metrics of images."""
    found, encoded = pixel_errors(shown, truth)
    of_metrics: dict[str, Any] = {name: METRICS[name].of_image(encoded, encode(truth)) for name in names}
    return {"mse": found.mse, "log_mse": found.log_mse, **of_metrics}
