"""Reconstruction as kernels on the CPU: cached framelets of many ages and sizes to an image, in one pass over bands of
rows that threads share."""

from __future__ import annotations

from dataclasses import dataclass
from weakref import WeakKeyDictionary

import numpy as np
import torch
from torch import Tensor

from renderer import device as devices
from renderer import display_kernels as kernels
from renderer.display_age import DisplayPlan
from renderer.display_bands import PLANES
from renderer.launching import Command, address, require_same
from renderer.team import TEAM
from tsar.cache import FrameletCache
from tsar.config import TsarConfig
from tsar.morton import raster_to_morton
from tsar.reconstruction import Reconstruction, reconstruct, spatial_weights
from tsar.types import SampleMap

_BAND_PIXELS = 1 << 15
"""About as many pixels to a band, 20 bytes each, as a second-level cache holds beside the framelets."""
_BAND_ROWS_LEAST = 8
_SPARE = 16
"""Elements behind arrays that are read or written sixteen at a time."""


@dataclass(frozen=True)
class _Launches:
    """Recorded launches that know where a cache lies; one of ``paint`` per thread."""

    find: Command
    paint: list[Command]
    bury: Command


class Display:
    """Reconstruction for one configuration. Holds constants, recorded launches and working memory, nothing of a run."""

    def __init__(self, config: TsarConfig, threads: int = 1) -> None:
        """Prepares launches for ``threads`` threads."""
        devices.load_kernels(kernels, "cpu")
        self.config = config
        self._cells = 2**config.level_max
        self._memory: dict[str, Tensor] = {}
        self._plan = self._make_plan()
        self._count, self._taken, self._overdraw = np.zeros(1, np.int32), np.zeros(1, np.int32), np.zeros(1)
        threads = min(threads, config.resolution_px // self._plan.band)
        self._holes = np.zeros(threads, np.int32)
        self._workers = [self._make_worker(number) for number in range(threads)]
        self._of_cache: WeakKeyDictionary[FrameletCache, _Launches] = WeakKeyDictionary()

    def reconstruct(self, cache: FrameletCache, config: TsarConfig, cycle_s: float) -> Reconstruction:
        """As :func:`tsar.reconstruction.reconstruct`, to which an image with holes is left."""
        require_same(config, self.config)
        launches = self._launches(cache)
        newest_s = torch.empty(self._cells, self._cells, dtype=torch.float64)
        level = torch.empty(self._cells, self._cells, dtype=torch.int64)
        image = torch.empty(config.resolution_px, config.resolution_px, 3)
        launches.find(cycle_s, address(newest_s), address(level))
        self._taken[0] = 0
        for paint in launches.paint:
            paint.set(self._count[0], address(image))
        TEAM.run(launches.paint)
        if self._holes.any():
            return reconstruct(cache, config, cycle_s)
        launches.bury()
        return Reconstruction(image, SampleMap(newest_s, level), float(self._overdraw[0]))

    def _launches(self, cache: FrameletCache) -> _Launches:
        found = self._of_cache.get(cache)
        if found is None:
            view = kernels.CachedFramelets()
            view.slots = cache.level.shape[0]
            for name in ("level", "index", "time_s", "dead", "color"):
                setattr(view, name, address(getattr(cache, name)))
            paint = [
                Command(kernels.paint_bands, self._plan, view, worker, self._taken.ctypes.data)
                for worker in self._workers
            ]
            found = _Launches(
                Command(kernels.find_candidates, self._plan, view, self._count.ctypes.data),
                paint,
                Command(kernels.bury_dead, self._plan, view, self._overdraw.ctypes.data),
            )
            self._of_cache[cache] = found
        return found

    def _keep(self, name: str, tensor: Tensor) -> int:
        """Address of a tensor that lives as long as this object."""
        self._memory[name] = tensor.contiguous()
        return address(self._memory[name])

    def _make_plan(self) -> DisplayPlan:
        config, plan = self.config, DisplayPlan()
        side, low, high = config.framelet_side, config.level_min, config.level_max
        resolution, cells, slots = config.resolution_px, self._cells, config.cache_slots
        plan.resolution, plan.level_low, plan.level_high, plan.side = resolution, low, high, side
        plan.half = config.reconstruction.age_support_px // 2
        plan.band = min(max(_BAND_PIXELS // resolution, _BAND_ROWS_LEAST), resolution)
        axes = [_axis(side, resolution >> level) for level in range(low, high + 1)]
        for place, name in enumerate(("left", "right", "share_left", "share_right", "weight")):
            setattr(plan, name, self._keep(name, torch.cat([*(axis[place] for axis in axes), axes[0][place][:_SPARE]])))
        lengths = torch.tensor([0, *(axis[0].numel() for axis in axes)], dtype=torch.int32)
        plan.first = self._keep("first", torch.cumsum(lengths, 0, dtype=torch.int32))
        margins = [(axis[0].numel() - (resolution >> level)) // 2 for level, axis in enumerate(axes, low)]
        plan.margin = self._keep("margin", torch.tensor(margins, dtype=torch.int32))
        width = resolution // cells
        plan.reach = -(-plan.half // width) - (-max(margins) // width)
        plan.order = self._keep("order", raster_to_morton(side).to(torch.int32))
        nodes = (4 ** (high + 1) - 1) // 3
        plan.node_time = self._keep("node_time", torch.empty(nodes, dtype=torch.float64))
        plan.node_level = self._keep("node_level", torch.empty(nodes, dtype=torch.int32))
        plan.cell_age = self._keep("cell_age", torch.empty(cells**2))
        plan.cell_least = self._keep("cell_least", torch.empty(2, cells**2))
        pixels = resolution + 2 * plan.half + 1
        plan.row_integral = self._keep("row_integral", torch.empty(pixels, dtype=torch.float64))
        plan.row_sum = self._keep("row_sum", torch.empty(cells, resolution, dtype=torch.float64))
        plan.slot_age = self._keep("slot_age", torch.empty(slots))
        plan.candidate = self._keep("candidate", torch.empty(slots, dtype=torch.int32))
        plan.seen = self._keep("seen", torch.empty(slots, dtype=torch.int32))
        return plan

    def _make_worker(self, number: int) -> kernels.Worker:
        config, worker = self.config, kernels.Worker()
        resolution, side = config.resolution_px, config.framelet_side
        widest = max(2 * side, 2 * (resolution >> config.level_min))
        planes, rows = PLANES * self._plan.band * resolution, 3 * side * widest
        worker.planes = self._keep(f"planes {number}", torch.zeros(planes + _SPARE))
        worker.rows = self._keep(f"rows {number}", torch.zeros(rows + _SPARE))
        worker.samples = self._keep(f"samples {number}", torch.zeros(3 * side**2))
        worker.box = self._keep(f"box {number}", torch.empty(resolution, dtype=torch.float64))
        worker.ages = self._keep(f"ages {number}", torch.empty(resolution))
        worker.result = self._holes[number:].ctypes.data
        return worker


def _axis(side: int, width_px: int) -> tuple[Tensor, ...]:
    """For each pixel of a tile along an axis, margin included: two samples, their shares, and the weight."""
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
