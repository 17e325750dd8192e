"""Norms of the error estimate: the power that a position gets of the wavelet coefficients that cover it.

A norm is a function ``(squared, repeat) -> power``. ``squared`` is ``(3, n, p)``: the squared coefficients of three
octants, of ``n`` framelets at ``p`` positions. Each coefficient covers ``repeat`` positions of the finest octave.
``power`` is ``(n, p)``: what each of those positions gets, at least 0, and above 0 where one of the three is.

Source: Stephens 2011, sec. 5.3.2.
"""

from __future__ import annotations

from jaxtyping import Float
from torch import Tensor


def total_power(squared: Float[Tensor, "3 n p"], repeat: int) -> Float[Tensor, "n p"]:
    """The sum over the octants, shared equally by the positions (l2)."""
    return squared.sum(0) / repeat


def greatest_power(squared: Float[Tensor, "3 n p"], repeat: int) -> Float[Tensor, "n p"]:
    """The greatest of the octants, whole at every position (l-infinity)."""
    return squared.amax(0)
