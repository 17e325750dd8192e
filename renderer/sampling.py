"""Where in a pixel and when in the shutter's time samples lie: point sets, shifts and warps.

A pixel's samples are a point set (u, v, t) in the unit cube, shifted round the torus by an amount of its own, then
warped so that even points become those of the reconstruction filter (filter importance sampling): their colours count
alike.

Source: motion-blur perception thesis, chapters 2 (point sets, filters) and 3 (shift, warps; figs 14 and 16).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from typing import Literal

import numpy as np
from jaxtyping import Float, Int
from numpy.typing import NDArray
from scipy.stats import qmc

Points = Float[NDArray[np.float64], "n 3"]
PointSet = Literal["hammersley", "stratified", "poisson", "halton", "sobol", "random"]
POINT_SETS: tuple[PointSet, ...] = ("hammersley", "stratified", "poisson", "halton", "sobol", "random")

COUNT_MAX = 1 << 16
"""Points of a set at most."""

BELOW_ONE = float(np.nextafter(1.0, 0.0))

_POISSON_MAX = 4096
_POISSON_START = 0.75  # share of the densest packing's distance to begin with: darts alone reach about 0.7
_POISSON_TRIES = 4096


def point_set(name: PointSet, count: int, seed: int = 0) -> Points:
    """Points ``(u, v, t)`` in [0, 1)³, float64.

    Args:
        name: ``hammersley`` (even in u, radical inverses to bases 2 and 3 in v and t), ``stratified`` (one random point
            in each cell of a cubic grid), ``poisson`` (no two closer than a distance round the torus), ``halton`` and
            ``sobol`` (both scrambled), ``random``.
        count: how many, at most 65,536; for ``stratified`` a cube.
        seed: of all but ``hammersley``.

    Raises:
        ValueError: for another name, or a count that the set cannot have.
    """
    if name not in _MAKERS:
        raise ValueError(f"point set: expected one of {', '.join(POINT_SETS)}, got {name!r}")
    most = _POISSON_MAX if name == "poisson" else COUNT_MAX
    if not 1 <= count <= most:
        raise ValueError(f"point set {name}: expected 1 to {most} points, got {count}")
    points = np.minimum(_MAKERS[name](count, np.random.default_rng([seed, count])), BELOW_ONE)
    points.flags.writeable = False
    return points


def _hammersley(count: int, _rng: np.random.Generator) -> Points:
    inverses = qmc.Halton(2, scramble=False).random(count)
    return np.column_stack([np.arange(count) / count, inverses])


def _stratified(count: int, rng: np.random.Generator) -> Points:
    side = round(count ** (1.0 / 3.0))
    if side**3 != count:
        below = math.floor(count ** (1.0 / 3.0) + 1e-9)
        raise ValueError(
            f"point set stratified: expected a cube of samples, such as {max(below, 1) ** 3} or {(below + 1) ** 3}, "
            f"got {count}"
        )
    cells = np.stack(np.meshgrid(*[np.arange(side)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    return (cells + rng.random((count, 3))) / side


def _poisson(count: int, rng: np.random.Generator) -> Points:
    """Darts that keep a distance; where no more fit, the distance shrinks, so that this ends."""
    radius = _POISSON_START * packing_distance(count)
    points = np.empty((count, 3))
    placed, tries = 0, 0
    while placed < count:
        darts = rng.random((256, 3))
        far = toroidal_distance(darts[:, None], points[None, :placed]).min(axis=1, initial=np.inf) >= radius
        for dart in darts[far]:
            if placed < count and toroidal_distance(dart, points[:placed]).min(initial=np.inf) >= radius:
                points[placed] = dart
                placed, tries = placed + 1, 0
        tries += len(darts)
        if tries > _POISSON_TRIES:
            radius, tries = 0.985 * radius, 0
    return points


def packing_distance(count: int) -> float:
    """Least distance between ``count`` points of the unit torus in the densest packing of space (Gauss 1831)."""
    return (math.sqrt(2.0) / count) ** (1.0 / 3.0)


def toroidal_distance(
    a: Float[NDArray[np.float64], "*n 3"], b: Float[NDArray[np.float64], "*n 3"]
) -> Float[NDArray[np.float64], "*n"]:
    """Distance in the unit cube whose opposite faces are one."""
    apart = np.abs(a - b)
    return np.linalg.norm(np.minimum(apart, 1.0 - apart), axis=-1)


def _halton(count: int, rng: np.random.Generator) -> Points:
    return qmc.Halton(3, scramble=True, rng=rng).random(count)


def _sobol(count: int, rng: np.random.Generator) -> Points:
    return qmc.Sobol(3, scramble=True, rng=rng).random_base2(max(count - 1, 0).bit_length())[:count]


def _random(count: int, rng: np.random.Generator) -> Points:
    return rng.random((count, 3))


_MAKERS: dict[str, Callable[[int, np.random.Generator], Points]] = {
    "hammersley": _hammersley,
    "stratified": _stratified,
    "poisson": _poisson,
    "halton": _halton,
    "sobol": _sobol,
    "random": _random,
}

# --- shifts ----------------------------------------------------------------------------------------------------------


def _mixed(words: NDArray[np.uint64]) -> NDArray[np.uint64]:
    """A bijection of 64-bit words without visible structure; constants of SplitMix64 (Steele et al. 2014)."""
    words = (words ^ (words >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    words = (words ^ (words >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return words ^ (words >> np.uint64(31))


def pixel_shift(
    seed: int, column: Int[NDArray[np.int64], " n"], row: Int[NDArray[np.int64], " n"], frame: int = 0
) -> Points:
    """How far each pixel's points are shifted round the torus, ``(n, 3)`` in [0, 1).

    A function of its arguments alone: the same whatever the order of pixels, threads or machines.
    """
    golden = np.uint64(0x9E3779B97F4A7C15)
    key = np.zeros(len(column), np.uint64)
    with np.errstate(over="ignore"):
        for part in (np.uint64(seed), np.uint64(frame), np.asarray(column, np.uint64), np.asarray(row, np.uint64)):
            key = _mixed((key ^ part) + golden)
        axes = np.stack([_mixed(key + golden * np.uint64(axis + 1)) for axis in range(3)], axis=1)
    return (axes >> np.uint64(11)).astype(np.float64) * 2.0**-53


# --- warps -----------------------------------------------------------------------------------------------------------


def gaussian_warp(
    u: Float[NDArray[np.float64], "*n"], v: Float[NDArray[np.float64], "*n"], sigma_px: float
) -> tuple[Float[NDArray[np.float64], "*n"], Float[NDArray[np.float64], "*n"]]:
    """Offsets from the pixel's centre with a Gaussian density, pixels (Box and Muller 1958; thesis fig. 16).

    Deviation: the radius is that of ``1 - u``, which never is 0 where ``u`` is in [0, 1); the thesis takes ``u``, whose
    0 has no logarithm.
    """
    radius = sigma_px * np.sqrt(-2.0 * np.log1p(-np.asarray(u)))
    turn = 2.0 * np.pi * np.asarray(v)
    return radius * np.cos(turn), radius * np.sin(turn)


def box_warp(t: Float[NDArray[np.float64], "*n"], share: float) -> Float[NDArray[np.float64], "*n"]:
    """Times of a box that spans the middle ``share`` of [0, 1]; the thesis' truncated box has 0.5."""
    return 0.5 + share * (np.asarray(t) - 0.5)


