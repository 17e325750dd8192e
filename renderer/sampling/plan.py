"""Where in a pixel and when in the shutter's time samples lie: shifts and warps of point sets.

A pixel's samples are a point set (u, v, t) in the unit cube, shifted round the torus by an amount of its own, then
warped so that even points become those of the reconstruction filter (filter importance sampling): their colours count
alike.

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
    """How far each pixel's points are shifted round the torus, ``(n, 3)`` in [0, 1).

    A function of its arguments alone: the same whatever the order of pixels, threads or machines.
    """
    key = np.zeros(len(column), np.uint64)
    with np.errstate(over="ignore"):
        for part in (np.uint64(seed), np.uint64(frame), np.asarray(column, np.uint64), np.asarray(row, np.uint64)):
            key = mixed_words((key ^ part) + GOLDEN)
        axes = np.stack([mixed_words(key + GOLDEN * np.uint64(axis + 1)) for axis in range(3)], axis=1)
    return (axes >> np.uint64(11)).astype(np.float64) * 2.0**-53


_CHANNELS = ((0, 0, 0), (5, 23, 37), (11, 47, 13))  # how far apart in the mask u, v and t are read


def blue_shift(
    seed: int, column: Int[NDArray[np.int64], " n"], row: Int[NDArray[np.int64], " n"], frame: int = 0
) -> Points:
    """Shifts as those of :func:`pixel_shift`, but of spatiotemporal blue noise: errors of neighbours, and of one pixel
    in frames that follow each other, differ, and so are less seen.

    Source: Georgiev and Fajardo 2016, "Blue-noise dithered sampling"; see :mod:`renderer.sampling.blue_noise`.
    """
    of_seed = np.random.default_rng([seed, 0xB1E]).integers(0, (FRAMES, SIDE_PX, SIDE_PX))
    axes = []
    for channel in _CHANNELS:
        later, down, across = of_seed + channel
        axes.append(mask()[(frame + later) % FRAMES, (row + down) % SIDE_PX, (column + across) % SIDE_PX])
    return np.stack(axes, axis=1)


_SHIFTS = {"white": pixel_shift, "blue": blue_shift}

# --- warps -----------------------------------------------------------------------------------------------------------


def gaussian_warp(
    u: Float[NDArray[np.float64], "*n"], v: Float[NDArray[np.float64], "*n"], sigma_px: float
) -> tuple[Float[NDArray[np.float64], "*n"], Float[NDArray[np.float64], "*n"]]:
    """Offsets from the pixel's centre with a Gaussian density, pixels (Box and Muller 1958; thesis fig. 16).

    Deviation: the radius is that of ``1 - u``, which is never 0 for ``u`` in [0, 1). The thesis takes ``u``, which may
    be 0 and then has no logarithm.
    """
    radius = sigma_px * np.sqrt(-2.0 * log1p(-np.asarray(u)))
    turn = 2.0 * np.pi * np.asarray(v)
    return radius * cos(turn), radius * sin(turn)


def box_warp(t: Float[NDArray[np.float64], "*n"], share: float) -> Float[NDArray[np.float64], "*n"]:
    """Times of a box that spans the middle ``share`` of [0, 1]; the thesis' truncated box has 0.5."""
    return 0.5 + share * (np.asarray(t) - 0.5)


def triangle_warp(t: Float[NDArray[np.float64], "*n"]) -> Float[NDArray[np.float64], "*n"]:
    """Times in [0, 1] of the triangle that peaks in the middle: its inverse distribution (thesis fig. 16)."""
    t = np.asarray(t)
    return np.where(t <= 0.5, np.sqrt(0.5 * t), 1.0 - np.sqrt(0.5 * (1.0 - t)))


# --- the plan of a picture -------------------------------------------------------------------------------------------


@lru_cache(maxsize=64)
def _cached_set(name: str, count: int, seed: int) -> Points:
    return point_set(name, count, seed)


@dataclass(frozen=True)
@closed_choices("SamplePlan.")
class SamplePlan:
    """How every pixel of a picture or sequence is sampled."""

    samples_per_pixel: int = 16
    """Samples of a pixel; a cube for stratified."""
    point_set: str = "hammersley"
    """The points that all pixels share, each shifted."""
    seed: int = 0
    """Of the set and of the shifts."""
    space_filter: Literal["box", "gaussian"] = "box"
    """Reconstruction filter in space: the pixel's own square, or a Gaussian about its centre."""
    sigma_px: float = 0.5
    """Of the Gaussian, pixels; the thesis has 0.5."""
    time_filter: Literal["box", "triangle"] = "box"
    """Reconstruction filter over the time the shutter is open."""
    box_share: float = 1.0
    """The middle part of that time which a box spans; the thesis has 0.5."""
    shift: Literal["white", "blue"] = "white"
    """How far each pixel shifts the points: independently of its neighbours, or by spatiotemporal blue noise."""
    new_set_each_frame: bool = False
    """Whether every frame has a point set of its own, rather than all the same."""

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

        The Gaussian's tails leave the pixel, and the image at its border. A pixel's samples do not depend on which
        others are asked for.
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
