"""Small records, tilings and views for the tests of the analysis."""

from __future__ import annotations

import io
from typing import Any

import numpy as np
import torch
from PIL import Image

from analysis.metrics.quality import DisplayedImages
from analysis.page.pictures import PagePixels
from analysis.page.video import Scales
from analysis.storage.records import RecordLimits
from tsar.types import Densities, Errors, SampleMap, ShownImage, StepRecord, Tiling

SPATIAL, TEMPORAL = (0.25, 64.0), (1 / 64, 1.0)
SCALES = Scales(SPATIAL, TEMPORAL)
LIMITS = RecordLimits(batch_size=4, budget=1000.0, density_spatial=SPATIAL, density_temporal=TEMPORAL)
ELEMENTS = 64


def tiling(*tiles: tuple[int, int]) -> Tiling:
    """Tiles from pairs of level and Morton index."""
    pairs = torch.tensor(tiles, dtype=torch.int64).reshape(-1, 2)
    return Tiling(pairs[:, 0].clone(), pairs[:, 1].clone())


def random_tiling(seed: int, level_max: int = 4, chance: float = 0.5) -> Tiling:
    """A cover of the image by random splits, at least four tiles, in random order."""
    rng = np.random.default_rng(seed)
    waiting, done = [(1, index) for index in range(4)], []
    while waiting:
        level, index = waiting.pop()
        if level < level_max and rng.random() < chance:
            waiting += [(level + 1, 4 * index + child) for child in range(4)]
        else:
            done.append((level, index))
    return tiling(*(done[i] for i in rng.permutation(len(done))))


def good_record(seed: int = 0, **changes: Any) -> StepRecord:
    """A cycle that keeps to LIMITS; densities that are given are balanced by the surplus."""
    rng = np.random.default_rng(seed)
    spatial = changes.pop("spatial", torch.from_numpy(np.exp(rng.uniform(*np.log(SPATIAL), ELEMENTS))))
    temporal = changes.pop("temporal", torch.from_numpy(np.exp(rng.uniform(*np.log(TEMPORAL), ELEMENTS))))
    surplus = LIMITS.budget - float((spatial * temporal).sum())
    tiles = changes.pop("tiling", random_tiling(seed))
    values: dict[str, Any] = {
        "cycle": seed,
        "sim_time_s": 0.01 * seed,
        "cost_s": 0.01,
        "tiling": tiles,
        "selected": torch.from_numpy(rng.permutation(4)),
        "densities": Densities(spatial, temporal, surplus),
        "errors": Errors(torch.full((ELEMENTS,), 0.5), torch.full((ELEMENTS,), -0.25)),
        "surplus": surplus,
        "conservation_residual": 1e-12,
        "stage_s": {"tracing": 0.5, "error": 0.25},
        "counters": {"primary_rays": 1024, "shadow_rays": 10},
        "nonfinite": 0,
        "age_spread_s": 0.125,
    }
    return StepRecord(**{**values, **changes})


def grey(value: float, side: int = 8) -> torch.Tensor:
    """A linear image of one value."""
    return torch.full((side, side, 3), value)


def view(
    time_s: float = 0.0, reference: float = 0.0, own: float = 1.0, framed: float = 0.5, number: int = 0
) -> DisplayedImages:
    """Plain images of two runs, the first over a uniform tiling and fields, of samples 0.125 s old."""
    densities = Densities(*torch.tensor([[1.0], [0.5]], dtype=torch.float64).expand(2, ELEMENTS))
    record = good_record(densities=densities, tiling=tiling(*((1, i) for i in range(4))))
    newest_s = torch.full((2, 2), time_s - 0.125, dtype=torch.float64)
    ages = SampleMap(newest_s, torch.zeros(2, 2, dtype=torch.int64))
    displays = ShownImage(time_s, time_s, grey(own), ages), ShownImage(time_s, 0.0, grey(framed))
    shown = {"own": (record, displays[0]), "framed": (None, displays[1])}
    return DisplayedImages(number, time_s, grey(reference), shown, {"own": 0.1, "framed": 0.2})


def png_bytes(pixels: PagePixels) -> bytes:
    """An array ``(h, w, 3)`` uint8 as PNG."""
    buffer = io.BytesIO()
    Image.fromarray(pixels).save(buffer, format="PNG", optimize=True)
    return buffer.getvalue()


class Sink:
    """Keeps frames."""

    def __init__(self) -> None:
        self.frames: list[np.ndarray] = []

    def add(self, pixels: np.ndarray) -> None:
        self.frames.append(pixels)
