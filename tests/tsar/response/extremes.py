"""Fields at the ends of their ranges: densities at their least and greatest, errors one-sided, nearly axis-aligned and
over all that float32 holds."""

from __future__ import annotations

from itertools import product

import torch
from torch import Tensor

SMALLEST = 2.0**-149
"""The least positive float32."""
ULP = 2.0**-24
"""Beside a number, a step of float32: a mixture along an axis and one step from it."""


def densities(count: int, low_s: float, high_s: float, low_t: float, high_t: float) -> dict[str, tuple[Tensor, Tensor]]:
    """Spatial and temporal density, by name: all at an end, one element at the other end, and decades between."""
    g = torch.Generator().manual_seed(7)

    def one(base: float, other: float) -> Tensor:
        field = torch.full((count,), base, dtype=torch.float64)
        field[count // 3] = other
        return field

    found = {}
    for s, t in product((0, 1), repeat=2):
        ends_s, ends_t = (low_s, high_s)[:: 1 - 2 * s], (low_t, high_t)[:: 1 - 2 * t]
        name = f"{('least', 'greatest')[s]} space, {('least', 'greatest')[t]} time"
        found[name] = one(ends_s[0], ends_s[0]), one(ends_t[0], ends_t[0])
        found[f"{name}, but one"] = one(*ends_s), one(*ends_t)
    share = torch.rand(2, count, generator=g, dtype=torch.float64)
    found["decades"] = low_s * (high_s / low_s) ** share[0], low_t * (high_t / low_t) ** share[1]
    return found


def errors(count: int) -> dict[str, Tensor]:
    """Spatial and temporal error ``(2, count)`` float32, by name."""
    g = torch.Generator().manual_seed(8)
    noise = 2.0 * torch.rand(2, count, generator=g) - 1.0
    ones, sign = torch.ones(2, count), torch.where(noise > 0, 1.0, -1.0)
    lone = -ones
    lone[:, count // 3] = 1.0
    found = {
        "none": 0.0 * ones,
        "all ask": ones,
        "all free": -ones,
        "space for time": torch.stack((ones[0], -ones[0])),
        "time for space": torch.stack((-ones[0], ones[0])),
        "one-sided": noise.abs(),
        "one-sided, free": -noise.abs(),
        "mixed": noise,
        "one asks": lone,
        "one frees": -lone,
        "decades": sign * 10.0 ** (-45.0 * torch.rand(2, count, generator=g)),
    }
    for axis, name in enumerate(("space", "time")):
        along = torch.zeros(2, count)
        along[axis] = noise[axis]
        found[f"along {name}"] = along
        for how, step in (("a step", ULP * noise[axis]), ("next to nothing", SMALLEST * ones[0])):
            beside = along.clone()
            beside[1 - axis] = sign[1 - axis] * step
            found[f"{how} from {name}"] = beside
    return found
