"""Made-up signals and a scene for the tests of spectra."""

from __future__ import annotations

from math import pi

import torch

from tsar.types import FrameletBatch, SampleBatch


def noise(*shape: int, seed: int = 0) -> torch.Tensor:
    return torch.randn(*shape, generator=torch.Generator().manual_seed(seed), dtype=torch.float64)


def flat_band(count: int, highest: int, seed: int) -> torch.Tensor:
    """A signal of unit amplitude and random phase at 1 … ``highest`` cycles."""
    place = torch.arange(count, dtype=torch.float64) / count
    phase = torch.rand(highest, generator=torch.Generator().manual_seed(seed), dtype=torch.float64)
    cycles = torch.arange(1, highest + 1, dtype=torch.float64)
    return torch.cos(2 * pi * (cycles[:, None] * place + phase[:, None])).sum(0)


def separable(side: int, frames: int, f_s: int, f_t: int) -> torch.Tensor:
    x, y, t = flat_band(side, f_s, 1), flat_band(side, f_s, 2), flat_band(frames, f_t, 3)
    return (t[:, None, None] * y[:, None] * x)[None]


def disk(batch: FrameletBatch) -> SampleBatch:
    """A disk that crosses the picture to the right, on a gradient."""
    x, y = batch.position.double().unbind(-1)
    inside = (x - 0.5 * batch.times).square() + (y - 0.5).square() < 0.01
    return SampleBatch((inside + 0.2 * y).float()[..., None].expand(*x.shape, 3))
