"""Meshes of a scene as rows of the tables that kernels read, and their acceleration structures."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import warp as wp

from renderer.layout.sizes import BLOCK_FLOATS, KD_FLOATS, NODE_FLOATS
from renderer.tables.accelerators import Structure, build_structure
from renderer.tables.trees import aligned
from scenes.canonical import Mesh, SceneError

_BOX_PADDING = 2.0e-5
"""Padding of the boxes of the tree, in units of the mesh's half size.

Warp's ray–triangle test is watertight, but its ray–box test is not: rounding loses rays that pass exactly where boxes
touch. The padding covers rays that start up to a few hundred half sizes away.
"""


@dataclass(frozen=True, eq=False)
class UnitMesh:
    """A mesh transformed into ``[-1, 1]³``; ``center`` and ``scale`` take it back to object space."""

    index: int
    center: np.ndarray
    scale: float
    lower: np.ndarray
    upper: np.ndarray


class _Pool:
    """A pool of concatenated arrays."""

    def __init__(self, width: int, scalar: type, dtype: type) -> None:
        self.width, self.scalar, self.dtype = width, scalar, dtype
        self.arrays: list[np.ndarray] = []
        self.count = 0

    def append(self, array: np.ndarray | None) -> int:
        """Adds an array and returns the index of its first row, or -1 for None."""
        if array is None:
            return -1
        first = self.count
        self.arrays.append(np.asarray(array, self.scalar).reshape(-1, self.width))
        self.count += len(self.arrays[-1])
        return first

    def upload(self, device: str) -> wp.array:
        """The pool on a device; one row of zeros if it is empty."""
        table = np.concatenate(self.arrays) if self.arrays else np.zeros((1, self.width), self.scalar)
        if self.dtype is wp.float32:  # trees of the CPU
            return wp.array(aligned(table), dtype=wp.float32, device=device, copy=device != "cpu")
        flat = table.reshape(-1) if self.dtype is wp.int32 else table
        return wp.array(np.ascontiguousarray(flat), dtype=self.dtype, device=device)


class MeshTable:
    """The unique meshes of a scene."""

    def __init__(self, device: str, structure: Structure | None) -> None:
        """Creates an empty table; ``structure`` is the structure over triangles on the CPU, None for Warp's own
        trees."""
        self.device, self.structure = device, structure
        self.rows: list[dict] = []
        self.triangle_count = 0
        self.keep: list[object] = []  # kernels refer to a Warp mesh by number only; ids of meshes must not be reused
        self.pools = {
            "tree_nodes": _Pool(NODE_FLOATS, np.float32, wp.float32),
            "tree_blocks": _Pool(BLOCK_FLOATS, np.float32, wp.float32),
            "kd_nodes": _Pool(KD_FLOATS, np.float32, wp.float32),
            "vertices": _Pool(3, np.float32, wp.vec3),
            "faces": _Pool(3, np.int32, wp.vec3i),
            "normals": _Pool(3, np.float32, wp.vec3),
            "uvs": _Pool(2, np.float32, wp.vec2),
            "face_materials": _Pool(1, np.int32, wp.int32),
        }
        self._units: dict[int, UnitMesh] = {}

    def add(self, mesh: Mesh, face_materials: Sequence[int] | np.ndarray | None = None) -> UnitMesh:
        """Adds a mesh; it is stored once, however many instances share it.

        Args:
            mesh: mesh in object space.
            face_materials: material of each face, or None where instances decide.

        Raises:
            SceneError: if the mesh has no extent, or normals or texture coordinates are not finite.
        """
        if id(mesh) not in self._units:
            unit, vertices = _unit_mesh(mesh, len(self.rows))
            pools = self.pools
            self.keep.append(mesh)
            tree: dict[str, object]
            if self.structure is not None:
                nodes, blocks = build_structure(self.structure, vertices, mesh.faces)
                pool = pools["kd_nodes" if self.structure == "kdtree" else "tree_nodes"]
                tree = {"first_node": pool.append(nodes), "first_block": pools["tree_blocks"].append(blocks)}
            else:
                bvh = padded_mesh(vertices[mesh.faces], self.device)
                self.keep.append(bvh)
                tree = {"id": bvh.id}
            # normals are unchanged: centring and uniform scaling do not rotate them
            self.rows.append(
                {
                    **tree,
                    "first_face": pools["faces"].append(mesh.faces),
                    "face_count": len(mesh.faces),
                    "first_vertex": pools["vertices"].append(vertices),
                    "first_normal": pools["normals"].append(mesh.normals),
                    "first_uv": pools["uvs"].append(mesh.uvs),
                    "first_material": pools["face_materials"].append(face_materials),
                }
            )
            self.triangle_count += len(mesh.faces)
            self._units[id(mesh)] = unit
        return self._units[id(mesh)]


def check_mesh(mesh: Mesh) -> None:
    """Raises SceneError for values that the canonical mesh does not check."""
    for name, array in (("normals", mesh.normals), ("uvs", mesh.uvs)):
        if array is not None and not np.isfinite(array).all():
            raise SceneError(f"Mesh {mesh.source!r}: {name} hold non-finite values")
    if np.ptp(mesh.vertices[mesh.faces].reshape(-1, 3).astype(np.float64), axis=0).max() == 0.0:
        raise SceneError(f"Mesh {mesh.source!r}: all vertices lie in one point")


def padded_mesh(triangles: np.ndarray, device: str) -> wp.Mesh:
    """A Warp mesh whose tree has boxes wider than its triangles.

    Args:
        triangles: corners ``(f, 3, 3)`` float32 in ``[-1, 1]³``.
        device: device on which the tree is built.
    """
    lower, upper = triangles.min(axis=1) - _BOX_PADDING, triangles.max(axis=1) + _BOX_PADDING
    # the tree is built over the current points, and queries read the points that are set later
    points = wp.array(np.stack([lower, upper, upper], axis=1).reshape(-1, 3), dtype=wp.vec3, device=device)
    mesh = wp.Mesh(points, wp.array(np.arange(points.size, dtype=np.int32), dtype=wp.int32, device=device))
    points.assign(np.ascontiguousarray(triangles.reshape(-1, 3)))
    return mesh


def _unit_mesh(mesh: Mesh, index: int) -> tuple[UnitMesh, np.ndarray]:
    vertices = mesh.vertices.astype(np.float64)
    used = vertices[np.unique(mesh.faces)]
    lower, upper = used.min(axis=0), used.max(axis=0)
    center, scale = (lower + upper) / 2.0, float((upper - lower).max()) / 2.0
    unit = UnitMesh(index, center, scale, (lower - center) / scale, (upper - center) / scale)
    return unit, ((vertices - center) / scale).astype(np.float32)
