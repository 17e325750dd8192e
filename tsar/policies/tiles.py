"""A cut through a kd-tree over the picture, with a fixed number of leaves, that adapts to the error.

Every leaf is sampled equally, so a small leaf is sampled densely. Each keeps sums over its samples that fade with age.
The leaves of greatest error (variance times area) are split, and as many pairs of sibling leaves are merged, those
whose parents would have the least error.

Source: Dayal et al. 2005, as described in Stephens 2011, sec. 2.5 and 7.3.2.

Deviation: the original splits and merges one pair at a time from priority queues. Here all splits and merges of a cycle
are chosen at once.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import exp

import torch
from jaxtyping import Bool, Float, Float64, Int64
from torch import Tensor

from tsar.morton import deinterleave, floor_log2, morton_to_raster
from tsar.window import Window

CHANGES_PER_CYCLE = 64
LEAVES = 1024


@dataclass(frozen=True)
class TileTree:
    """A cut through a kd-tree, by kd index.

    Attributes:
        leaf: mask of the nodes in the cut.
        shown_px: pixels of the picture in each node.
        sums: sums over the samples of each node: weights that fade with age, and these times luminance, squared
            luminance and any further values; only those of leaves are in use.
    """

    leaf: Bool[Tensor, " nodes"]
    shown_px: Int64[Tensor, " nodes"]
    sums: Float[Tensor, "rows nodes"]

    @property
    def leaves(self) -> Int64[Tensor, " leaves"]:
        return self.leaf.nonzero().squeeze(1)

    @property
    def sampled(self) -> Int64[Tensor, " leaves"]:
        """Leaves that contain pixels of the picture."""
        leaves = self.leaves
        return leaves[self.shown_px[leaves] > 0]


def initial(depth: int, leaves: int, rows: int, window: Window) -> TileTree:
    """The uniform cut into ``leaves`` leaves, a power of two, through the tree over the plane of a window; its pixels
    are the nodes of ``depth``."""
    nodes = 2 ** (depth + 1)
    leaf = torch.zeros(nodes, dtype=torch.bool)
    leaf[leaves : 2 * leaves] = True
    return TileTree(leaf, _shown(depth, window), torch.zeros(rows, nodes))


def _shown(depth: int, window: Window) -> Int64[Tensor, " nodes"]:
    x, y = deinterleave(torch.arange(2**depth))
    counts = [((x < window.width_px) & (y < window.height_px)).to(torch.int64)]
    for _ in range(depth):
        counts.append(counts[-1].reshape(-1, 2).sum(1))
    return torch.cat([torch.zeros(1, dtype=torch.int64), *reversed(counts)])


def place(node: Int64[Tensor, " n"], share: Float64[Tensor, " n"], depth: int, window: Window) -> Int64[Tensor, " n"]:
    """Raster index on the picture of one pixel of each node: the one at ``share``, in [0, 1), of the node's pixels
    within the picture. They are ordered by rows, or along the curve where the picture is the whole plane."""
    first = first_cell(node, depth)
    if window.whole:
        return morton_to_raster(window.side_px)[first + (share * area_px(node, depth)).to(torch.int64)]
    x, y = deinterleave(first)
    levels = depth - floor_log2(node)
    width = (torch.ones_like(x) << ((levels + 1) // 2)).clamp(max=window.side_px)
    height = torch.ones_like(y) << (levels // 2)
    width = torch.minimum(width, window.width_px - x)
    height = torch.minimum(height, window.height_px - y)
    cell = (share * (width * height)).to(torch.int64)
    return (y + cell // width) * window.width_px + x + cell % width


def area_px(node: Int64[Tensor, " n"], depth: int) -> Int64[Tensor, " n"]:
    """Number of pixels of each node."""
    return torch.ones_like(node) << (depth - floor_log2(node))


def first_cell(node: Int64[Tensor, " n"], depth: int) -> Int64[Tensor, " n"]:
    """Morton index of the first pixel of each node; the others follow it."""
    return (node << (depth - floor_log2(node))) - 2**depth


def per_pixel(
    values: Float64[Tensor, " leaves"], tree: TileTree, depth: int, window: Window
) -> Float64[Tensor, " pixels"]:
    """Values of the leaves as a raster of the picture."""
    leaves = tree.leaves
    order = torch.argsort(first_cell(leaves, depth))
    along = values[order].repeat_interleave(area_px(leaves, depth)[order])
    raster = torch.empty_like(along)
    raster[morton_to_raster(2 ** (depth // 2))] = along
    return window.cropped(raster.reshape(window.side_px, window.side_px)).reshape(-1)


def gather(
    tree: TileTree, node: Int64[Tensor, " samples"], values: Float[Tensor, "rows samples"], memory_cycles: float
) -> TileTree:
    """Fades the sums of all leaves by one cycle, to 1/e in ``memory_cycles``, and adds new samples."""
    sums = tree.sums * exp(-1.0 / memory_cycles)
    for row, value in enumerate(values):
        sums[row].index_add_(0, node, value)
    return replace(tree, sums=sums)


def error(sums: Float[Tensor, "rows n"], node: Int64[Tensor, " n"], tree: TileTree) -> Float[Tensor, " n"]:
    """Variance times area within the picture, as a share of the plane."""
    weight = sums[0].clamp(min=1e-12)
    variance = (sums[2] / weight - (sums[1] / weight).square()).clamp(min=0.0)
    return variance * (tree.shown_px[node] / (len(tree.shown_px) // 2)).to(torch.float32)


def adapt(tree: TileTree, depth: int) -> TileTree:
    """Splits the leaves of greatest error and merges as many sibling pairs of least error, as long as a split gains
    more than a merge costs.

    Each child takes half of its parent's sums; a merged leaf takes the sums of both children. The number of leaves
    stays the same.
    """
    leaves = tree.leaves
    leaf_error = error(tree.sums[:, leaves], leaves, tree)
    left = leaves[(leaves & 1) == 0]
    left = left[tree.leaf[left + 1] & (left > 3)]
    merged_sums = tree.sums[:, left] + tree.sums[:, left + 1]
    merged_error, merge_order = torch.sort(error(merged_sums, left >> 1, tree), stable=True)
    splittable = torch.where(leaves < 2**depth, leaf_error, -1.0)
    split_error, split_order = torch.sort(splittable, descending=True, stable=True)
    changes = min(CHANGES_PER_CYCLE, left.numel(), leaves.numel())
    worth = split_error[:changes] > merged_error[:changes]
    split, pair = leaves[split_order[:changes]][worth], left[merge_order[:changes]][worth]
    # A leaf may not be split and merged in one cycle.
    clash = torch.isin(split, torch.cat((pair, pair + 1))) | torch.isin(pair >> 1, split >> 1)
    split, pair = split[~clash], pair[~clash]
    leaf, sums = tree.leaf.clone(), tree.sums.clone()
    sums[:, pair >> 1] = sums[:, pair] + sums[:, pair + 1]
    for child in (2 * split, 2 * split + 1):
        sums[:, child] = tree.sums[:, split] / 2
        leaf[child] = True
    leaf[split] = leaf[pair] = leaf[pair + 1] = False
    leaf[pair >> 1] = True
    return TileTree(leaf, tree.shown_px, sums)
