"""The control stages as kernels on the CPU: what the pipeline decides between two batches, in a few launches.

They compute what the functions of ``tsar`` compute, within rounding. Where a configuration or a tensor is not theirs
they hand the work to those: solvers other than ``waterfill``, and batches with samples that are not finite.
"""

from __future__ import annotations

from weakref import WeakKeyDictionary

import numpy as np
import torch
from torch import Tensor

from renderer import control_kernels as kernels
from renderer import device as devices
from renderer import display_kernels
from renderer.control_cache import CacheView
from renderer.control_estimate import ErrorPlan
from renderer.control_response import COLUMNS, ResponsePlan
from renderer.display import Display
from renderer.launching import Command, address, require_same
from tsar.accounting import FAST_REFRESH, Account
from tsar.cache import FrameletCache
from tsar.clock import StageTimer
from tsar.config import StagesName, TsarConfig
from tsar.error import RADIANCE_MAX, replace_nonfinite, template_power
from tsar.haar import octave_count, state_size
from tsar.morton import deinterleave
from tsar.observation import Observation
from tsar.response import respond as reference_respond
from tsar.selection import Request, cell_centres
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
        request=control.request,
        observe=control.observe,
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
        self._prepare_selection()
        self._prepare_observation()
        self._prepare_response()
        self._prepare_tiling()
        self._parts = _part_of_element(config)
        self._sums = np.zeros(2)
        fixed = self._elements, FAST_REFRESH, address(self._parts), self._sums.ctypes.data
        self._account = Command(kernels.take_account, *fixed)

    def request(
        self,
        tiling: Tiling,
        temporal_density: Tensor,
        history: Tensor,
        time_s: float,
        cycle: int,
        config: TsarConfig,
    ) -> Request:
        """As :func:`tsar.selection.request`."""
        require_same(config, self.config)
        count, samples = config.batch_size, config.samples
        selected, level, index = (torch.empty(count, dtype=torch.int64) for _ in range(3))
        credit, position = torch.empty(self._elements, dtype=torch.float64), torch.empty(count, samples, 2)
        times = torch.empty_strided((count, samples), (0, 0))  # one number in memory
        given = tiling.level, tiling.index, temporal_density, history, credit, selected, level, index, position
        self._request(tiling.tile_count, time_s, *map(address, given), times.data_ptr())
        return Request(selected, credit, FrameletBatch(level, index, position, times, cycle=cycle, seed=config.seed))

    def observe(
        self, batch: FrameletBatch, color: Tensor, cache: FrameletCache, config: TsarConfig, stage: StageTimer
    ) -> Observation:
        """As :func:`tsar.observation.observe`; framelets with samples that are not finite are repaired and observed
        after the others.

        The slots are chosen first, so that colours and wavelet states can go straight there.
        """
        with stage("cache"):
            claim, observe = self._commands(cache)
            slot = self._claim(batch, claim)
        with stage("error"):
            if color.dtype != torch.float32 or not color.is_contiguous():
                color = color.to(torch.float32).contiguous()
            spatial, temporal = torch.empty(self._elements), torch.empty(self._elements)
            count, nonfinite = slot.shape[0], 0
            given = list(map(address, (batch.level, batch.index, slot, spatial, temporal)))
            observe(0, count, address(color), *given)
            if self._left[0]:
                color, nonfinite = replace_nonfinite(color, config.framelet_side)
                observe(1, count, address(color), *given)
        return Observation(Errors(spatial, temporal), nonfinite)

    def respond(self, densities: Densities, errors: Errors, config: TsarConfig) -> Densities:
        """As :func:`tsar.response.respond`."""
        spatial, temporal = (torch.empty(self._elements, dtype=torch.float64) for _ in range(2))
        signed = _single(errors.spatial), _single(errors.temporal)
        given = densities.spatial, densities.temporal, *signed, spatial, temporal
        self._respond(densities.surplus, *map(address, given))
        return Densities(spatial, temporal, float(self._surplus[0]))

    def build(self, spatial_density: Tensor, config: TsarConfig) -> Tiling:
        """As :func:`tsar.tiling.build`."""
        level, index = (torch.empty(self._most_tiles, dtype=torch.int64) for _ in range(2))
        self._build(*map(address, (spatial_density, level, index)))
        count = int(self._tile_count[0])
        if count == 0:
            raise ValueError("tiling.build: expected finite, non-negative densities")
        return Tiling(level[:count], index[:count])

    def account(self, densities: Densities, newest_s: Tensor, config: TsarConfig) -> Account:
        """As :func:`tsar.accounting.account`."""
        self._account(*map(address, (densities.spatial, densities.temporal, newest_s)))
        return Account(*self._sums.tolist())

    def _claim(self, batch: FrameletBatch, claim: Command) -> Tensor:
        """Slots for a batch, which are its from now on."""
        count, time_s = batch.level.shape[0], batch.time_s
        if count > self.config.batch_size or time_s.dtype != torch.float32:
            raise ValueError(
                f"batch: expected at most {self.config.batch_size} framelets with times in float32, got {count} with "
                f"{time_s.dtype}"
            )
        slot = torch.empty(count, dtype=torch.int64)
        tiles = address(batch.level), address(batch.index)
        claim(count, *tiles, time_s.data_ptr(), time_s.stride(0), address(slot))
        return slot

    def _commands(self, cache: FrameletCache) -> tuple[Command, Command]:
        """Launches that know where a cache lies: one claims slots, one observes a batch."""
        found = self._of_cache.get(cache)
        if found is None:
            view = _cache_view(cache, self.config)
            past, *memory = map(address, (self._past, self._spare, self._marks))
            found = (
                Command(kernels.claim_slots, view, self._scratch, past, *memory),
                Command(kernels.observe_batch, self._error_plan, view, past, *self._progress),
            )
            self._of_cache[cache] = found
        return found

    def _prepare_selection(self) -> None:
        config = self.config
        self._ranks = torch.empty(2, max(4**config.level_max, config.cache_slots), dtype=torch.float64)
        self._scratch = kernels.Scratch()
        self._scratch.value, self._scratch.key = map(address, self._ranks)
        self._centres = cell_centres(config.framelet_side)
        sizes = config.batch_size, config.field_level, config.samples
        self._request = Command(kernels.request_batch, self._scratch, *sizes, address(self._centres))

    def _prepare_observation(self) -> None:
        config = self.config
        self._of_cache: WeakKeyDictionary[FrameletCache, tuple[Command, Command]] = WeakKeyDictionary()
        self._error_plan = _error_plan(config)
        self._spare = torch.empty(config.batch_size, state_size(config.samples))
        self._marks = torch.zeros(config.cache_slots, dtype=torch.bool)
        self._past = torch.empty(config.batch_size, dtype=torch.int64)
        self._pending, self._left = np.zeros(config.batch_size, np.uint8), np.zeros(1, np.int32)
        self._progress = self._pending.ctypes.data, self._left.ctypes.data

    def _prepare_response(self) -> None:
        self._surplus = np.zeros(1)
        self._active = torch.empty(self._elements, dtype=torch.int32)
        self._columns = torch.empty(COLUMNS, self._elements, dtype=torch.float64)
        fixed = address(self._active), address(self._columns), self._surplus.ctypes.data
        self._respond = Command(kernels.respond, _response_plan(self.config), *fixed)

    def _prepare_tiling(self) -> None:
        config, plan = self.config, kernels.TilingPlan()
        low, high = config.level_min, config.level_max
        nodes = 4**config.field_level
        self._tile_count = np.zeros(1, np.int32)
        self._order = tie_order(low, high) if high > low else torch.empty(0, dtype=torch.int64)
        self._nodes, self._node_keys = torch.empty(2, nodes, dtype=torch.float64)
        self._split = torch.empty(nodes, dtype=torch.uint8)
        plan.field_level, plan.level_low, plan.level_high = config.field_level, low, high
        plan.splits_least, plan.splits_most = split_bounds(config)
        plan.threshold = config.tiling.threshold_samples
        plan.order, plan.sums = address(self._order), address(self._nodes)
        plan.key, plan.split = address(self._node_keys), address(self._split)
        self._build = Command(kernels.build_tiling, plan, self._tile_count.ctypes.data)


def _single(field: Tensor) -> Tensor:
    return field if field.dtype == torch.float32 else field.to(torch.float32)


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


def _cache_view(cache: FrameletCache, config: TsarConfig) -> CacheView:
    view = CacheView()
    view.slots, view.samples, view.state = cache.level.shape[0], config.samples, state_size(config.samples)
    for name in ("level", "index", "time_s", "dead", "color", "coefficients", "slot_of_node"):
        setattr(view, name, address(getattr(cache, name)))
    return view


def _part_of_element(config: TsarConfig) -> Tensor:
    """For each element, the part of the map of samples it lies in, raster order."""
    x, y = deinterleave(torch.arange(config.sdf_side**2))
    shift = config.field_level - config.level_max
    return ((y >> shift) * 2**config.level_max + (x >> shift)).to(torch.int32)
