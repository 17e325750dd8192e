"""Alternatives to the tree of boxes over a mesh's triangles: a kd-tree, or no structure.

They serve comparisons. All structures hold the same triangles, and the kernels use the same triangle test
(``native/structures.h``), so all give the same pictures. There is one exception: whether a ray hits a triangle so small
that float32 hardly separates its corners depends on rounding, and a structure may cull it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
from jaxtyping import Float, Int
from numpy.typing import NDArray

from renderer.layout.kinds import StructureKind
from renderer.layout.sizes import BLOCK_FLOATS, BLOCK_WIDTH, KD_DEPTH_MAX, KD_FLOATS, KD_LEAF
from renderer.tables.trees import build_tree

Structure = Literal["bvh", "kdtree", "brute"]
STRUCTURES: tuple[Structure, ...] = get_args(Structure)

CANDIDATES = 32
"""Number of candidate planes along each axis of a node."""
LEAF_TRIANGLES = 9
"""Greatest number of triangles of a node that is not split further."""
TRAVERSAL_COST, TEST_COST = 1.0, 1.0
"""Costs of a node visit and of a triangle test in the surface area heuristic."""

_KD_NODE = np.dtype([("split", np.float32), ("axis", np.int32), ("first", np.int32), ("count", np.int32)])


@dataclass(frozen=True, eq=False)
class KdTree:
    """Records of ``native/structures.h``.

    Attributes:
        nodes: ``(n,)`` records of split, axis (3 for a leaf), first child or block, and number of triangles.
        blocks: ``(m, 40)`` blocks of one to four triangles.
        depth: depth of the deepest leaf; the root has depth 0.
    """

    nodes: NDArray[np.void]
    blocks: Float[NDArray[np.float32], "m 40"]
    depth: int


def number_of(structure: Structure) -> int:
    """The number of a structure in kernels."""
    return StructureKind[structure.upper()]


def build_structure(
    structure: Structure, vertices: Float[NDArray[np.float32], "v 3"], faces: Int[NDArray[np.int32], "f 3"]
) -> tuple[NDArray[np.float32] | None, Float[NDArray[np.float32], "m 40"]]:
    """The nodes of a structure over a mesh as floats, and its blocks; ``brute`` has no nodes."""
    if structure == "bvh":
        tree = build_tree(vertices, faces)
        return tree.nodes, tree.blocks
    if structure == "kdtree":
        kd = build_kdtree(vertices, faces)
        return kd.nodes.view(np.float32).reshape(-1, KD_FLOATS), kd.blocks
    triangles = np.asarray(vertices, np.float32)[faces]
    return None, _blocks(triangles, np.arange(len(faces)), np.array([0]), np.array([len(faces)]))[0]


def build_kdtree(vertices: Float[NDArray[np.float32], "v 3"], faces: Int[NDArray[np.int32], "f 3"]) -> KdTree:
    """A kd-tree by the surface area heuristic, level by level.

    A node of ten triangles or more is split, down to a depth of 20, by the cheapest of 32 evenly spaced planes along
    each axis, where ``cost = traversal + (area below · triangles below + area above · triangles above) / area · test``.
    It stays a leaf where testing all of its triangles costs no more than the cheapest split.

    Deviation: triangles are counted and sorted by their boxes, clipped to the node, not by their exact shape.

    Source: Olszewski, "Distribution Ray Tracing", section on spatial subdivision.
    """
    triangles = np.asarray(vertices, np.float32)[faces].astype(np.float64)
    lower, upper = triangles.min(axis=1), triangles.max(axis=1)
    # the nodes of the level that is being split, and the triangles of each
    box = np.stack([lower.min(axis=0), upper.max(axis=0)])[None]
    owner, item = np.zeros(len(faces), np.int64), np.arange(len(faces))
    levels: list[NDArray[np.void]] = []
    leaf_items: list[tuple[NDArray[np.int64], NDArray[np.int64]]] = []
    index = np.zeros(1, np.int64)  # indices of the level's nodes among all nodes
    used, depth = 1, 0
    while len(index):
        counts = np.bincount(owner, minlength=len(index))
        axis, plane = _cheapest(box, owner, lower[item], upper[item], counts)
        splits = (counts > LEAF_TRIANGLES) & (depth < KD_DEPTH_MAX) & (axis < KD_LEAF)
        row = np.zeros(len(index), _KD_NODE)
        row["axis"] = np.where(splits, axis, KD_LEAF)
        row["split"] = np.where(splits, plane, 0.0)
        row["first"] = np.where(splits, used + 2 * (np.cumsum(splits) - 1), -1)
        row["count"] = np.where(splits, 0, counts)
        levels.append(row)
        kept = ~splits[owner]
        leaf_items.append((index[owner[kept]], item[kept]))
        box, owner, item = _divided(box, owner, item, lower, upper, splits, row)
        index = used + np.arange(len(box))
        used += len(box)
        depth += bool(len(box))
    nodes = np.concatenate(levels)
    leaf, held = (np.concatenate(part) for part in zip(*leaf_items, strict=True))
    order = np.lexsort((held, leaf))
    leaf, held = leaf[order], held[order]
    leaves = np.flatnonzero(nodes["axis"] == KD_LEAF)
    first = np.searchsorted(leaf, leaves)
    blocks, first_block = _blocks(triangles.astype(np.float32), held, first, nodes["count"][leaves])
    nodes["first"][leaves] = first_block
    return KdTree(nodes, blocks, depth)


def _cheapest(
    box: NDArray[np.float64],
    owner: NDArray[np.int64],
    lower: NDArray[np.float64],
    upper: NDArray[np.float64],
    counts: NDArray[np.int64],
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Axis and position of every node's cheapest plane; axis 3 where splitting is not cheaper than testing all
    triangles."""
    nodes = len(box)
    extent = box[:, 1] - box[:, 0]
    whole = _area(extent)
    best = np.full(nodes, np.inf)
    axis_of, plane_of = np.full(nodes, KD_LEAF), np.zeros(nodes)
    share = np.arange(1, CANDIDATES + 1) / (CANDIDATES + 1.0)
    for axis in range(3):
        planes = box[:, 0, axis, None] + share * extent[:, axis, None]
        # a triangle is below all planes after the last one that it lies entirely above, and vice versa
        width = np.where(extent[:, axis] > 0.0, extent[:, axis], 1.0)[owner]
        spot = np.stack([lower[:, axis], upper[:, axis]]) - box[owner, 0, axis]
        cell = np.clip(spot / width * (CANDIDATES + 1), -1.0, CANDIDATES + 1.0)
        start = np.clip(np.floor(cell[0]).astype(np.int64), 0, CANDIDATES)
        end = np.clip(np.ceil(cell[1]).astype(np.int64) - 1, 0, CANDIDATES)
        bins = nodes * (CANDIDATES + 1)
        started = np.bincount(owner * (CANDIDATES + 1) + start, minlength=bins).reshape(nodes, -1)
        ended = np.bincount(owner * (CANDIDATES + 1) + end, minlength=bins).reshape(nodes, -1)
        below = np.cumsum(started, axis=1)[:, :-1]
        above = counts[:, None] - np.cumsum(ended, axis=1)[:, :-1]
        sides = [np.repeat(extent[:, None], CANDIDATES, axis=1) for _ in range(2)]
        sides[0][:, :, axis] = planes - box[:, 0, axis, None]
        sides[1][:, :, axis] = box[:, 1, axis, None] - planes
        hits = (_area(sides[0]) * below + _area(sides[1]) * above) / np.maximum(whole, 1e-300)[:, None]
        cost = np.where(
            (below < counts[:, None]) | (above < counts[:, None]), TRAVERSAL_COST + TEST_COST * hits, np.inf
        )
        cost[extent[:, axis] <= 0.0] = np.inf
        choice = cost.argmin(axis=1)
        value = cost[np.arange(nodes), choice]
        better = value < best
        best = np.where(better, value, best)
        axis_of = np.where(better, axis, axis_of)
        plane_of = np.where(better, planes[np.arange(nodes), choice], plane_of)
    axis_of[best >= TEST_COST * counts] = KD_LEAF  # testing all triangles costs no more
    return axis_of, plane_of.astype(np.float32).astype(np.float64)


