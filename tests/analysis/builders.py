"""Small records, tilings and views for the tests of the analysis."""

from __future__ import annotations

from typing import Any

import numpy as np
import torch

from analysis.records import RecordLimits
from analysis.video import Scales, View
from tsar.types import Densities, Errors, StepRecord, Tiling

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


def view(time_s: float = 0.0, reference: float = 0.0, framed: float = 0.5, adaptive: float = 1.0) -> View:
    """Plain images over a uniform tiling and fields, of samples 0.125 s old."""
    densities = Densities(*torch.tensor([[1.0], [0.5]], dtype=torch.float64).expand(2, ELEMENTS))
    tiles, newest_s = tiling(*((1, i) for i in range(4))), torch.full((2, 2), time_s - 0.125, dtype=torch.float64)
    return View(time_s, grey(reference), grey(framed), grey(adaptive), tiles, densities, newest_s)
