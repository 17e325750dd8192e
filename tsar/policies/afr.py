"""Adaptive frameless rendering: single samples drawn from tiles of equal probability whose size follows variance.

A kd-tree cut of a fixed number of leaves is kept. Every leaf receives the same number of samples a cycle, so a small
leaf is sampled densely. Each keeps age-weighted moments of luminance; the leaves of greatest error (variance times
area) are split, and sibling leaves whose merger would have the least are merged, as many as were split.

Source: Dayal et al. 2005, as described in Stephens 2011, sec. 2.5 and 7.3.2.

Deviation: the original splits and merges one pair at a time from priority queues and reconstructs with per-tile
gradient filters. Here all splits and mergers of a cycle are picked at once, and an image is filled from the newest
samples, each weighted down with its age in units of its leaf's refresh interval, by pull and push over a pyramid.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import exp

import torch
from jaxtyping import Bool, Float, Int64
from torch import Tensor

from tsar.clock import StageTimer
from tsar.config import TsarConfig
from tsar.error import compressed_luminance
from tsar.morton import floor_log2, morton_to_raster
from tsar.policies.scatter import PixelBuffer, generator, pixel_batch, pixel_colors, pull_push, sample_map, write
from tsar.policy import Moment, Picture, Policy
from tsar.types import FrameletBatch, SampleBatch

LEAVES = 1024
CHANGES_PER_CYCLE = 64
_MEMORY_CYCLES = 8.0


@dataclass(frozen=True)
class Tree:
    """A cut through a kd-tree, by kd index.

    Attributes:
        leaf: which nodes are in the cut.
        moments: per node, age-weighted sum of weight, luminance and squared luminance; only leaves' are in use.
    """

    leaf: Bool[Tensor, " nodes"]
    moments: Float[Tensor, "3 nodes"]


@dataclass(frozen=True)
class Scattered:
    """The tree, the newest sample of each pixel, and the leaves and pixels that were asked for.

    Frozen, but the buffer within changes in place.
    """

    tree: Tree
    buffer: PixelBuffer
    node: Int64[Tensor, " samples"] | None = None
    pixel: Int64[Tensor, " samples"] | None = None


class Afr(Policy[Scattered]):
    """Cycles of ``batch_size * s²`` samples, as many in every leaf."""

    @property
    def _depth(self) -> int:
        return 2 * (self.config.resolution_px.bit_length() - 1)

    def start(self) -> Scattered:
        return Scattered(_initial(self._depth), PixelBuffer.empty(self.config))

    def request(self, state: Scattered, moment: Moment) -> tuple[Scattered, FrameletBatch]:
        node, pixel = draw(state.tree, int(self.config.budget), self._depth, self.config, moment.cycle)
        return replace(state, node=node, pixel=pixel), pixel_batch(pixel, self.config, moment)

    def observe(
        self, state: Scattered, batch: FrameletBatch, samples: SampleBatch, moment: Moment, timer: StageTimer
    ) -> Scattered:
        assert state.node is not None and state.pixel is not None
        color = pixel_colors(samples, self.config)
        with timer("cache"):
            write(state.buffer, state.pixel, color, moment.time_s)
        with timer("response"):
            gathered = gather(state.tree, state.node, compressed_luminance(color))
            return replace(state, tree=adapt(gathered, self._depth))

    def image(self, state: Scattered, moment: Moment) -> Picture:
        image = _image(state.tree, state.buffer, self.config, self._depth, moment.time_s, moment.cycle_s)
        return Picture(image, sample_map(state.buffer, self.config))


def _initial(depth: int) -> Tree:
    nodes = 2 ** (depth + 1)
    leaf = torch.zeros(nodes, dtype=torch.bool)
    leaf[LEAVES : 2 * LEAVES] = True
    return Tree(leaf, torch.zeros(3, nodes))


def draw(
    tree: Tree, count: int, depth: int, config: TsarConfig, cycle: int
) -> tuple[Int64[Tensor, " samples"], Int64[Tensor, " samples"]]:
    """Leaf and raster pixel of each sample: leaves in turn, a uniformly random pixel within each."""
    leaves = tree.leaf.nonzero().squeeze(1)
    node = leaves[torch.arange(count) % leaves.numel()]
    shift = depth - floor_log2(node)
    first = (node << shift) - 2**depth
    uniform = torch.rand(count, generator=generator(config, cycle), dtype=torch.float64)
    cell = first + (uniform * (torch.ones_like(shift) << shift)).to(torch.int64)
    return node, morton_to_raster(config.resolution_px)[cell]


def gather(tree: Tree, node: Int64[Tensor, " samples"], luminance: Float[Tensor, " samples"]) -> Tree:
    """Fade the moments of all leaves by one cycle and add the new samples."""
    moments = tree.moments * exp(-1.0 / _MEMORY_CYCLES)
    for row, value in enumerate((torch.ones_like(luminance), luminance, luminance.square())):
        moments[row].index_add_(0, node, value)
    return replace(tree, moments=moments)


def error(moments: Float[Tensor, "3 n"], node: Int64[Tensor, " n"]) -> Float[Tensor, " n"]:
    """Variance times area; area in units of the image."""
    weight = moments[0].clamp(min=1e-12)
    variance = (moments[2] / weight - (moments[1] / weight).square()).clamp(min=0.0)
    return variance * torch.exp2(-floor_log2(node).to(torch.float32))


def adapt(tree: Tree, depth: int) -> Tree:
    """Split the worst leaves and merge as many of the best sibling pairs, while a split gains more than a merger costs.

    Children take half their parent's moments each; a merged leaf takes the sum. The number of leaves stays the same.
    """
    leaves = tree.leaf.nonzero().squeeze(1)
    leaf_error = error(tree.moments[:, leaves], leaves)
    left = leaves[(leaves & 1) == 0]
    left = left[tree.leaf[left + 1] & (left > 3)]
    merged_moments = tree.moments[:, left] + tree.moments[:, left + 1]
    merged_error, merge_order = torch.sort(error(merged_moments, left >> 1), stable=True)
    splittable = torch.where(leaves < 2**depth, leaf_error, -1.0)
    split_error, split_order = torch.sort(splittable, descending=True, stable=True)
    changes = min(CHANGES_PER_CYCLE, left.numel(), leaves.numel())
    worth = split_error[:changes] > merged_error[:changes]
    split, pair = leaves[split_order[:changes]][worth], left[merge_order[:changes]][worth]
    # A leaf may not be split and merged in one cycle.
    clash = torch.isin(split, torch.cat((pair, pair + 1))) | torch.isin(pair >> 1, split >> 1)
    split, pair = split[~clash], pair[~clash]
    leaf, moments = tree.leaf.clone(), tree.moments.clone()
    moments[:, pair >> 1] = moments[:, pair] + moments[:, pair + 1]
    for child in (2 * split, 2 * split + 1):
        moments[:, child] = tree.moments[:, split] / 2
        leaf[child] = True
    leaf[split] = leaf[pair] = leaf[pair + 1] = False
    leaf[pair >> 1] = True
    return Tree(leaf, moments)


def _image(
    tree: Tree, buffer: PixelBuffer, config: TsarConfig, depth: int, now_s: float, cycle_s: float
) -> Float[Tensor, "h w 3"]:
    """Newest samples weighted by ``exp(-age / refresh interval of the leaf)``, filled by pull and push."""
    leaves = tree.leaf.nonzero().squeeze(1)
    area = 2.0 ** (depth - floor_log2(leaves).to(torch.float64))
    start = (leaves << (depth - floor_log2(leaves))) - 2**depth
    order = torch.argsort(start)
    interval_s = area * leaves.numel() / config.budget * cycle_s
    per_cell = interval_s[order].repeat_interleave(area[order].to(torch.int64))
    per_pixel = torch.empty_like(per_cell)
    per_pixel[morton_to_raster(config.resolution_px)] = per_cell
    weight = torch.exp((buffer.time_s - now_s) / per_pixel).to(torch.float32)
    side = config.resolution_px
    color = buffer.color.reshape(side, side, 3).permute(2, 0, 1)
    return pull_push(color, weight.reshape(1, side, side)).permute(1, 2, 0).contiguous()
