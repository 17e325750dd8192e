"""Embree as a peer, through embreex: one ray after the other on one thread."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

Points = NDArray[np.float32]


class EmbreeMesh:
    """A mesh in Embree's tree, which is built when rays are first asked for.

    Embree traces without its robust mode, and for closest hits returns nothing but the face: its fastest.
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
        """Zero where a ray hits something nearer than ``t_max`` of its direction's lengths, -1 elsewhere."""
        return self._scene.run(origin, direction, dists=t_max, query="OCCLUDED")

    def hits(self, origin: Points, direction: Points) -> tuple[NDArray[np.int32], Points]:
        """Faces as :meth:`closest` and how far they are, in the direction's lengths; not what is timed."""
        found = self._scene.run(origin, direction, output=True)
        return found["primID"], found["tfar"]
