"""Embree as a peer, through embreex: single rays on one thread."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

Points = NDArray[np.float32]


class EmbreeMesh:
    """A mesh in Embree's tree, which is built at the first query.

    Embree traces without its robust mode, and for closest hits returns the face alone: this is its fastest way.
    """

    def __init__(self, vertices: Points, faces: NDArray[np.int32]) -> None:
        from embreex.mesh_construction import TriangleMesh
        from embreex.rtcore_scene import EmbreeScene

        self._scene: Any = EmbreeScene()
        self._mesh = TriangleMesh(self._scene, vertices, faces)

    def closest(self, origin: Points, direction: Points) -> NDArray[np.int32]:
        """Face that each ray ``(n, 3)`` hits first, -1 for none."""
        return self._scene.run(origin, direction)

    def blocked(self, origin: Points, direction: Points, t_max: Points) -> NDArray[np.int32]:
        """0 where a ray hits something nearer than ``t_max``, -1 elsewhere; lengths are in units of the direction."""
        return self._scene.run(origin, direction, dists=t_max, query="OCCLUDED")

    def hits(self, origin: Points, direction: Points) -> tuple[NDArray[np.int32], Points]:
        """Faces as in :meth:`closest` and their distances in units of the direction's length; not timed."""
        found = self._scene.run(origin, direction, output=True)
        return found["primID"], found["tfar"]
