"""Spatiotemporal blue noise: a mask whose values differ strongly between neighbours in a frame, and between frames of a
pixel.

The mask is a ranking of the voxels of a torus (frame, row, column) by the void-and-cluster method. A few voxels are
first spread as evenly as possible; they are ranked from the last down by removing the tightest cluster each time. The
others follow, each in the largest void.

Source: Ulichney 1993, "The void-and-cluster method for dither array generation"; Wolfe et al. 2022, "Spatiotemporal
blue noise masks": two voxels of one frame repel in space, two of one pixel repel in time, and others do not repel.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from jaxtyping import Float
from numpy.typing import NDArray

from scenes.arithmetic import exp

SIDE_PX = 64
FRAMES = 16
"""Size of the mask, which is periodic."""

_SIGMA = 1.9
"""Standard deviation of the repulsion, pixels and frames (1.5 in Ulichney, 1.9 in Wolfe et al.)."""

_FIRST_SHARE = 0.1  # share of the voxels in the initial pattern


@lru_cache(maxsize=1)
def mask() -> Float[NDArray[np.float64], "frames side side"]:
    """The mask, which has every value ``(i + 1/2) / n`` once. It is computed at the first call, in some seconds, and
    always the same."""
    ranks = _ranked(FRAMES, SIDE_PX, np.random.default_rng(0))
    values = (ranks + 0.5) / ranks.size
    values.flags.writeable = False
    return values


def _ranked(frames: int, side: int, rng: np.random.Generator) -> NDArray[np.int64]:
    """Rank of every voxel."""
    field = _Field(frames, side)
    first = max(2, int(_FIRST_SHARE * field.count))
    for voxel in rng.permutation(field.count)[:first]:
        field.put(voxel)
    while True:  # the tightest cluster moves to the largest void until both are the same voxel
        cluster = field.tightest()
        field.take(cluster)
        void = field.largest_void()
        field.put(void)
        if void == cluster:
            break
    ranks = np.empty(field.count, np.int64)
    start = field.copy()
    for rank in range(first - 1, -1, -1):
        cluster = field.tightest()
        field.take(cluster)
        ranks[cluster] = rank
    for rank in range(first, field.count):
        void = start.largest_void()
        start.put(void)
        ranks[void] = rank
    return ranks.reshape(frames, side, side)


class _Field:
    """The set voxels, and the energy of every voxel: its proximity to them."""

    def __init__(self, frames: int, side: int) -> None:
        self.frames, self.side, self.count = frames, side, frames * side * side
        along = np.minimum(np.arange(side), side - np.arange(side))
        near = exp(-(along**2) / (2.0 * _SIGMA**2))
        plane = np.outer(near, near)
        # the plane repeated, so that any cyclic shift of it is a view
        self._plane = np.tile(plane, (2, 2))
        later = np.minimum(np.arange(frames), frames - np.arange(frames))
        times = exp(-(later**2) / (2.0 * _SIGMA**2))
        times[0] = 0.0  # the voxel itself is counted in its plane
        self._times = np.tile(times, 2)
        self._energy = np.zeros((frames, side, side))
        self._set = np.zeros(self.count, bool)
        # the energy of the voxels that are not set, and of those that are; infinite elsewhere
        self._voids, self._clusters = np.zeros(self.count), np.full(self.count, -np.inf)

    def copy(self) -> _Field:
        """A copy in the same state."""
        twin = _Field(self.frames, self.side)
        twin._energy, twin._set = self._energy.copy(), self._set.copy()
        twin._voids, twin._clusters = self._voids.copy(), self._clusters.copy()
        return twin

    def put(self, voxel: int) -> None:
        """Sets a voxel."""
        self._set[voxel] = True
        self._change(voxel, 1.0)

    def take(self, voxel: int) -> None:
        """Clears a voxel."""
        self._set[voxel] = False
        self._change(voxel, -1.0)

    def tightest(self) -> int:
        """The set voxel with the greatest energy."""
        return int(self._clusters.argmax())

    def largest_void(self) -> int:
        """The voxel with the least energy that is not set."""
        return int(self._voids.argmin())

    def _change(self, voxel: int, sign: float) -> None:
        side = self.side
        frame, place = divmod(voxel, side * side)
        row, column = divmod(place, side)
        plane = self._plane[side - row : 2 * side - row, side - column : 2 * side - column]
        self._energy[frame] += sign * plane
        self._energy[:, row, column] += sign * self._times[self.frames - frame : 2 * self.frames - frame]
        for changed in (slice(frame * side * side, (frame + 1) * side * side), slice(place, None, side * side)):
            energy, taken = self._energy.reshape(-1)[changed], self._set[changed]
            self._voids[changed] = np.where(taken, np.inf, energy)
            self._clusters[changed] = np.where(taken, energy, -np.inf)