def triangle_warp(t: Float[NDArray[np.float64], "*n"]) -> Float[NDArray[np.float64], "*n"]:
    """Times in [0, 1] of the triangle that peaks in the middle: its inverse distribution (thesis fig. 16)."""
    t = np.asarray(t)
    return np.where(t <= 0.5, np.sqrt(0.5 * t), 1.0 - np.sqrt(0.5 * (1.0 - t)))


# --- the plan of a picture -------------------------------------------------------------------------------------------


@lru_cache(maxsize=64)
def _cached_set(name: PointSet, count: int, seed: int) -> Points:
    return point_set(name, count, seed)


@dataclass(frozen=True)
class SamplePlan:
    """How every pixel of a picture or sequence is sampled."""

    samples_per_pixel: int = 16
    """Samples of a pixel; a cube for stratified."""
    point_set: PointSet = "hammersley"
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
    new_set_each_frame: bool = False
    """Whether every frame has a point set of its own, rather than all the same."""

    def __post_init__(self) -> None:
        if self.space_filter not in ("box", "gaussian") or self.time_filter not in ("box", "triangle"):
            raise ValueError(f"SamplePlan: no such filter: {self.space_filter!r}, {self.time_filter!r}")
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
        shifted = points[None] + pixel_shift(self.seed, columns, rows, frame)[:, None]
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
