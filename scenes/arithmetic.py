"""Functions whose last bit is not up to the processor.

NumPy, PyTorch, BLAS and the system's library choose code by the instructions that a processor has, and each rounds in
its own way. What is here adds, multiplies, divides and takes roots one after the other, as IEEE 754 rounds them; other
functions are evaluated with 64 bits of precision, which no vector unit has, and rounded to the 53 of float64. That is
so on x86-64; where ``long double`` is another type, results agree up to rounding.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation

Array = NDArray[np.float64]


def _rounded(function: Callable[..., Any], *values: ArrayLike) -> Any:
    return function(*(np.asarray(value, np.longdouble) for value in values)).astype(np.float64)


def sin(x: ArrayLike) -> Any:
    """Sine, of numbers or arrays in radians; as all that follow, float64."""
    return _rounded(np.sin, x)


def cos(x: ArrayLike) -> Any:
    """Cosine."""
    return _rounded(np.cos, x)


def tan(x: ArrayLike) -> Any:
    """Tangent."""
    return _rounded(np.tan, x)


def arcsin(x: ArrayLike) -> Any:
    """Angle of a sine, radians."""
    return _rounded(np.arcsin, x)


def arccos(x: ArrayLike) -> Any:
    """Angle of a cosine, radians."""
    return _rounded(np.arccos, x)


def arctan(x: ArrayLike) -> Any:
    """Angle of a tangent, radians."""
    return _rounded(np.arctan, x)


def arctan2(y: ArrayLike, x: ArrayLike) -> Any:
    """Angle of the point ``(x, y)``, radians."""
    return _rounded(np.arctan2, y, x)


def exp(x: ArrayLike) -> Any:
    """Exponential function."""
    return _rounded(np.exp, x)


def log(x: ArrayLike) -> Any:
    """Natural logarithm."""
    return _rounded(np.log, x)


def log1p(x: ArrayLike) -> Any:
    """Natural logarithm of ``1 + x``."""
    return _rounded(np.log1p, x)


def expm1(x: ArrayLike) -> Any:
    """Exponential function, less one."""
    return _rounded(np.expm1, x)


def power(base: ArrayLike, exponent: ArrayLike) -> Any:
    """``base`` to the power of ``exponent``."""
    return _rounded(np.power, base, exponent)


def hypot(x: ArrayLike, y: ArrayLike) -> Any:
    """Distance of ``(x, y)`` from the origin."""
    return _rounded(np.hypot, x, y)


def norm(vector: ArrayLike) -> float:
    """Length of one vector."""
    return float(np.sqrt(product(vector, vector)))


def product(first: ArrayLike, second: ArrayLike) -> Any:
    """What ``first @ second`` means, summed from the first term to the last.

    Args:
        first: ``(..., m, k)`` or ``(k,)``.
        second: ``(..., k, n)`` or ``(k,)``.
    """
    a, b = np.asarray(first), np.asarray(second)
    rows, columns = a[None] if a.ndim == 1 else a, b[:, None] if b.ndim == 1 else b
    total = rows[..., :1] * columns[..., :1, :]
    for k in range(1, rows.shape[-1]):
        total = total + rows[..., k : k + 1] * columns[..., k : k + 1, :]
    if a.ndim == 1:
        total = total[..., 0, :]
    return total[..., 0][()] if b.ndim == 1 else total


def products(*matrices: ArrayLike) -> Any:
    """The :func:`product` of several, from the left."""
    total = matrices[0]
    for matrix in matrices[1:]:
        total = product(total, matrix)
    return total


def inverse(matrix: ArrayLike) -> Array:
    """Inverse of a matrix ``(n, n)`` by elimination, with the greatest pivots of each column.

    Raises:
        numpy.linalg.LinAlgError: it has none.
    """
    rows = np.array(matrix, np.float64)
    size = len(rows)
    rows = np.concatenate([rows, np.eye(size)], axis=1)
    for k in range(size):
        pivot = k + int(np.argmax(np.abs(rows[k:, k])))
        if rows[pivot, k] == 0.0:
            raise np.linalg.LinAlgError("Singular matrix")
        rows[[k, pivot]] = rows[[pivot, k]]
        rows[k] = rows[k] / rows[k, k]
        others = np.arange(size) != k
        rows[others] = rows[others] - rows[others, k : k + 1] * rows[k]
    return rows[:, size:]


def rotation_about(axis: ArrayLike, angle: ArrayLike) -> Rotation:
    """Turns about a unit axis ``(3,)``, counter-clockwise seen from its tip, by one or ``(n,)`` angles, radians."""
    half = np.asarray(angle, np.float64) / 2.0
    sine, cosine = np.asarray(sin(half)), np.asarray(cos(half))
    return Rotation.from_quat(np.concatenate([sine[..., None] * np.asarray(axis), cosine[..., None]], axis=-1))


def rotation_between(first: Array, second: Array, fraction: ArrayLike) -> Rotation:
    """Spherical interpolation between unit quaternions ``(..., 4)``, the shorter way.

    Args:
        first, second: ``(x, y, z, w)``.
        fraction: of the way from the first to the second, ``(...,)``.
    """
    share = np.asarray(fraction, np.float64)[..., None]
    cosine = (first * second).sum(axis=-1, keepdims=True)
    second = np.where(cosine < 0.0, -second, second)
    # by the chord: well conditioned for near ones, where an arc cosine is not
    chord = np.linalg.norm(second - first, axis=-1, keepdims=True)
    angle = 2.0 * np.asarray(arcsin(np.minimum(chord / 2.0, 1.0)))
    sine = np.asarray(sin(angle))
    apart = sine > 1e-9
    sine = np.where(apart, sine, 1.0)
    a = np.where(apart, np.asarray(sin((1.0 - share) * angle)) / sine, 1.0 - share)
    b = np.where(apart, np.asarray(sin(share * angle)) / sine, share)
    return Rotation.from_quat(a * first + b * second)
