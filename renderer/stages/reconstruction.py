"""Reconstruction of an image from cached framelets of many ages and sizes, as CPU kernels, in one pass over bands of
rows that threads share."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from renderer.compute import device as devices
from renderer.compute.launching import Command, address, require_same
from renderer.compute.memory import Memory
from renderer.compute.sizes import LANES
from renderer.compute.team import TEAM
from renderer.stages import reconstruction_kernels as kernels
from renderer.stages.ages import DisplayPlan
from renderer.stages.coverage import covers
from renderer.stages.sizes import PLANES
from renderer.stages.views import PerCache, point_at_cache
from tsar.cache import FrameletCache
from tsar.config import TsarConfig
from tsar.morton import first_node, raster_to_morton
from tsar.reconstruction import Reconstruction, spatial_weights
from tsar.stages import REFERENCE
from tsar.types import SampleMap

_BAND_PIXELS = 1 << 15
"""Number of pixels of a band, 20 bytes each: about as many as fit into a second-level cache with the framelets."""
_BAND_ROWS_LEAST = 8
_SPARE = LANES
"""Padding of arrays that are read or written this many elements at a time."""


@dataclass(frozen=True)
class _Launches:
    """Launches recorded for a cache; one of ``paint`` per thread."""

    find: Command
    paint: list[Command]
    bury: Command


class Reconstructor:
    """Reconstruction for one configuration. Holds constants, recorded launches and working memory, but no state of a
    run."""

    def __init__(self, config: TsarConfig, threads: int = 1) -> None:
        """Prepares launches for ``threads`` threads."""
        devices.load_kernels(kernels, "cpu")
        self.config, self._covered = config, covers(config, "reconstruct")
        self._cells = 2**config.level_max
        self._memory = Memory()
        self._plan = self._make_plan()
        self._count, self._taken, self._overdraw = np.zeros(1, np.int32), np.zeros(1, np.int32), np.zeros(1)
        threads = min(threads, config.resolution_px // self._plan.band)
        self._holes = np.zeros(threads, np.int32)
        self._workers = [self._make_worker(number) for number in range(threads)]
        self._per_cache = PerCache(self._record)

    def reconstruct(self, cache: FrameletCache, config: TsarConfig, cycle_s: float) -> Reconstruction:
        """Like :func:`tsar.reconstruction.reconstruct`, which is called for an image with holes and for configurations
        that are not covered."""
        require_same(config, self.config)
        if not self._covered:
            return REFERENCE.reconstruct(cache, config, cycle_s)
        launches = self._per_cache(cache)
        newest_s = torch.empty(self._cells, self._cells, dtype=torch.float64)
        level = torch.empty(self._cells, self._cells, dtype=torch.int64)
        image = torch.empty(config.resolution_px, config.resolution_px, 3)
        cells, pixels = self._cells**2, address("image", image, torch.float32, 3 * config.resolution_px**2)
        launches.find(
            cycle_s, address("newest_s", newest_s, torch.float64, cells), address("level", level, torch.int64, cells)
        )
        self._taken[0] = 0
        for paint in launches.paint:
            paint.set(self._count[0], pixels)
        TEAM.run(launches.paint)
        if self._holes.any():
            return REFERENCE.reconstruct(cache, config, cycle_s)
        launches.bury()
        return Reconstruction(image, SampleMap(newest_s, level), float(self._overdraw[0]))

    def _record(self, cache: FrameletCache) -> _Launches:
        view = kernels.CachedFramelets()
        point_at_cache(view, cache, self.config)
        taken = address("taken", self._taken, torch.int32, 1)
        count = address("count", self._count, torch.int32, 1)
        overdraw = address("overdraw", self._overdraw, torch.float64, 1)
        return _Launches(
            Command(kernels.find_candidates, self._plan, view, count),
            [Command(kernels.paint_bands, self._plan, view, worker, taken) for worker in self._workers],
            Command(kernels.bury_dead, self._plan, view, overdraw),
        )

    def _make_plan(self) -> DisplayPlan:
        config, plan, keep, zeros = self.config, DisplayPlan(), self._memory.keep, self._memory.zeros
        side, low, high = config.framelet_side, config.level_min, config.level_max
        resolution, cells, slots = config.resolution_px, self._cells, config.cache_slots
        plan.resolution, plan.level_low, plan.level_high, plan.side = resolution, low, high, side
        plan.half = config.reconstruction.age_support_px // 2
        plan.band = min(max(_BAND_PIXELS // resolution, _BAND_ROWS_LEAST), resolution)
        axes = [_axis(side, resolution >> level) for level in range(low, high + 1)]
        length = sum(axis[0].numel() for axis in axes) + _SPARE
        for place, name in enumerate(("left", "right", "share_left", "share_right", "weight")):
            values = torch.cat([*(axis[place] for axis in axes), axes[0][place].repeat(_SPARE)[:_SPARE]])
            setattr(plan, name, keep(name, values, torch.float32 if place > 1 else torch.int32, length))
        lengths = torch.tensor([0, *(axis[0].numel() for axis in axes)], dtype=torch.int32)
        first = torch.cumsum(lengths, 0, dtype=torch.int32)
        plan.first = keep("first", first, torch.int32, len(axes) + 1)
        margins = [(axis[0].numel() - (resolution >> level)) // 2 for level, axis in enumerate(axes, low)]
        plan.margin = keep("margin", torch.tensor(margins, dtype=torch.int32), torch.int32, len(axes))
        width = resolution // cells
        plan.reach = -(-plan.half // width) - (-max(margins) // width)
        plan.order = keep("order", raster_to_morton(side).to(torch.int32), torch.int32, side**2)
        nodes = first_node(high + 1)
        plan.node_time = zeros("node_time", nodes, torch.float64)
        plan.node_level = zeros("node_level", nodes, torch.int32)
        plan.cell_age = zeros("cell_age", cells**2)
        plan.cell_least = zeros("cell_least", 2 * cells**2)
        plan.row_integral = zeros("row_integral", resolution + 2 * plan.half + 1, torch.float64)
        plan.row_sum = zeros("row_sum", cells * resolution, torch.float64)
        plan.slot_age = zeros("slot_age", slots)
        plan.candidate = zeros("candidate", slots, torch.int32)
        plan.seen = zeros("seen", slots, torch.int32)
        return plan

    def _make_worker(self, number: int) -> kernels.Worker:
        config, worker, zeros = self.config, kernels.Worker(), self._memory.zeros
        resolution, side = config.resolution_px, config.framelet_side
        widest = max(2 * side, 2 * (resolution >> config.level_min))
        planes, rows = PLANES * self._plan.band * resolution, 3 * side * widest
        worker.planes = zeros(f"planes {number}", planes + _SPARE)
        worker.rows = zeros(f"rows {number}", rows + _SPARE)
        worker.samples = zeros(f"samples {number}", 3 * side**2)
        worker.box = zeros(f"box {number}", resolution, torch.float64)
        worker.ages = zeros(f"ages {number}", resolution)
        worker.result = address("holes", self._holes[number : number + 1], torch.int32, 1)
        return worker


def _axis(side: int, width_px: int) -> tuple[Tensor, ...]:
    """For each pixel of a tile along an axis, including its margin: the two samples around it, their weights, and the
    total weight."""
    if width_px <= side:
        pixel = torch.arange(width_px, dtype=torch.int32)
        return pixel, pixel, torch.ones(width_px), torch.zeros(width_px), torch.ones(width_px)
    weights, _ = spatial_weights(side, width_px)
    total = weights.sum(1)
    unit = weights / total[:, None]
    left = (unit > 0).to(torch.int32).argmax(1)
    right = (left + 1).clamp(max=side - 1)
    share_left = unit.gather(1, left[:, None]).squeeze(1)
    share_right = torch.where(right > left, unit.gather(1, right[:, None]).squeeze(1), 0.0)
    right = torch.where(share_right > 0, right, left)
    return left.to(torch.int32), right.to(torch.int32), share_left, share_right, total
