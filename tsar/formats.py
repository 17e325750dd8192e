"""Rounding of numbers to formats of fewer bits."""

from __future__ import annotations

import torch
from torch import Tensor

from tsar.checks import require
from tsar.roots import square_root

NUMBER_FORMATS = ("float64", "float32", "bfloat16", "float16", "float8", "unorm8")
"""``float8`` has five bits of exponent and two of mantissa; ``unorm8`` has 256 equal steps of the square root of values
in [0, 1.5], for colours, which are clipped to that range."""
UNORM_MAX = 1.5
_STEPS = 255.0
_KINDS = {
    "float64": torch.float64,
    "float32": torch.float32,
    "bfloat16": torch.bfloat16,
    "float16": torch.float16,
    "float8": torch.float8_e5m2,
}


def rounded(values: Tensor, form: str) -> Tensor:
    """Values rounded to a format. The result has the type of the values, or float64 where that is the format.

    Finite values beyond the range of the format become its greatest value; infinities and NaN stay.

    Raises:
        ConfigError: the format is not one of :data:`NUMBER_FORMATS`.
    """
    require(form in NUMBER_FORMATS, "format", f"one of {', '.join(NUMBER_FORMATS)}", form)
    if form == "float64":
        return values.to(torch.float64)
    if form == "unorm8":
        share = square_root((values / UNORM_MAX).clamp(0.0, 1.0))
        held = ((share * _STEPS).round() / _STEPS).square() * UNORM_MAX
    else:
        kind = _KINDS[form]
        most = torch.finfo(kind).max
        held = values.clamp(-most, most).to(kind).to(values.dtype)
    return torch.where(values.isfinite(), held, values)
