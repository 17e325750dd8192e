"""Adaptive frameless rendering: crosshairs of samples in equally sampled tiles whose size follows the variance, and a
filter over space and time whose extents follow the gradients in each tile.

A cycle samples *crosshairs*: a random position in a tile and the four positions one pixel beside it. Their differences
give the tile's spatial gradient. A deep buffer keeps all recent samples with their first hits and reprojects them to
the poses of the middle of the picture's display, as predicted from the newest ones. The difference between a new sample
and the reprojected one in its pixel gives the temporal gradient, so that it covers only changes that reprojection does
not explain. The tiles are split and merged by :mod:`tsar.policies.tiles`.

The volume of the filter is the one in which one sample is expected, ``e_x e_y e_t = 1 / R`` at a sampling rate of ``R``
samples per pixel and second. Colour changes equally along its extents, ``G_s e_x = G_s e_y = G_t e_t``, so
``e_t = (G_s² / (R G_t²))^⅓``. In a static picture old samples count, and it becomes sharp and antialiased; in a
changing one new samples from farther away count. Samples in a pixel are weighted by ``exp(-age / e_t)`` and summed.
Pixels whose sum is below one take the rest from coarser levels of a pyramid, which realises the extent in space.

Source: Dayal, Woolley, Watson and Luebke 2005, *Adaptive frameless rendering*, as described in its abstract and in
Stephens 2011, sec. 2.5 and 7.3.2.

Deviation: all samples of a crosshair are traced in one cycle, and the temporal gradient comes from the buffer, not from
a sample that is traced again. A pyramid replaces the splats of the original. Poses are predicted, as in ``tsar``.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import inf, log2

import torch
from jaxtyping import Float, Float64, Int64
from torch import Tensor

from tsar.clock import StageTimer
from tsar.config import TsarConfig
from tsar.error import compressed_luminance
from tsar.filtering.samples import COLOR_MAX
from tsar.policies import deep_buffer, tiles
from tsar.policies.deep_buffer import DeepBuffer, Placed
from tsar.policies.scatter import generator, pixel_colors, pull_push
from tsar.policies.tiles import TileTree
from tsar.policy import Moment, Picture, Policy, Price, Setting
from tsar.prediction import foretold
from tsar.types import FrameletBatch, SampleBatch, SampleMap
from tsar.window import GRID

SAMPLES_KEPT_PER_PIXEL = 4
_CROSSHAIR = torch.tensor([[0.0, 0.0], [1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0]])
_MEMORY_CYCLES = 4.0
_GOLDEN = 0.6180339887498949
_LEAST_GRADIENT = 1e-6, 1e-9  # squared gradients, per pixel and per second
_EXTENT_S = 4.0  # greatest temporal extent
_LEAST_INTERVALS = 0.1  # least temporal extent, in refresh intervals of a pixel


@dataclass(frozen=True)
class Crosshairs:
    """The requested samples: the tile of each crosshair, and the positions: the centres, then each arm in turn, then
    single samples."""

    node: Int64[Tensor, " crosshairs"]
    place: Float[Tensor, "samples 2"]


@dataclass(frozen=True)
class Sampled:
    """The tiles; the buffer, which changes in place; the reprojected samples of the buffer; and the requested
    samples."""

    tree: TileTree
    buffer: DeepBuffer
    placed: Placed | None = None
    asked: Crosshairs | None = None


class Afr(Policy[Sampled]):
    """Cycles of ``batch_size * s²`` samples, in crosshairs of five."""

    def __init__(self, setting: Setting) -> None:
        super().__init__(setting)
        self._view = setting.view

    @property
    def footprint(self) -> float:
        """2, as samples of a pixel are averaged: it had the least error of 1, 2 and 4."""
        return 2.0

    @property
    def price(self) -> Price:
        """Per pixel: projection and summation of the buffer's samples (weight 3, sums 7), their limit of depth, and the
        pyramid: up 20, down 26, times 4/3, with means 4. Per sample: replacement of non-finite values 6, luminance 10,
        gradients 14, sums of tiles 12, comparison 8."""
        stored = SAMPLES_KEPT_PER_PIXEL * (deep_buffer.SAMPLE_FLOPS + 10)
        return Price(int(self.config.budget), pixel_flops=stored + deep_buffer.PIXEL_FLOPS + 65, sample_flops=50)

    @property
    def _depth(self) -> int:
        return 2 * (self.config.resolution_px.bit_length() - 1)

    def start(self) -> Sampled:
        room = SAMPLES_KEPT_PER_PIXEL * self.config.pixels
        return Sampled(tiles.initial(self._depth, tiles.LEAVES, 6, self.config.window), DeepBuffer.empty(room))

    def request(self, state: Sampled, moment: Moment) -> tuple[Sampled, FrameletBatch]:
        """Crosshairs in successive tiles, and single samples at random positions for the remainder of the batch."""
        config = self.config
        node, place = draw(state.tree, self._depth, config, moment.cycle)
        nothing = torch.zeros(config.batch_size, dtype=torch.int64)
        batch = FrameletBatch(
            nothing,
            nothing,
            place.reshape(-1, config.samples, 2),
            moment.time_s,
            cycle=moment.cycle,
            seed=config.seed,
            hits=self._view is not None,
        )
        return replace(state, asked=Crosshairs(node, place)), batch

    def observe(
        self, state: Sampled, batch: FrameletBatch, samples: SampleBatch, moment: Moment, timer: StageTimer
    ) -> Sampled:
        assert state.asked is not None
        shape, buffer = self.config.shape, state.buffer
        view = foretold(self._view, moment.time_s, moment.cycle_s) if self._view is not None else None
        color = pixel_colors(samples, self.config).clamp(max=COLOR_MAX)
        with timer("cache"):
            buffer.add(color, moment.time_s, state.asked.place, samples.hits)
            placed = buffer.seen(view, shape)
        with timer("error"):
            values = _values(buffer, placed, state.asked, color, moment.time_s, shape)
        with timer("response"):
            node = state.asked.node.repeat(len(_CROSSHAIR))
            tree = tiles.adapt(tiles.gather(state.tree, node, values, _MEMORY_CYCLES), self._depth)
        return Sampled(tree, buffer, placed)

    def image(self, state: Sampled, moment: Moment) -> Picture:
        assert state.placed is not None
        config, shape, pixels = self.config, self.config.shape, self.config.pixels
        extent_s = extents(state.tree, self._depth, config, moment.cycle_s)
        extent_s = tiles.per_pixel(extent_s, state.tree, self._depth, config.window)
        sample, pixel = state.placed.sample, state.placed.pixel
        time_s = state.buffer.time_s.index_select(0, sample)
        weight = torch.exp((time_s - moment.time_s) / extent_s.index_select(0, pixel)).to(torch.float32)
        total = torch.zeros(pixels).index_add_(0, pixel, weight)
        weighted = state.buffer.color.index_select(0, sample) * weight[:, None]
        color = torch.zeros(pixels, 3).index_add_(0, pixel, weighted)
        color = (color / total.clamp(min=1e-12)[:, None]).T.reshape(3, *shape).contiguous()
        image = pull_push(color, total.clamp(max=1.0).reshape(1, *shape)).permute(1, 2, 0).contiguous()
        newest_s = torch.full((pixels,), -inf, dtype=torch.float64).scatter_reduce(0, pixel, time_s, "amax")
        level = torch.full(shape, int(log2(config.resolution_px / config.framelet_side)))
        return Picture(image, SampleMap(newest_s.reshape(shape), level))


def draw(
    tree: TileTree, depth: int, config: TsarConfig, cycle: int
) -> tuple[Int64[Tensor, " crosshairs"], Float[Tensor, "samples 2"]]:
    """Tile of each crosshair and all sample positions of a cycle.

    Tiles are visited in steps of the golden ratio along the curve, which spreads those of a cycle over the picture.
    Arms that leave the picture are reflected.
    """
    count = int(config.budget)
    crosshairs, random = count // len(_CROSSHAIR), generator(config, cycle)
    leaves = tree.sampled
    turn = cycle * crosshairs + torch.arange(crosshairs, dtype=torch.float64)
    node = leaves[((turn * _GOLDEN) % 1.0 * leaves.numel()).to(torch.int64)]
    height, width = config.shape
    share = torch.rand(crosshairs, generator=random, dtype=torch.float64)
    pixel = tiles.place(node, share, depth, config.window)
    centre = torch.stack((pixel % width, pixel // width), dim=1) + torch.rand(crosshairs, 2, generator=random)
    arms, size = (centre + _CROSSHAIR[:, None]).reshape(-1, 2), centre.new_tensor((width, height))
    arms = torch.where(arms < 0.0, arms + 2.0, torch.where(arms >= size, arms - 2.0, arms))
    single = torch.rand(count - len(arms), 2, generator=random) * size
    places = (torch.cat((arms, single)) * (GRID // config.resolution_px)).floor() / GRID
    return node, config.window.of_picture(places)


def extents(tree: TileTree, depth: int, config: TsarConfig, cycle_s: float) -> Float64[Tensor, " leaves"]:
    """Temporal extent ``e_t`` of the filter of each tile, seconds."""
    leaves = tree.leaves
    sums = tree.sums[:, leaves].to(torch.float64)
    spatial = sums[3] / sums[0].clamp(min=1e-9) + _LEAST_GRADIENT[0]
    temporal = torch.where(sums[5] > 0.0, sums[4].clamp(min=0.0) / sums[5].clamp(min=1e-12), 1.0) + _LEAST_GRADIENT[1]
    interval_s = tree.shown_px[leaves].to(torch.float64) * tree.sampled.numel() / config.budget * cycle_s
    least = _LEAST_INTERVALS * interval_s.clamp(min=cycle_s)
    return (spatial / temporal * interval_s).pow(1.0 / 3.0).clamp(max=_EXTENT_S).maximum(least)


def _values(
    buffer: DeepBuffer,
    placed: Placed,
    asked: Crosshairs,
    color: Float[Tensor, "samples 3"],
    now_s: float,
    shape: tuple[int, int],
) -> Float[Tensor, "6 arms"]:
    """Values of the crosshairs' samples that tiles accumulate: weight, luminance and its square; squared spatial
    gradient; squared change since the newest sample that the buffer held in the pixel, and the square of that sample's
    age."""
    arms = len(_CROSSHAIR) * asked.node.numel()
    luminance = compressed_luminance(color)[:arms]
    centre, right, left, below, above = luminance.reshape(len(_CROSSHAIR), -1)
    across = torch.maximum((right - centre).abs(), (left - centre).abs())
    down = torch.maximum((below - centre).abs(), (above - centre).abs())
    spatial = (0.5 * (across.square() + down.square())).repeat(len(_CROSSHAIR))
    place = asked.place[:arms]
    column, row = (place * place.new_tensor(shape[::-1])).to(torch.int64).unbind(1)
    rank = (buffer.time_s.index_select(0, placed.sample) < now_s).nonzero().squeeze(1)
    newest = torch.full((shape[0] * shape[1],), -1).scatter_reduce(0, placed.pixel.index_select(0, rank), rank, "amax")
    newest = newest[row * shape[1] + column]
    held = newest >= 0
    change, age_s = torch.zeros(arms), torch.zeros(arms)
    before = placed.sample[newest[held]]
    old = compressed_luminance(buffer.color[before])
    change[held] = (luminance[held] - old).square()
    age_s[held] = (now_s - buffer.time_s[before]).to(torch.float32)
    return torch.stack((torch.ones(arms), luminance, luminance.square(), spatial, change, age_s.square()))
