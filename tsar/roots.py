"""Roots that are the same on every processor, and a constant of one."""

from __future__ import annotations

import numpy as np
import torch
from jaxtyping import Float, Float64
from torch import Tensor

GOLDEN_2D = 0.7548776662466927, 0.5698402909980532
"""``1 / x`` and ``1 / x²`` of the golden ratio in two dimensions, the root of ``x³ = x + 1``: multiples of the pair,
modulo 1, are spread evenly over the unit square. Source: Roberts 2018, "The unreasonable effectiveness of quasirandom
sequences"."""

_NEWTON_STEPS = 5


def square_root(value: Float[Tensor, "*n"]) -> Float[Tensor, "*n"]:
    """Square roots on the CPU, correctly rounded as IEEE 754 demands; NaN below zero.

    ``torch.sqrt`` is not used: its library gets the last bit of some roots wrong (one in five on an AMD EPYC), and
    which ones depends on the processor.
    """
    with np.errstate(invalid="ignore"):
        return torch.as_tensor(np.sqrt(value.numpy()))


def cube_root(value: Float64[Tensor, "*n"]) -> Float64[Tensor, "*n"]:
    """Cube roots of positive numbers, to a few units in the last place, by Newton's method on ``x = m 2^(3k)``, which
    uses only sums, products and quotients."""
    _, exponent = np.frexp(value.numpy())
    third = exponent // 3
    part = np.ldexp(value.numpy(), -3 * third)  # in [1/2, 4)
    root = 0.7 + 0.25 * part
    for _ in range(_NEWTON_STEPS):
        root = root - (root - part / (root * root)) / 3.0
    return torch.as_tensor(np.ldexp(root, third))


def encoded(color: Float[Tensor, "*n"]) -> Float[Tensor, "*n"]:
    """Linear radiance on a scale on which equal differences look about equal: ``sqrt(clip(c, 0, 1))``."""
    return square_root(color.clamp(0.0, 1.0))
