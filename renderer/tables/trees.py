"""Trees of boxes over the triangles of a mesh, for the kernels of ``packets.py``."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import warp as wp
from numpy.typing import ArrayLike, NDArray

from renderer.compute import device as devices
from renderer.compute.launching import shared
from renderer.kernels import packets
from renderer.layout.sizes import BLOCK_FLOATS, NODE_FLOATS

_LINE_FLOATS = 16  # size of a cache line
_COORDINATE_MAX = 1.0e18
_FACES_MAX = (1 << 25) - 1  # their nodes fill the largest array that Warp can address


@dataclass(frozen=True, eq=False)
class Tree:
    """Records of ``native/tree.h``, laid out as floats.

    Attributes:
        nodes: ``(n, 64)`` boxes of eight children, and references to these.
        blocks: ``(m, 40)`` blocks of one to four triangles.
    """

    nodes: NDArray[np.float32]
    blocks: NDArray[np.float32]


def build_tree(vertices: ArrayLike, faces: ArrayLike) -> Tree:
    """Builds a tree on the CPU, in ``O(f log f)``.

    Args:
        vertices: ``(v, 3)`` finite, best within ``[-1, 1]³``.
        faces: ``(f, 3)`` indices of corners, at least one face.

    Returns:
        The tree; the same mesh gives the same bits.

    Raises:
        ValueError: if the mesh has no faces or too many, an index is out of range, or a used vertex is not finite or so
            large that areas overflow.
    """
    points = np.ascontiguousarray(vertices, np.float32)
    corners = np.ascontiguousarray(faces, np.int32)
    if points.ndim != 2 or points.shape[1] != 3 or corners.ndim != 2 or corners.shape[1] != 3 or not len(corners):
        raise ValueError(f"mesh: expected vertices (v, 3) and faces (f, 3), got {points.shape} and {corners.shape}")
    if corners.min() < 0 or corners.max() >= len(points):
        raise ValueError(f"faces: expected indices below {len(points)}, got {corners.min()} to {corners.max()}")
    if not (np.abs(points[corners]) < _COORDINATE_MAX).all():
        raise ValueError(f"vertices: expected finite numbers below {_COORDINATE_MAX:g}")
    count = len(corners)
    if count > _FACES_MAX:
        raise ValueError(f"faces: expected at most {_FACES_MAX:,}, got {count:,}")
    # As many nodes as faces suffice: below the root every node has at least two children. Untouched pages cost nothing,
    # and unused nodes are zero.
    nodes, blocks = np.zeros(count * NODE_FLOATS, np.float32), np.zeros(count * BLOCK_FLOATS, np.float32)
    boxes, order, used = np.empty(6 * count, np.float32), np.empty(count, np.int32), np.zeros(2, np.int32)
    scratch = boxes, order, nodes, blocks, used
    devices.load_kernels(packets, "cpu")
    arrays = [shared(points, wp.vec3), shared(corners, wp.vec3i)]
    arrays += [shared(values, wp.float32 if values.dtype == np.float32 else wp.int32) for values in scratch]
    wp.launch(packets.build_tree, dim=1, inputs=arrays, device="cpu")
    return Tree(
        nodes.reshape(-1, NODE_FLOATS)[: used[0]].copy(),
        blocks.reshape(-1, BLOCK_FLOATS)[: used[1]].copy(),
    )


def aligned(values: NDArray[np.float32]) -> NDArray[np.float32]:
    """A flat copy that is aligned to cache lines, as nodes should be."""
    room = np.empty(values.size + _LINE_FLOATS, np.float32)
    first = -room.ctypes.data // 4 % _LINE_FLOATS
    room[first : first + values.size] = values.reshape(-1)
    return room[first : first + values.size]
