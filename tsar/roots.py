"""Square roots that are the same on every processor."""

from __future__ import annotations

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor


def square_root(value: Float[Tensor, "*n"]) -> Float[Tensor, "*n"]:
    """Square roots on the CPU, correctly rounded as IEEE 754 demands; NaN below zero.

    ``torch.sqrt`` does not serve: the library behind it misses the last bit of some roots (one in five on an AMD EPYC),
    and which ones these are depends on the processor.
    """
    with np.errstate(invalid="ignore"):
        return torch.as_tensor(np.sqrt(value.numpy()))


def encoded(color: Float[Tensor, "*n"]) -> Float[Tensor, "*n"]:
    """Linear radiance to a scale on which equal differences look about equal: the root of what is clipped to [0, 1]."""
    return square_root(color.clamp(0.0, 1.0))
