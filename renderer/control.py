"""The control stages as kernels on the CPU: what the pipeline decides between two batches, in a few launches.

They compute what the functions of ``tsar`` compute, within rounding. Where a configuration or a tensor is not theirs
they hand the work to those: solvers other than ``waterfill``, and batches with samples that are not finite.
"""

from __future__ import annotations

import time
from weakref import WeakKeyDictionary

import numpy as np
import torch
from torch import Tensor

from renderer import control_kernels as kernels
from renderer import device as devices
from renderer import display_kernels
from renderer.control_cache import CacheView, ClaimMemory
from renderer.control_estimate import ErrorPlan
from renderer.control_response import COLUMNS, ResponsePlan
from renderer.control_selection import SelectionPlan
from renderer.display import Display
from renderer.launching import Command, address, require_same
from renderer.team import TEAM
from tsar.accounting import FAST_REFRESH, Account
from tsar.cache import FrameletCache
from tsar.clock import StageTimer
from tsar.config import StagesName, TsarConfig
from tsar.decision import Decision
from tsar.error import RADIANCE_MAX, replace_nonfinite, tolerated_power
from tsar.haar import octave_count, state_size
from tsar.morton import deinterleave
from tsar.observation import Observation
from tsar.response import respond
from tsar.selection import Request, cell_centres, require_full
from tsar.stages import REFERENCE, Stages
from tsar.tiling import split_bounds, tie_order
from tsar.types import Densities, Errors, FrameletBatch, Tiling


def stages(config: TsarConfig, name: StagesName = "compiled", threads: int = 1) -> Stages:
    """The stages of a run.

    Args:
        config: of the run; the compiled stages serve no other.
        name: ``compiled``, or ``reference`` for the tensor operations of ``tsar``.
        threads: host threads that share a batch's observation and a reconstruction. No result depends on it.
    """
    return compiled_stages(config, threads) if name == "compiled" else REFERENCE


def compiled_stages(config: TsarConfig, threads: int = 1) -> Stages:
    """Kernels throughout, but for the response where its solver is not compiled."""
    devices.load_kernels((kernels, display_kernels), "cpu")
    control, display = Control(config, threads), Display(config, threads)
    return Stages(
        observe=control.observe,
        decide=control.decide,
        reconstruct=display.reconstruct,
        account=control.account,
    )


