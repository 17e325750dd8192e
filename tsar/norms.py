"""Norms of the error estimate: the power of a part of a framelet, from the wavelet coefficients within it.

A norm is a function ``(squared, repeat) -> power``. ``squared`` is ``(c, n, p)``: the squared coefficients of three
octants, of ``n`` framelets in ``p`` equal parts; a part holds ``c`` of them. Where the parts are smaller than the
extent of a coefficient, ``c`` is 3 and ``repeat`` parts share the coefficient; otherwise ``repeat`` is 1. ``power`` is
``(n, p)``: the power of each part, at least 0, and above 0 where one of the coefficients is.

Source: Stephens 2011, sec. 5.3.2.
"""

from __future__ import annotations

from jaxtyping import Float
from torch import Tensor


def total_power(squared: Float[Tensor, "c n p"], repeat: int) -> Float[Tensor, "n p"]:
    """The sum of the squares (l2); parts that share a coefficient take equal shares of it."""
    return squared.sum(0) / repeat


def greatest_power(squared: Float[Tensor, "c n p"], repeat: int) -> Float[Tensor, "n p"]:
    """The greatest square (l-infinity); parts that share a coefficient each take all of it."""
    return squared.amax(0)
