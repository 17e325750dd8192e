"""Ray queries on a single mesh, for callers that need hits rather than pictures."""

from __future__ import annotations

import threading
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import ArrayLike, NDArray

from renderer.compute.launching import Command, NativeRecord, address
from renderer.kernels import packets
from renderer.layout.sizes import BLOCK_FLOATS, BLOCK_WIDTH, FAR
from renderer.tables.trees import aligned, build_tree

_RANGE_RAYS = 1 << 14  # a multiple of the lanes


@dataclass(frozen=True, eq=False)
class RayHits:
    """Nearest hits of rays.

    Attributes:
        face: ``(n,)`` int32 face, -1 for a miss.
        t: ``(n,)`` float32 distance in units of the direction's length; the length of the ray for a miss.
        u, v: ``(n,)`` float32 weights of the face's first two corners.
    """

    face: NDArray[np.int32]
    t: NDArray[np.float32]
    u: NDArray[np.float32]
    v: NDArray[np.float32]


class RayQueries:
    """A mesh for ray queries on the CPU.

    Sixteen consecutive coherent rays are traced as a packet, others one by one; the bits of the hits are the same
    either way. Of two faces at the same distance the one with the lower number is reported.
    """

    def __init__(self, vertices: ArrayLike, faces: ArrayLike, threads: int = 1) -> None:
        """Builds the tree.

        Args:
            vertices: ``(v, 3)``, best within ``[-1, 1]³``.
            faces: ``(f, 3)`` indices of corners.
            threads: number of host threads.

        Raises:
            ValueError: if the mesh is invalid (see :func:`renderer.tables.trees.build_tree`), or ``threads`` is below
                1.
        """
        if threads < 1:
            raise ValueError(f"threads: expected at least 1, got {threads}")
        tree = build_tree(vertices, faces)
        self._nodes, self._blocks = aligned(tree.nodes), aligned(tree.blocks)
        self._pool = ThreadPoolExecutor(threads) if threads > 1 else None
        self._of_thread = threading.local()

    def closest(self, origin: ArrayLike, direction: ArrayLike, t_max: ArrayLike | None = None) -> RayHits:
        """Nearest hits of rays ``(n, 3)`` up to ``t_max``, a number or ``(n,)``; directions need not be unit.

        Raises:
            ValueError: if the shapes do not match.
        """
        return self._trace(origin, direction, t_max, nearest=True)

    def blocked(self, origin: ArrayLike, direction: ArrayLike, t_max: ArrayLike | None = None) -> NDArray[np.bool_]:
        """Whether rays ``(n, 3)`` hit any face before ``t_max``, a number or ``(n,)``.

        Raises:
            ValueError: if the shapes do not match.
        """
        return self._trace(origin, direction, t_max, nearest=False).face != 0

    def _trace(self, origin: ArrayLike, direction: ArrayLike, t_max: ArrayLike | None, nearest: bool) -> RayHits:
        starts, ways = (np.require(values, np.float32, "CW") for values in (origin, direction))
        if starts.ndim != 2 or starts.shape[1] != 3 or ways.shape != starts.shape:
            raise ValueError(f"rays: expected origins and directions (n, 3), got {starts.shape} and {ways.shape}")
        count = len(starts)
        reach = None
        if t_max is not None:
            reach = np.minimum(np.float32(FAR), np.broadcast_to(np.asarray(t_max, np.float32), count))
        hits = RayHits(np.empty(count, np.int32), *(np.empty(count if nearest else 0, np.float32) for _ in range(3)))
        rays, floats = NativeRecord("2Q2q7Q"), torch.float32
        rays.set(
            self._nodes.ctypes.data, self._blocks.ctypes.data, self._blocks.size // BLOCK_FLOATS * BLOCK_WIDTH, count,
            address("origin", starts, floats, 3 * count), address("direction", ways, floats, 3 * count),
            0 if reach is None else address("t_max", reach, floats, count),
            hits.face.ctypes.data, hits.t.ctypes.data, hits.u.ctypes.data, hits.v.ctypes.data,
        )  # fmt: skip

        def run(first: int) -> None:
            self._launch()(rays.address, first, min(first + _RANGE_RAYS, count), int(nearest))

        for _ in (map if self._pool is None else self._pool.map)(run, range(0, count, _RANGE_RAYS)):
            pass
        return hits

    def _launch(self) -> Command:
        """The launch of this thread."""
        if not hasattr(self._of_thread, "launch"):
            self._of_thread.launch = Command(packets.trace_queries)
        return self._of_thread.launch