class Control:
    """The stages between two batches for one configuration.

    Holds constants of the configuration, recorded launches and working memory, and nothing of a run: every method gives
    the same for the same arguments.
    """

    def __init__(self, config: TsarConfig, threads: int = 1) -> None:
        """Prepares the launches of a configuration; ``threads`` share what is large."""
        self.config, self._threads = config, threads
        self._elements = config.sdf_side**2
        self._most_tiles = 4**config.level_min + 3 * split_bounds(config)[1]
        self._ranks = torch.empty(2, max(4**config.level_max, config.cache_slots), dtype=torch.float64)
        self._scratch = kernels.Scratch()
        self._scratch.value, self._scratch.key = map(address, self._ranks)
        self._prepare_observation()
        self._prepare_decision()
        self._parts = _part_of_element(config)
        self._sums = np.zeros(3)
        fixed = self._elements, FAST_REFRESH, address(self._parts), self._sums.ctypes.data
        self._account = Command(kernels.take_account, *fixed)

    def observe(
        self, batch: FrameletBatch, color: Tensor, cache: FrameletCache, config: TsarConfig, stage: StageTimer
    ) -> Observation:
        """As :func:`tsar.observation.observe`; framelets with samples that are not finite are repaired and observed
        after the others.

        The slots are chosen first, so that colours and wavelet states can go straight there.

        Raises:
            ValueError: if the batch is larger than the configuration's.
        """
        require_same(config, self.config)
        count, nonfinite = batch.level.shape[0], 0
        if count > config.batch_size:
            raise ValueError(f"batch: expected at most {config.batch_size} framelets, got {count}")
        with stage("cache"):
            claim, observe = self._commands(cache)
            spatial, temporal = torch.empty(self._elements), torch.empty(self._elements)
            fields = address(spatial), address(temporal)
            tiles = count, address(batch.level), address(batch.index)
            claim(*tiles, self._times_of(batch), *fields)
        with stage("error"):
            if color.dtype != torch.float32 or not color.is_contiguous():
                color = color.to(torch.float32).contiguous()
            self._run(observe, *tiles, address(color), *fields)
            if self._progress[1]:
                color, nonfinite = replace_nonfinite(color, config.framelet_side)
                self._run(observe, *tiles, address(color), *fields)
        return Observation(Errors(spatial, temporal), nonfinite)

    def decide(
        self, densities: Densities, errors: Errors, history: Tensor, config: TsarConfig, stage: StageTimer
    ) -> Decision:
        """As :func:`tsar.decision.decide`; responses by other solvers than ``waterfill`` are the reference's.

        Raises:
            ValueError: if a density is negative or not finite, or the tiling is too small for a batch.
        """
        require_same(config, self.config)
        compiled = config.response.solver == "waterfill"
        if not compiled:
            with stage("response"):
                densities = respond(densities, errors, config)
        start = time.perf_counter()
        count, samples = config.batch_size, config.samples
        spatial, temporal, surplus = densities.spatial, densities.temporal, densities.surplus
        if compiled:
            spatial, temporal = (torch.empty(self._elements, dtype=torch.float64) for _ in range(2))
        level, index = (torch.empty(self._most_tiles, dtype=torch.int64) for _ in range(2))
        selected, due_level, due_index = (torch.empty(count, dtype=torch.int64) for _ in range(3))
        credit, position = torch.empty(self._elements, dtype=torch.float64), torch.empty(count, samples, 2)
        signed = _single(errors.spatial), _single(errors.temporal)
        given = densities.spatial, densities.temporal, *signed, spatial, temporal, level, index, history
        due = selected, credit, due_level, due_index, position
        self._decide(int(compiled), surplus, *map(address, (*given, *due)))
        tiles = int(self._tile_count[0])
        if tiles == 0:
            raise ValueError("tiling: expected finite, non-negative densities")
        require_full(tiles, count)
        if compiled:
            surplus = float(self._surplus[0])
        tiling = Tiling(level.resize_(tiles), index.resize_(tiles))
        request = Request(selected, credit, due_level, due_index, position)
        begun, responded, tiled, done = self._decided.tolist()
        shares = {"response": responded - begun, "tiling": tiled - responded, "selection": done - tiled}
        stage.divide(time.perf_counter() - start, shares)
        return Decision(Densities(spatial, temporal, surplus), tiling, request)

    def account(self, densities: Densities, errors: Errors, newest_s: Tensor, config: TsarConfig) -> Account:
        """As :func:`tsar.accounting.account`."""
        signed = _single(errors.spatial), _single(errors.temporal)
        self._account(*map(address, (densities.spatial, densities.temporal, *signed, newest_s)))
        combined, spread, nonfinite = self._sums.tolist()
        return Account(combined, spread, int(nonfinite))

    def _times_of(self, batch: FrameletBatch) -> int:
        """Address of the time of each framelet, that of its first sample."""
        time_s = batch.time_s
        self._times[: len(batch.level)] = time_s if isinstance(time_s, float) else batch.times[:, 0].numpy()
        return self._times_address

    def _run(self, observe: Command, *arguments: int) -> None:
        """All threads take rows of a batch."""
        self._progress[:] = 0
        observe.set(*arguments)
        TEAM.run([observe] * self._threads)

    def _commands(self, cache: FrameletCache) -> tuple[Command, Command]:
        """Launches that know where a cache lies: one claims slots, one observes a batch."""
        found = self._of_cache.get(cache)
        if found is None:
            fixed = self._error_plan, _cache_view(cache, self.config), self._claim, self._pending.ctypes.data
            found = (
                Command(kernels.claim_slots, *fixed, self._scratch),
                Command(kernels.observe_batch, *fixed, self._progress.ctypes.data),
            )
            self._of_cache[cache] = found
        return found

    def _prepare_observation(self) -> None:
        config, claim = self.config, ClaimMemory()
        self._of_cache: WeakKeyDictionary[FrameletCache, tuple[Command, Command]] = WeakKeyDictionary()
        self._error_plan = _error_plan(config)
        self._places = torch.empty(2, config.batch_size, dtype=torch.int64)
        self._spare = torch.empty(config.batch_size, state_size(config.samples))
        self._marks = torch.zeros(config.cache_slots, dtype=torch.bool)
        claim.slot, claim.past = map(address, self._places)
        claim.spare, claim.marks = address(self._spare), address(self._marks)
        self._claim = claim
        self._pending, self._progress = np.zeros(config.batch_size, np.uint8), np.zeros(2, np.int32)
        self._times = np.zeros(config.batch_size)
        self._times_address = self._times.ctypes.data

    def _prepare_decision(self) -> None:
        self._surplus, self._tile_count, self._decided = np.zeros(1), np.zeros(1, np.int32), np.zeros(4, np.int64)
        results = (array.ctypes.data for array in (self._surplus, self._tile_count, self._decided))
        plans = self._make_response_plan(), self._make_tiling_plan(), self._make_selection_plan()
        self._decide = Command(kernels.decide_next, *plans, self._scratch, *results)

    def _make_response_plan(self) -> ResponsePlan:
        plan = _response_plan(self.config)
        self._active = torch.empty(self._elements, dtype=torch.int32)
        self._columns = torch.empty(COLUMNS, self._elements, dtype=torch.float64)
        plan.active, plan.columns = address(self._active), address(self._columns)
        return plan

    def _make_tiling_plan(self) -> kernels.TilingPlan:
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
        return plan

    def _make_selection_plan(self) -> SelectionPlan:
        config, plan = self.config, SelectionPlan()
        self._centres = cell_centres(config.framelet_side)
        plan.batch, plan.field_level, plan.samples = config.batch_size, config.field_level, config.samples
        plan.centre = address(self._centres)
        return plan


def _single(field: Tensor) -> Tensor:
    return field if field.dtype == torch.float32 else field.to(torch.float32)


def _error_plan(config: TsarConfig) -> ErrorPlan:
    error, plan = config.error, ErrorPlan()
    octaves = octave_count(config.samples)
    plan.samples, plan.octaves, plan.state = config.samples, octaves, state_size(config.samples)
    plan.octave_positions = plan.state // 4
    plan.field_level = config.field_level
    plan.linf, plan.difference = int(error.norm == "linf"), int(error.form == "difference")
    spatial = tolerated_power(octaves, error.spatial_offset, error.spatial_slope, error)
    temporal = tolerated_power(octaves, error.temporal_offset, error.temporal_slope, error)
    plan.template_spatial, plan.template_temporal = spatial, temporal
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