def _area(extent: NDArray[np.float64]) -> NDArray[np.float64]:
    """Surface area of boxes, ``2 (hw + hd + wd)``."""
    x, y, z = np.moveaxis(extent, -1, 0)
    return 2.0 * (x * y + y * z + z * x)


def _divided(
    box: NDArray[np.float64],
    owner: NDArray[np.int64],
    item: NDArray[np.int64],
    lower: NDArray[np.float64],
    upper: NDArray[np.float64],
    splits: NDArray[np.bool_],
    row: NDArray[np.void],
) -> tuple[NDArray[np.float64], NDArray[np.int64], NDArray[np.int64]]:
    """Boxes of the next level in pairs, and the triangles of each; those that touch a plane are on both sides."""
    chosen = np.flatnonzero(splits)
    axis, plane = row["axis"][chosen], row["split"][chosen].astype(np.float64)
    below, above = box[chosen].copy(), box[chosen].copy()
    below[np.arange(len(chosen)), 1, axis] = plane
    above[np.arange(len(chosen)), 0, axis] = plane
    boxes = np.stack([below, above], axis=1).reshape(-1, 2, 3)
    number = np.cumsum(splits) - 1
    held = splits[owner]
    owner, item = owner[held], item[held]
    split_axis, at = row["axis"][owner], row["split"][owner].astype(np.float64)
    down, up = lower[item, split_axis] <= at, upper[item, split_axis] >= at
    parents = number[owner]
    owners = np.concatenate([2 * parents[down], 2 * parents[up] + 1])
    return boxes, owners, np.concatenate([item[down], item[up]])


def _blocks(
    triangles: NDArray[np.float32], held: NDArray[np.int64], first: NDArray[np.int64], count: NDArray[np.int64]
) -> tuple[Float[NDArray[np.float32], "m 40"], NDArray[np.int64]]:
    """Blocks of four for runs of triangles, and the first block of each run."""
    blocks_of = -(-count // BLOCK_WIDTH)
    first_block = np.cumsum(blocks_of) - blocks_of
    run = np.repeat(np.arange(len(count)), count)
    within = np.arange(len(run)) - np.repeat(np.cumsum(count) - count, count)
    slot = first_block[run] * BLOCK_WIDTH + within
    faces = np.full(int(blocks_of.sum()) * BLOCK_WIDTH, -1, np.int32)
    corners = np.zeros((len(faces), 3, 3), np.float32)
    chosen = held[first[run] + within]
    faces[slot], corners[slot] = chosen, triangles[chosen]
    blocks = np.empty((len(faces) // BLOCK_WIDTH, BLOCK_FLOATS), np.float32)
    corner_floats = 9 * BLOCK_WIDTH
    blocks[:, :corner_floats] = np.moveaxis(corners.reshape(-1, BLOCK_WIDTH, 3, 3), 1, 3).reshape(-1, corner_floats)
    blocks[:, corner_floats:] = faces.reshape(-1, BLOCK_WIDTH).view(np.float32)
    return blocks, first_block
