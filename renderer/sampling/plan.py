"""Positions of samples in pixels and times within the shutter's: shifts and warps of point sets.

The samples of a pixel are a point set (u, v, t) in the unit cube, shifted cyclically by an amount of the pixel's own
and then warped to the density of the reconstruction filter (filter importance sampling), so that their colours have
equal weights.

Source: motion-blur perception thesis, chapters 2 (filters) and 3 (shift, warps; figs 14 and 16).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Literal

import numpy as np
from jaxtyping import Float, Int
from numpy.typing import NDArray

from renderer.sampling.blue_noise import FRAMES, SIDE_PX, mask
from renderer.sampling.point_sets import GOLDEN, Points, mixed_words, point_set
from scenes.arithmetic import cos, log1p, sin
from tsar.config import closed_choices

# --- shifts ----------------------------------------------------------------------------------------------------------


def pixel_shift(
    seed: int, column: Int[NDArray[np.int64], " n"], row: Int[NDArray[np.int64], " n"], frame: int = 0
) -> Points:
    """Cyclic shift of each pixel's points, ``(n, 3)`` in [0, 1).

    A function of its arguments alone, independent of the order of pixels, of threads and of the machine.
    """
    key = np.zeros(len(column), np.uint64)
    with np.errstate(over="ignore"):
        for part in (np.uint64(seed), np.uint64(frame), np.asarray(column, np.uint64), np.asarray(row, np.uint64)):
            key = mixed_words((key ^ part) + GOLDEN)
        axes = np.stack([mixed_words(key + GOLDEN * np.uint64(axis + 1)) for axis in range(3)], axis=1)
    return (axes >> np.uint64(11)).astype(np.float64) * 2.0**-53


_CHANNELS = ((0, 0, 0), (5, 23, 37), (11, 47, 13))  # distance in the mask between the values for u, v and t


def blue_shift(
    seed: int, column: Int[NDArray[np.int64], " n"], row: Int[NDArray[np.int64], " n"], frame: int = 0
) -> Points:
    """Shifts as in :func:`pixel_shift`, but from spatiotemporal blue noise: the errors of neighbouring pixels, and of a
    pixel in successive frames, differ and so are less visible.

    Source: Georgiev and Fajardo 2016, "Blue-noise dithered sampling"; see :mod:`renderer.sampling.blue_noise`.
    """
    of_seed = np.random.default_rng([seed, 0xB1E]).integers(0, (FRAMES, SIDE_PX, SIDE_PX))
    axes = []
    for channel in _CHANNELS:
        later, down, across = of_seed + channel
        axes.append(mask()[(frame + later) % FRAMES, (row + down) % SIDE_PX, (column + across) % SIDE_PX])
    return np.stack(axes, axis=1)


def no_shift(
    seed: int, column: Int[NDArray[np.int64], " n"], row: Int[NDArray[np.int64], " n"], frame: int = 0
) -> Points:
    """No shift: all pixels have the same points."""
    return np.zeros((len(column), 3))


_SHIFTS = {"white": pixel_shift, "blue": blue_shift, "none": no_shift}

# --- warps -----------------------------------------------------------------------------------------------------------


def gaussian_warp(
    u: Float[NDArray[np.float64], "*n"], v: Float[NDArray[np.float64], "*n"], sigma_px: float
) -> tuple[Float[NDArray[np.float64], "*n"], Float[NDArray[np.float64], "*n"]]:
    """Offsets from the pixel's centre with a Gaussian density, pixels (Box and Muller 1958; thesis fig. 16).

    Deviation: the radius is ``sigma sqrt(-2 ln(1 - u))``, which is finite for ``u`` in [0, 1). The thesis has ``u`` in
    place of ``1 - u``, which may be 0.
    """
    radius = sigma_px * np.sqrt(-2.0 * log1p(-np.asarray(u)))
    turn = 2.0 * np.pi * np.asarray(v)
    return radius * cos(turn), radius * sin(turn)


def box_warp(t: Float[NDArray[np.float64], "*n"], share: float) -> Float[NDArray[np.float64], "*n"]:
    """Times of a box filter over the middle ``share`` of [0, 1]; the truncated box of the thesis has 0.5."""
    return 0.5 + share * (np.asarray(t) - 0.5)


def triangle_warp(t: Float[NDArray[np.float64], "*n"]) -> Float[NDArray[np.float64], "*n"]:
    """Times in [0, 1] of a triangle filter with its peak in the middle, by its inverse distribution (thesis fig.
    16)."""
    t = np.asarray(t)
    return np.where(t <= 0.5, np.sqrt(0.5 * t), 1.0 - np.sqrt(0.5 * (1.0 - t)))


# --- the plan of a picture -------------------------------------------------------------------------------------------


@lru_cache(maxsize=64)
def _cached_set(name: str, count: int, seed: int) -> Points:
    return point_set(name, count, seed)


@dataclass(frozen=True)
@closed_choices("SamplePlan.")
class SamplePlan:
    """The sampling of every pixel of a picture or sequence."""

    samples_per_pixel: int = 16
    """Number of samples of a pixel; a cube for stratified."""
    point_set: str = "hammersley"
    """Point set that all pixels share, each with its own shift."""
    seed: int = 0
    """Seed of the set and of the shifts."""
    space_filter: Literal["box", "gaussian"] = "box"
    """Reconstruction filter in space: the pixel's own square, or a Gaussian about its centre."""
    sigma_px: float = 0.5
    """Standard deviation of the Gaussian, pixels; 0.5 in the thesis."""
    time_filter: Literal["box", "triangle"] = "box"
    """Reconstruction filter over the time the shutter is open."""
    box_share: float = 1.0
    """Share of that time, in its middle, that a box spans; 0.5 in the thesis."""
    shift: Literal["white", "blue", "none"] = "white"
    """Shift of the points in each pixel: independent of its neighbours, by spatiotemporal blue noise, or none."""
    new_set_each_frame: bool = False
    """Whether every frame has its own point set, instead of one for all."""

    def __post_init__(self) -> None:
        if not 0.0 < self.sigma_px < math.inf:
            raise ValueError(f"SamplePlan.sigma_px: expected a positive number, got {self.sigma_px}")
        if not 0.0 < self.box_share <= 1.0:
            raise ValueError(f"SamplePlan.box_share: expected a share in (0, 1], got {self.box_share}")
        if not 0 <= self.seed < 1 << 63:
            raise ValueError(f"SamplePlan.seed: expected 0 to 2^63 - 1, got {self.seed}")
        _cached_set(self.point_set, self.samples_per_pixel, self.seed)

    def samples(
        self,
        columns: Int[NDArray[np.int64], " pixels"],
        rows: Int[NDArray[np.int64], " pixels"],
        width_px: int,
        height_px: int,
        frame_time_s: float,
        shutter_s: tuple[float, float] = (0.0, 0.0),
        frame: int = 0,
    ) -> tuple[Float[NDArray[np.float32], "pixels n 2"], Float[NDArray[np.float64], "pixels n"]]:
        """Positions on the image, from (0, 0) at its top left corner to (1, 1), and times in seconds.

        The tails of the Gaussian leave the pixel, and at the border the image. The samples of a pixel do not depend on
        which others are requested.
        """
        points = _cached_set(self.point_set, self.samples_per_pixel, self.seed + self.new_set_each_frame * frame)
        shifted = points[None] + _SHIFTS[self.shift](self.seed, columns, rows, frame)[:, None]
        shifted -= shifted >= 1.0
        u, v, t = np.moveaxis(shifted, -1, 0)
        if self.space_filter == "gaussian":
            across, down = gaussian_warp(u, v, self.sigma_px)
            u, v = across + 0.5, down + 0.5
        x, y = (np.asarray(columns)[:, None] + u) / width_px, (np.asarray(rows)[:, None] + v) / height_px
        t = triangle_warp(t) if self.time_filter == "triangle" else box_warp(t, self.box_share)
        opening, closing = shutter_s
        time_s = frame_time_s + opening + (closing - opening) * t
        return np.stack([x, y], axis=-1).astype(np.float32), time_s
