"""The control stages as kernels on the CPU: what the pipeline decides between two batches, in a few launches.

They compute what the functions of ``tsar`` compute, within rounding. Where a configuration or a tensor is not theirs
they hand the work to those: solvers other than ``waterfill``, and batches with samples that are not finite.
"""

from __future__ import annotations

from weakref import WeakKeyDictionary

import torch
from torch import Tensor

from renderer import control_kernels as kernels
from renderer import device as devices
from renderer import display_kernels
from renderer.control_estimate import ErrorPlan
from renderer.control_response import COLUMNS, ResponsePlan
from renderer.display import Display
from renderer.launching import Command, address, require_same
from tsar.accounting import FAST_REFRESH, Account
from tsar.cache import FrameletCache
from tsar.config import StagesName, TsarConfig
from tsar.error import RADIANCE_MAX, Estimate, replace_nonfinite, template_power
from tsar.haar import octave_count, state_size
from tsar.morton import deinterleave
from tsar.response import respond as reference_respond
from tsar.selection import cell_centres
from tsar.stages import REFERENCE, Stages
from tsar.tiling import split_bounds, tie_order
from tsar.types import Densities, Errors, FrameletBatch, Tiling


def stages(config: TsarConfig, name: StagesName = "compiled", threads: int = 1) -> Stages:
    """The stages of a run.

    Args:
        config: of the run; the compiled stages serve no other.
        name: ``compiled``, or ``reference`` for the tensor operations of ``tsar``.
        threads: host threads that share a reconstruction. No result depends on it.
    """
    return compiled_stages(config, threads) if name == "compiled" else REFERENCE


def compiled_stages(config: TsarConfig, threads: int = 1) -> Stages:
    """Kernels throughout, but for the response where its solver is not compiled."""
    devices.load_kernels((kernels, display_kernels), "cpu")
    control, display = Control(config), Display(config, threads)
    compiled_solver = config.response.solver == "waterfill"
    return Stages(
        select=control.select,
        make_batch=control.make_batch,
        estimate=control.estimate,
        insert=control.insert,
        respond=control.respond if compiled_solver else reference_respond,
        build=control.build,
        reconstruct=display.reconstruct,
        account=control.account,
    )


