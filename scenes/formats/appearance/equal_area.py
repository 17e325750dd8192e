"""Equal-area environment maps: the sphere on a square, as in PBRT v4.

Source: Clarberg 2008, "Fast equal-area mapping of the (hemi)sphere using SIMD"; PBRT v4, infinite lights.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from scenes.arithmetic import arctan2, cos, sin

Image = NDArray[np.float32]
Numbers = NDArray[np.float64]
_ACROSS = 4  # number of samples of a texel along each axis


def direction_of_square(point: Numbers) -> Numbers:
    """Unit directions ``(n, 3)`` of points ``(n, 2)`` of the unit square; its centre is +z, its corners are -z.

    With ``a = |2x - 1|``, ``b = |2y - 1|``, ``d = 1 - a - b`` and ``r = 1 - |d|``: ``z`` is ``1 - r²`` with the sign of
    ``d``, and the azimuth within a quadrant ``π/4 ((b - a) / r + 1)``.
    """
    signed = 2.0 * point - 1.0
    a, b = np.abs(signed[:, 0]), np.abs(signed[:, 1])
    side = 1.0 - (a + b)
    r = 1.0 - np.abs(side)
    azimuth = 0.25 * np.pi * (np.divide(b - a, r, out=np.zeros_like(r), where=r > 0.0) + 1.0)
    z = np.copysign(1.0 - r * r, side)
    across = r * np.sqrt(np.maximum(2.0 - r * r, 0.0))
    x, y = np.copysign(cos(azimuth), signed[:, 0]), np.copysign(sin(azimuth), signed[:, 1])
    return np.stack([x * across, y * across, z], axis=1)


def square_of_direction(direction: Numbers) -> Numbers:
    """Points ``(n, 2)`` of the unit square for unit directions ``(n, 3)``; the inverse of
    :func:`direction_of_square`."""
    x, y, z = np.abs(direction).T
    r = np.sqrt(np.maximum(1.0 - z, 0.0))
    share = 2.0 / np.pi * arctan2(y, x)  # of the quadrant
    a, b = r * (1.0 - share), r * share
    below = direction[:, 2] < 0.0
    a, b = np.where(below, 1.0 - b, a), np.where(below, 1.0 - a, b)
    signed = np.copysign(a, direction[:, 0]), np.copysign(b, direction[:, 1])
    return 0.5 * np.stack(signed, axis=1) + 0.5


def latitude_longitude(square: Image) -> Image:
    """An equal-area map ``(n, n, 3)`` resampled to a latitude–longitude map ``(n, 2 n, 3)`` with z upwards.

    Azimuth runs from left to right from +x over +y, the polar angle from the top row (+z) down.
    """
    height, width = square.shape[0], 2 * square.shape[0]

    def color(u: Numbers, v: Numbers) -> Numbers:
        polar, azimuth = np.pi * v, 2.0 * np.pi * u
        parts = cos(azimuth) * sin(polar), sin(azimuth) * sin(polar), cos(polar)
        at = square_of_direction(np.stack(parts, axis=1))
        return _bilinear(square, at[:, 0], at[:, 1], wraps=False)

    return _sampled(height, width, color)


def equal_area(image: Image) -> Image:
    """The inverse of :func:`latitude_longitude`: ``(h, w, 3)`` resampled to ``(h, h, 3)``."""

    def color(x: Numbers, y: Numbers) -> Numbers:
        to = direction_of_square(np.stack([x, y], axis=1))
        across = np.sqrt(to[:, 0] ** 2 + to[:, 1] ** 2)
        u = arctan2(to[:, 1], to[:, 0]) / (2.0 * np.pi)
        return _bilinear(image, u - np.floor(u), arctan2(across, to[:, 2]) / np.pi, wraps=True)

    return _sampled(image.shape[0], image.shape[0], color)


def _sampled(height: int, width: int, color: Callable[[Numbers, Numbers], Numbers]) -> Image:
    """The mean of samples on a regular grid in each texel, row by row."""
    made = np.empty((height, width, 3), np.float32)
    steps = (np.arange(_ACROSS) + 0.5) / _ACROSS
    across = ((np.arange(width)[:, None] + steps) / width).ravel()
    for row in range(height):
        total = np.zeros((width, 3))
        for step in steps:
            found = color(across, np.full(len(across), (row + step) / height))
            total += found.reshape(width, _ACROSS, 3).sum(axis=1)
        made[row] = total / _ACROSS**2
    return made


def _bilinear(image: Image, u: Numbers, v: Numbers, wraps: bool) -> Numbers:
    """Colours ``(n, 3)`` at points measured from the left and the top; if the image wraps, the left edge joins the
    right one."""
    height, width = image.shape[:2]
    x, y = u * width - 0.5, np.clip(v * height - 0.5, 0.0, height - 1.0)
    if not wraps:
        x = np.clip(x, 0.0, width - 1.0)
    left, top = np.floor(x).astype(np.int64), np.floor(y).astype(np.int64)
    right, below = (x - left)[:, None], (y - top)[:, None]
    columns = (left % width, (left + 1) % width) if wraps else (left, np.minimum(left + 1, width - 1))
    rows = top, np.minimum(top + 1, height - 1)
    upper = (1.0 - right) * image[rows[0], columns[0]] + right * image[rows[0], columns[1]]
    lower = (1.0 - right) * image[rows[1], columns[0]] + right * image[rows[1], columns[1]]
    return (1.0 - below) * upper + below * lower
