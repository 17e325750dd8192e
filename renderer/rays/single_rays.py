"""Single ray queries on a mesh with a choice of structures, and counts of their work."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
import warp as wp
from numpy.typing import ArrayLike, NDArray

from renderer.compute import device as devices
from renderer.compute.launching import shared
from renderer.kernels import packets
from renderer.layout.sizes import FAR
from renderer.layout.structs import MeshRecord, SceneData
from renderer.rays.queries import RayHits
from renderer.tables.accelerators import Structure, build_structure, number_of
from renderer.tables.trees import aligned

_RANGE_RAYS = 1 << 12


@dataclass(frozen=True)
class Work:
    """Counts of the work of ray queries.

    Attributes:
        node_visits: number of nodes whose boxes or plane were tested.
        triangle_tests: number of ray–triangle tests.
    """

    node_visits: int
    triangle_tests: int


class SingleRays:
    """A mesh for single ray queries on the CPU; the bits of the hits are the same for every structure.

    See :mod:`renderer.tables.accelerators` for the one exception.
    """

    def __init__(self, vertices: ArrayLike, faces: ArrayLike, structure: Structure = "bvh", threads: int = 1) -> None:
        """Builds the structure.

        Args:
            vertices: ``(v, 3)`` finite, best within ``[-1, 1]³``.
            faces: ``(f, 3)`` indices of corners.
            structure: acceleration structure over the triangles.
            threads: number of host threads.
        """
        devices.load_kernels(packets, "cpu")
        points, corners = np.ascontiguousarray(vertices, np.float32), np.ascontiguousarray(faces, np.int32)
        self.nodes, self.blocks = build_structure(structure, points, corners)
        record = np.zeros(1, MeshRecord.numpy_dtype())
        record["face_count"] = len(corners)
        self._scene = SceneData()
        self._scene.structure = number_of(structure)
        self._scene.meshes = wp.array(record, dtype=MeshRecord, device="cpu")
        self._scene.tree_blocks = shared(aligned(self.blocks), wp.float32)
        if self.nodes is not None:
            nodes = shared(aligned(self.nodes), wp.float32)
            setattr(self._scene, "kd_nodes" if structure == "kdtree" else "tree_nodes", nodes)
        self._pool = ThreadPoolExecutor(threads) if threads > 1 else None

    def closest(self, origin: ArrayLike, direction: ArrayLike, t_max: float = FAR) -> RayHits:
        """Nearest hits of rays ``(n, 3)``; directions need not be unit."""
        return self._trace(origin, direction, t_max, nearest=True, work=None)

    def counted(
        self, origin: ArrayLike, direction: ArrayLike, t_max: float = FAR, nearest: bool = True
    ) -> tuple[RayHits, Work]:
        """Nearest hits as in :meth:`closest`, or any hits if ``nearest`` is false, and counts of the work."""
        work = np.zeros(2, np.int64)
        hits = self._trace(origin, direction, t_max, nearest, work)
        return hits, Work(*work.tolist())

    def _trace(
        self, origin: ArrayLike, direction: ArrayLike, t_max: float, nearest: bool, work: NDArray[np.int64] | None
    ) -> RayHits:
        starts, ways = np.ascontiguousarray(origin, np.float32), np.ascontiguousarray(direction, np.float32)
        if starts.ndim != 2 or starts.shape[1] != 3 or ways.shape != starts.shape:
            raise ValueError(f"rays: expected origins and directions (n, 3), got {starts.shape} and {ways.shape}")
        count = len(starts)
        reach = np.full(count, t_max, np.float32)
        hits = RayHits(np.empty(count, np.int32), *(np.empty(count if nearest else 0, np.float32) for _ in range(3)))
        rays = packets.SingleQueries()
        rays.origin, rays.direction = shared(starts, wp.vec3), shared(ways, wp.vec3)
        rays.reach, rays.face = shared(reach, wp.float32), shared(hits.face, wp.int32)
        rays.t, rays.u, rays.v = (shared(part, wp.float32) for part in (hits.t, hits.u, hits.v))
        totals = wp.empty(0, dtype=wp.int64, device="cpu") if work is None else shared(work, wp.int64)

        def run(first: int) -> None:
            inputs = [self._scene, rays, first, int(nearest), totals]
            wp.launch(packets.trace_singles, dim=min(_RANGE_RAYS, count - first), inputs=inputs, device="cpu")

        for _ in (map if self._pool is None else self._pool.map)(run, range(0, count, _RANGE_RAYS)):
            pass
        return hits