class Control:
    """The stages between two batches for one configuration.

    Holds constants of the configuration, recorded launches and working memory, and nothing of a run: every method gives
    the same for the same arguments.
    """

    def __init__(self, config: TsarConfig) -> None:
        """Prepares the launches of a configuration."""
        self.config = config
        self._elements = config.sdf_side**2
        self._most_tiles = 4**config.level_min + 3 * split_bounds(config)[1]
        self._ranks = torch.empty(2, max(4**config.level_max, config.cache_slots), dtype=torch.float64)
        self._scratch = kernels.Scratch()
        self._scratch.value, self._scratch.key = map(address, self._ranks)
        self._centres = cell_centres(config.framelet_side)
        self._select = Command(kernels.select_tiles, self._scratch, config.batch_size, config.field_level)
        self._make_batch = Command(kernels.make_batch, config.samples, address(self._centres))
        self._of_cache: WeakKeyDictionary[FrameletCache, tuple[Command, Command]] = WeakKeyDictionary()
        self._error_plan = _error_plan(config)
        self._fields = torch.empty(3, 1024)
        self._bad, self._tile_count = torch.zeros(2, 1, dtype=torch.int32)
        self._surplus, self._sums = torch.zeros(1, dtype=torch.float64), torch.zeros(2, dtype=torch.float64)
        self._prepare_response()
        self._prepare_tiling()
        self._parts = _part_of_element(config)
        fixed = self._elements, FAST_REFRESH, address(self._parts), address(self._sums)
        self._account = Command(kernels.take_account, *fixed)

    def select(
        self, tiling: Tiling, temporal_density: Tensor, history: Tensor, config: TsarConfig
    ) -> tuple[Tensor, Tensor]:
        """As :func:`tsar.selection.select`."""
        require_same(config, self.config)
        selected = torch.empty(config.batch_size, dtype=torch.int64)
        credit = torch.empty_like(history)
        given = tiling.level, tiling.index, temporal_density, history
        self._select(tiling.tile_count, *map(address, (*given, selected, credit)))
        return selected, credit

    def make_batch(
        self, tiling: Tiling, selected: Tensor, time_s: float, cycle: int, config: TsarConfig
    ) -> FrameletBatch:
        """As :func:`tsar.selection.make_batch`."""
        count, samples = selected.shape[0], config.samples
        level, index = torch.empty(2, count, dtype=torch.int64).unbind(0)
        position, times = torch.empty(count, samples, 2), torch.empty(count, samples)
        given = tiling.level, tiling.index, selected
        self._make_batch(time_s, count, *map(address, (*given, level, index, position, times)))
        return FrameletBatch(level, index, position, times, cycle=cycle, seed=config.seed)

    def estimate(self, batch: FrameletBatch, color: Tensor, cache: FrameletCache, config: TsarConfig) -> Estimate:
        """As :func:`tsar.error.estimate`; a batch with samples that are not finite is repaired and estimated again."""
        if color.dtype != torch.float32 or not color.is_contiguous():
            color = color.to(torch.float32).contiguous()
        count, nonfinite = batch.level.shape[0], 0
        coefficients = torch.empty(count, self._error_plan.state)
        spatial, temporal = torch.zeros(2, self._elements, dtype=torch.float64).unbind(0)
        launch, _ = self._commands(cache)
        launch(count, *map(address, (batch.level, batch.index, color, coefficients, spatial, temporal)))
        if self._bad.item():
            color, nonfinite = replace_nonfinite(color, config.framelet_side)
            launch(count, *map(address, (batch.level, batch.index, color, coefficients, spatial, temporal)))
        return Estimate(Errors(spatial, temporal), color, coefficients, nonfinite)

    def insert(self, cache: FrameletCache, batch: FrameletBatch, color: Tensor, coefficients: Tensor) -> Tensor:
        """As :meth:`tsar.cache.FrameletCache.insert`."""
        slot = torch.empty_like(batch.level)
        given = slot, batch.level, batch.index, batch.time_s, color, coefficients
        self._commands(cache)[1](slot.shape[0], *map(address, given))
        return slot

    def respond(self, densities: Densities, errors: Errors, config: TsarConfig) -> Densities:
        """As :func:`tsar.response.respond`."""
        spatial, temporal = torch.empty(2, self._elements, dtype=torch.float64).unbind(0)
        given = densities.spatial, densities.temporal, errors.spatial, errors.temporal, spatial, temporal
        self._respond(densities.surplus, *map(address, given))
        return Densities(spatial, temporal, self._surplus.item())

    def build(self, spatial_density: Tensor, config: TsarConfig) -> Tiling:
        """As :func:`tsar.tiling.build`."""
        level, index = torch.empty(2, self._most_tiles, dtype=torch.int64).unbind(0)
        self._build(*map(address, (spatial_density, level, index)))
        count = self._tile_count.item()
        if count == 0:
            raise ValueError("tiling.build: expected finite, non-negative densities")
        return Tiling(level[:count], index[:count])

    def account(self, densities: Densities, newest_s: Tensor, config: TsarConfig) -> Account:
        """As :func:`tsar.accounting.account`."""
        self._account(*map(address, (densities.spatial, densities.temporal, newest_s)))
        return Account(*self._sums.tolist())

    def _commands(self, cache: FrameletCache) -> tuple[Command, Command]:
        """Launches of estimate and insertion that know where a cache lies."""
        found = self._of_cache.get(cache)
        if found is None:
            view = _cache_view(cache, self.config)
            fixed = self._error_plan, view, address(self._fields), address(self._bad)
            found = Command(kernels.estimate_batch, *fixed), Command(kernels.insert_batch, view, self._scratch)
            self._of_cache[cache] = found
        return found

    def _prepare_response(self) -> None:
        self._active = torch.empty(self._elements + 1, dtype=torch.int32)
        self._columns = torch.empty(COLUMNS, self._elements, dtype=torch.float64)
        fixed = address(self._active), address(self._columns), address(self._surplus)
        self._respond = Command(kernels.respond, _response_plan(self.config), *fixed)

    def _prepare_tiling(self) -> None:
        config, plan = self.config, kernels.TilingPlan()
        low, high = config.level_min, config.level_max
        nodes = 4**config.field_level
        self._order = tie_order(low, high) if high > low else torch.empty(0, dtype=torch.int64)
        self._nodes, self._node_keys = torch.empty(2, nodes, dtype=torch.float64)
        self._split = torch.empty(nodes, dtype=torch.uint8)
        plan.field_level, plan.level_low, plan.level_high = config.field_level, low, high
        plan.splits_least, plan.splits_most = split_bounds(config)
        plan.threshold = config.tiling.threshold_samples
        plan.order, plan.sums = address(self._order), address(self._nodes)
        plan.key, plan.split = address(self._node_keys), address(self._split)
        self._build = Command(kernels.build_tiling, plan, address(self._tile_count))


def _error_plan(config: TsarConfig) -> ErrorPlan:
    error, plan = config.error, ErrorPlan()
    octaves = octave_count(config.samples)
    plan.samples, plan.octaves, plan.state = config.samples, octaves, state_size(config.samples)
    plan.octave_positions = plan.state // 4
    plan.field_level = config.field_level
    plan.linf, plan.difference = int(error.norm == "linf"), int(error.form == "difference")
    spatial = template_power(octaves, error.spatial_offset, error.spatial_slope, error)
    temporal = template_power(octaves, error.temporal_offset, error.temporal_slope, error)
    plan.template_spatial, plan.template_temporal = float(spatial.sum()), float(temporal.sum())
    plan.radiance_max = RADIANCE_MAX
    return plan


def _response_plan(config: TsarConfig) -> ResponsePlan:
    plan = ResponsePlan()
    (spatial_low, spatial_high), (temporal_low, temporal_high) = config.spatial_bounds, config.temporal_bounds
    plan.elements = config.sdf_side**2
    plan.spatial_high, plan.temporal_high = spatial_high, temporal_high
    plan.spatial_min, plan.temporal_min = spatial_low / spatial_high, temporal_low / temporal_high
    plan.gain, plan.shift = config.response.gain, 2.0**config.response.bias
    plan.surplus_max = config.response.surplus_max * config.budget / (spatial_high * temporal_high)
    return plan


def _cache_view(cache: FrameletCache, config: TsarConfig) -> kernels.CacheView:
    view = kernels.CacheView()
    view.slots, view.samples, view.state = cache.level.shape[0], config.samples, state_size(config.samples)
    for name in ("level", "index", "time_s", "dead", "color", "coefficients", "slot_of_node"):
        setattr(view, name, address(getattr(cache, name)))
    return view


def _part_of_element(config: TsarConfig) -> Tensor:
    """For each element, the part of the map of samples it lies in, raster order."""
    x, y = deinterleave(torch.arange(config.sdf_side**2))
    shift = config.field_level - config.level_max
    return ((y >> shift) * 2**config.level_max + (x >> shift)).to(torch.int32)
