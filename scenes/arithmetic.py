"""Functions that give the same bits on every x86-64 processor.

NumPy, PyTorch, BLAS and the C library select code by the instructions of the processor, and the variants round
differently. The functions here add, multiply, divide and take roots in a fixed order, with the rounding of IEEE 754.
Other functions are evaluated with the 64 bits of precision of ``long double``, which vector units lack, and rounded to
the 53 bits of float64. Where ``long double`` is another type, results agree up to rounding.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import sparray
from scipy.spatial.transform import Rotation

Array = NDArray[np.float64]


def _rounded(function: Callable[..., Any], *values: ArrayLike) -> Any:
    return function(*(np.asarray(value, np.longdouble) for value in values)).astype(np.float64)


sin = partial(_rounded, np.sin)
"""Sine of an angle, radians. This function and those below take numbers or arrays and return float64."""

cos = partial(_rounded, np.cos)
"""Cosine of an angle, radians."""

tan = partial(_rounded, np.tan)
"""Tangent of an angle, radians."""

arcsin = partial(_rounded, np.arcsin)
"""Angle of a sine, radians."""

arccos = partial(_rounded, np.arccos)
"""Angle of a cosine, radians."""

arctan = partial(_rounded, np.arctan)
"""Angle of a tangent, radians."""

arctan2 = partial(_rounded, np.arctan2)
"""Angle of a point, radians; takes ``y``, then ``x``."""

exp = partial(_rounded, np.exp)
"""Exponential function."""

expm1 = partial(_rounded, np.expm1)
"""Exponential function minus one."""

log = partial(_rounded, np.log)
"""Natural logarithm."""

log1p = partial(_rounded, np.log1p)
"""Natural logarithm of one plus the number."""

power = partial(_rounded, np.power)
"""A base raised to an exponent."""

hypot = partial(_rounded, np.hypot)
"""Distance of a point ``x``, ``y`` from the origin."""


def norm(vector: ArrayLike) -> float:
    """Length of one vector."""
    return float(np.sqrt(product(vector, vector)))


def product(first: ArrayLike, second: ArrayLike) -> Any:
    """The product ``first @ second``, summed from the first term to the last.

    Args:
        first: ``(..., m, k)`` or ``(k,)``.
        second: ``(..., k, n)`` or ``(k,)``.
    """
    a, b = np.asarray(first), np.asarray(second)
    if a.shape == b.shape == (4, 4):  # the same sums, with one multiplication for all terms
        # over an axis that is not the last, terms are added one by one; the sum of zeros keeps its sign
        return (a[:, :, None] * b).sum(axis=1, initial=-0.0)
    rows, columns = a[None] if a.ndim == 1 else a, b[:, None] if b.ndim == 1 else b
    total = rows[..., :1] * columns[..., :1, :]
    for k in range(1, rows.shape[-1]):
        total = total + rows[..., k : k + 1] * columns[..., k : k + 1, :]
    if a.ndim == 1:
        total = total[..., 0, :]
    return total[..., 0][()] if b.ndim == 1 else total


def products(*matrices: ArrayLike) -> Any:
    """The :func:`product` of several matrices, from the left."""
    total = matrices[0]
    for matrix in matrices[1:]:
        total = product(total, matrix)
    return total


def weighted(weights: sparray, values: Any) -> Any:
    """The product of a sparse matrix and another matrix or sparse matrix. SciPy adds in the order of the entries, one
    after another."""
    return weights @ values


def determinant(matrix: Array) -> float:
    """Determinant of the first three rows and columns of a matrix, which is the factor by which it scales volumes."""
    (a, b, c), (d, e, f), (g, h, i) = matrix[:3, :3].tolist()
    return a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g)


def inverse(matrix: ArrayLike) -> Array:
    """Inverse of a matrix ``(n, n)`` by Gaussian elimination with partial pivoting.

    Raises:
        numpy.linalg.LinAlgError: the matrix is singular.
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


def affine(matrix: Array) -> Array | None:
    """The transform ``(4, 4)`` with the last row 0 0 0 1 that moves points alike, or None if there is none, as with a
    perspective. Last rows that are off by rounding, or have another scale, are made exact."""
    scale, slant = float(matrix[3, 3]), float(np.abs(matrix[3, :3]).max())
    if matrix[3].tolist() == [0.0, 0.0, 0.0, 1.0]:
        return matrix
    if not abs(scale) > 1e-30 or not slant <= 1e-9 * abs(scale):
        return None
    found = matrix / scale
    found[3] = 0.0, 0.0, 0.0, 1.0
    return found


def rotation_about(axis: ArrayLike, angle: ArrayLike) -> Rotation:
    """Rotations about a unit axis ``(3,)``, counter-clockwise seen from its tip, by one angle or ``(n,)`` angles,
    radians."""
    half = np.asarray(angle, np.float64) / 2.0
    sine, cosine = np.asarray(sin(half)), np.asarray(cos(half))
    return Rotation.from_quat(np.concatenate([sine[..., None] * np.asarray(axis), cosine[..., None]], axis=-1))


def rotation_between(first: Array, second: Array, fraction: ArrayLike) -> Rotation:
    """Spherical linear interpolation between unit quaternions ``(..., 4)`` along the shorter arc.

    Args:
        first, second: ``(x, y, z, w)``.
        fraction: ``(...,)`` fraction of the arc from the first to the second.
    """
    share = np.asarray(fraction, np.float64)[..., None]
    cosine = (first * second).sum(axis=-1, keepdims=True)
    second = np.where(cosine < 0.0, -second, second)
    # from the chord, which is well conditioned for close quaternions, unlike an arc cosine
    chord = np.linalg.norm(second - first, axis=-1, keepdims=True)
    angle = 2.0 * np.asarray(arcsin(np.minimum(chord / 2.0, 1.0)))
    sine = np.asarray(sin(angle))
    apart = sine > 1e-9
    sine = np.where(apart, sine, 1.0)
    a = np.where(apart, np.asarray(sin((1.0 - share) * angle)) / sine, 1.0 - share)
    b = np.where(apart, np.asarray(sin(share * angle)) / sine, share)
    return Rotation.from_quat(a * first + b * second)
