"""Point sets (u, v, t) in the unit cube: positions in a pixel and times within the shutter's.

Source: motion-blur perception thesis, chapter 2; Owen 1995, "Randomly permuted (t, m, s)-nets and (t, s)-sequences".
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable

import numpy as np
from jaxtyping import Float
from numpy.typing import NDArray
from scipy.stats import qmc

from renderer.sampling import POINT_SETS, require_point_set
from scenes.arithmetic import log, power

Points = Float[NDArray[np.float64], "n 3"]

BELOW_ONE = float(np.nextafter(1.0, 0.0))

_POISSON_START = 0.75  # initial share of the densest packing's distance: dart throwing alone reaches about 0.7
_POISSON_TRIES = 4096

_BALANCED = ("sobol", "owen")
"""Sets whose first points form a net if their number is a power of two, and not otherwise."""

GOLDEN = np.uint64(0x9E3779B97F4A7C15)


def mixed_words(words: NDArray[np.uint64]) -> NDArray[np.uint64]:
    """A mixing bijection of 64-bit words; constants of SplitMix64 (Steele et al. 2014)."""
    words = (words ^ (words >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    words = (words ^ (words >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return words ^ (words >> np.uint64(31))


def point_set(name: str, count: int, seed: int = 0) -> Points:
    """Points ``(u, v, t)`` in [0, 1)³, float64.

    Args:
        name: ``hammersley`` (uniform steps in u, radical inverses to bases 2 and 3 in v and t), ``stratified`` (one
            random point in each cell of a cubic grid), ``poisson`` (a least distance on the torus), ``halton`` and
            ``sobol`` (scrambled digit by digit), ``owen`` (Sobol with Owen's nested scrambling), ``cells-even``,
            ``cells-space``, ``cells-time`` (one random point in each cell of a grid with about as many, an eighth and
            eight times as many cells in time as along a side of the pixel), ``random``, or one that was added to
            :data:`renderer.sampling.POINT_SETS`.
        count: number of points, at most 65,536; for ``stratified`` a cube.
        seed: seed of all sets except ``hammersley``.

    Warns: UserWarning: for ``sobol`` and ``owen`` with a count that is not a power of two: some elementary intervals
        then have one point more than others, so the set is not a net.

    Raises:
        ValueError: for another name, a count that the set cannot have, or points that do not lie in the cube.
    """
    require_point_set(name, count)
    if name in _BALANCED and count & (count - 1):
        power_below = 1 << count.bit_length() - 1
        warnings.warn(
            f"point set {name}: {count} points are not balanced, {power_below} or {2 * power_below} would be",
            stacklevel=2,
        )
    points = np.minimum(POINT_SETS[name](count, np.random.default_rng([seed, count])), BELOW_ONE)
    if points.shape != (count, 3) or not (points >= 0.0).all():
        raise ValueError(f"point set {name}: expected ({count}, 3) numbers in [0, 1), got {points.shape} or others")
    points.flags.writeable = False
    return points


def hammersley(count: int, _rng: np.random.Generator) -> Points:
    """Hammersley points ``(i / n, Φ_2(i), Φ_3(i))`` with the radical inverses ``Φ``. Source: blur thesis, ch. 2."""
    inverses = qmc.Halton(2, scramble=False).random(count)
    return np.column_stack([np.arange(count) / count, inverses])


def stratified(count: int, rng: np.random.Generator) -> Points:
    """One random point in each cell of a cubic grid, of as many cells as points."""
    side = round(power(count, 1.0 / 3.0))
    cells = np.stack(np.meshgrid(*[np.arange(side)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    return (cells + rng.random((count, 3))) / side


def poisson(count: int, rng: np.random.Generator) -> Points:
    """Dart throwing with a least distance, which shrinks when no more darts fit, so that the search ends."""
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
    return float(power(math.sqrt(2.0) / count, 1.0 / 3.0))


def toroidal_distance(
    a: Float[NDArray[np.float64], "*n 3"], b: Float[NDArray[np.float64], "*n 3"]
) -> Float[NDArray[np.float64], "*n"]:
    """Distance on the torus: in the unit cube with opposite faces identified."""
    apart = np.abs(a - b)
    return np.linalg.norm(np.minimum(apart, 1.0 - apart), axis=-1)


def halton(count: int, rng: np.random.Generator) -> Points:
    """Halton points in bases 2, 3 and 5 with scrambled digits (SciPy)."""
    return qmc.Halton(3, scramble=True, rng=rng).random(count)


def sobol(count: int, rng: np.random.Generator) -> Points:
    """Sobol points with linear matrix scrambling and a digital shift (SciPy)."""
    return qmc.Sobol(3, scramble=True, rng=rng).random_base2(max(count - 1, 0).bit_length())[:count]


def owen(count: int, rng: np.random.Generator) -> Points:
    """Nested uniform scrambling: whether a bit is flipped is random, but a function of the bits before it."""
    digits = qmc.Sobol(3, scramble=False, bits=32).random_base2(max(count - 1, 0).bit_length())[:count]
    x = (digits * 2.0**32).astype(np.uint64)
    keys = rng.integers(0, 1 << 63, 3, dtype=np.uint64)
    flips = np.zeros_like(x)
    with np.errstate(over="ignore"):
        for bit in range(31, -1, -1):
            above = (x >> np.uint64(bit + 1)) | (np.uint64(1) << np.uint64(31 - bit))  # marked with its length
            flips |= (mixed_words(above * GOLDEN + keys) & np.uint64(1)) << np.uint64(bit)
    return ((x ^ flips) + rng.random(x.shape)) * 2.0**-32


def _cells(density_ratio: float) -> Callable[[int, np.random.Generator], Points]:
    def make(count: int, rng: np.random.Generator) -> Points:
        sides = np.array(cell_counts(count, density_ratio))
        cells = np.stack(np.unravel_index(np.arange(count), sides), axis=1)
        return (cells + rng.random((count, 3))) / sides

    return make


def cell_counts(count: int, density_ratio: float) -> tuple[int, int, int]:
    """Numbers of cells (u, v, t) of a grid of ``count`` cells. The ratio of the cells in time to those along a side of
    the pixel is closest to ``density_ratio``, and the two spatial numbers are as equal as possible; the former counts
    twice.
    """

    def far(sides: tuple[int, int, int]) -> float:
        across, down, times = sides
        return 2.0 * abs(log(times / math.sqrt(across * down) / density_ratio)) + log(across / down)

    divisors = [number for number in range(1, count + 1) if count % number == 0]
    grids = [
        (count // times // down, down, times)
        for times in divisors
        for down in divisors
        if count // times % down == 0 and down * down <= count // times
    ]
    return min(grids, key=far)


def random(count: int, rng: np.random.Generator) -> Points:
    """Independent uniform points."""
    return rng.random((count, 3))


cells_even, cells_space, cells_time = _cells(1.0), _cells(1.0 / 8.0), _cells(8.0)
