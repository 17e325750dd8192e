"""The control stages as kernels on the CPU: what the pipeline decides between two batches, in a few launches.

They compute what the functions of ``tsar`` compute, within rounding. Where a configuration or a tensor is not theirs
they hand the work to those: what ``coverage.py`` does not list, and batches with samples that are not finite.
"""

from __future__ import annotations

import time
from typing import get_args

import numpy as np
import torch
from torch import Tensor

from renderer.compute import device as devices
from renderer.compute.launching import Command, address, require_same
from renderer.compute.team import TEAM
from renderer.stages import kernels
from renderer.stages import reconstruction_kernels as display_kernels
from renderer.stages.cache import CacheView, ClaimMemory
from renderer.stages.coverage import StageName, covers
from renderer.stages.estimate import ErrorPlan
from renderer.stages.reconstruction import Display
from renderer.stages.response import COLUMNS, ResponsePlan
from renderer.stages.selection import SelectionPlan
from renderer.stages.views import PerCache, point_at_cache
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

_F32, _F64, _I32, _I64 = torch.float32, torch.float64, torch.int32, torch.int64


def stages(config: TsarConfig, name: StagesName = "compiled", threads: int = 1) -> Stages:
    """The stages of a run.

    Args:
        config: of the run; the compiled stages serve no other.
        name: ``compiled``, or ``reference`` for the tensor operations of ``tsar``.
        threads: host threads that share a batch's observation and a reconstruction. No result depends on it.
    """
    return compiled_stages(config, threads) if name == "compiled" else REFERENCE


def compiled_stages(config: TsarConfig, threads: int = 1) -> Stages:
    """Kernels throughout, but for what they do not cover of a configuration (:mod:`renderer.stages.coverage`)."""
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
        self._covered: dict[StageName, bool] = {stage: covers(config, stage) for stage in get_args(StageName)}
        self._elements = config.sdf_side**2
        self._most_tiles = 4**config.level_min + 3 * split_bounds(config)[1]
        self._ranks = torch.empty(2, max(4**config.level_max, config.cache_slots), dtype=torch.float64)
        self._scratch = kernels.Scratch()
        for name, row in zip(("value", "key"), self._ranks, strict=True):
            setattr(self._scratch, name, address(name, row, _F64, self._ranks.shape[1]))
        self._prepare_observation()
        self._prepare_decision()
        self._parts = _part_of_element(config)
        self._sums = np.zeros(3)
        parts = address("parts", self._parts, _I32, self._elements)
        fixed = self._elements, FAST_REFRESH, parts, address("sums", self._sums, _F64, 3)
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
        if not self._covered["observe"]:
            return REFERENCE.observe(batch, color, cache, config, stage)
        count, nonfinite = batch.level.shape[0], 0
        if count > config.batch_size:
            raise ValueError(f"batch: expected at most {config.batch_size} framelets, got {count}")
        with stage("cache"):
            claim, observe = self._per_cache(cache)
            color = _single(color).contiguous()
            spatial, temporal = torch.empty(self._elements), torch.empty(self._elements)
            fields = self._field("errors.spatial", spatial, _F32), self._field("errors.temporal", temporal, _F32)
            level = address("batch.level", batch.level, _I64, count)
            tiles = count, level, address("batch.index", batch.index, _I64, count)
            colors = address("color", color, _F32, count * 3 * config.samples)
            claim(*tiles, self._times_of(batch), *fields)
        with stage("error"):
            self._run(observe, *tiles, colors, *fields)
            if self._progress[1]:
                color, nonfinite = replace_nonfinite(color, config.framelet_side)
                self._run(observe, *tiles, address("color", color, _F32, count * 3 * config.samples), *fields)
        return Observation(Errors(spatial, temporal), nonfinite)

    def decide(
        self, densities: Densities, errors: Errors, history: Tensor, config: TsarConfig, stage: StageTimer
    ) -> Decision:
        """As :func:`tsar.decision.decide`; responses that are not compiled are the reference's.

        Raises:
            ValueError: if a density is negative or not finite, or the tiling is too small for a batch.
        """
        require_same(config, self.config)
        if not self._covered["decide"]:
            return REFERENCE.decide(densities, errors, history, config, stage)
        compiled = self._covered["respond"]
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
        fields = (
            ("densities.spatial", densities.spatial, _F64),
            ("densities.temporal", densities.temporal, _F64),
            ("errors.spatial", _single(errors.spatial), _F32),
            ("errors.temporal", _single(errors.temporal), _F32),
            ("spatial", spatial, _F64),
            ("temporal", temporal, _F64),
        )
        due = (
            ("selected", selected, _I64, count),
            ("credit", credit, _F64, self._elements),
            ("due level", due_level, _I64, count),
            ("due index", due_index, _I64, count),
            ("position", position, _F32, count * samples * 2),
        )
        self._decide(
            int(compiled),
            surplus,
            *(self._field(*field) for field in fields),
            address("level", level, _I64, self._most_tiles),
            address("index", index, _I64, self._most_tiles),
            self._field("history", history, _F64),
            *(address(*part) for part in due),
        )
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
        if not self._covered["account"]:
            return REFERENCE.account(densities, errors, newest_s, config)
        fields = (
            ("densities.spatial", densities.spatial, _F64),
            ("densities.temporal", densities.temporal, _F64),
            ("errors.spatial", _single(errors.spatial), _F32),
            ("errors.temporal", _single(errors.temporal), _F32),
        )
        newest = address("newest_s", newest_s, _F64, 4**config.level_max)
        self._account(*(self._field(*field) for field in fields), newest)
        combined, spread, nonfinite = self._sums.tolist()
        return Account(combined, spread, int(nonfinite))

    def _field(self, name: str, values: Tensor, dtype: torch.dtype) -> int:
        """Address of a field over the elements."""
        return address(name, values, dtype, self._elements)

    def _times_of(self, batch: FrameletBatch) -> int:
        """Address of the time of each framelet, that of its first sample."""
        time_s, count = batch.time_s, len(batch.level)
        if isinstance(time_s, Tensor) and len(time_s) != count:
            raise ValueError(f"batch.time_s: expected {count} framelets, got {len(time_s)}")
        self._times[:count] = time_s[:, 0].numpy() if isinstance(time_s, Tensor) else time_s
        return self._times_address

    def _run(self, observe: Command, *arguments: int) -> None:
        """All threads take rows of a batch."""
        self._progress[:] = 0
        observe.set(*arguments)
        TEAM.run([observe] * self._threads)

    def _record(self, cache: FrameletCache) -> tuple[Command, Command]:
        """Launches that know where a cache lies: one claims slots, one observes a batch."""
        pending = address("pending", self._pending, torch.uint8, self.config.batch_size)
        fixed = self._error_plan, _cache_view(cache, self.config), self._claim, pending
        progress = address("progress", self._progress, _I32, 2)
        return (
            Command(kernels.claim_slots, *fixed, self._scratch),
            Command(kernels.observe_batch, *fixed, progress),
        )

    def _prepare_observation(self) -> None:
        config, claim = self.config, ClaimMemory()
        self._per_cache = PerCache(self._record)
        self._error_plan = _error_plan(config)
        batch, slots, state = config.batch_size, config.cache_slots, state_size(config.samples)
        self._places = torch.empty(2, batch, dtype=_I64)
        self._spare = torch.empty(batch, state)
        self._marks = torch.zeros(slots, dtype=torch.bool)
        claim.slot, claim.past = (address("places", row, _I64, batch) for row in self._places)
        claim.spare = address("spare", self._spare, _F32, batch * state)
        claim.marks = address("marks", self._marks, torch.bool, slots)
        self._claim = claim
        self._pending, self._progress = np.zeros(batch, np.uint8), np.zeros(2, np.int32)
        self._times = np.zeros(batch)
        self._times_address = address("times", self._times, _F64, batch)

    def _prepare_decision(self) -> None:
        self._surplus, self._tile_count, self._decided = np.zeros(1), np.zeros(1, np.int32), np.zeros(4, np.int64)
        results = (
            address("surplus", self._surplus, _F64, 1),
            address("tile count", self._tile_count, _I32, 1),
            address("times", self._decided, _I64, 4),
        )
        plans = self._make_response_plan(), self._make_tiling_plan(), self._make_selection_plan()
        self._decide = Command(kernels.decide_next, *plans, self._scratch, *results)

    def _make_response_plan(self) -> ResponsePlan:
        plan = _response_plan(self.config)
        self._active = torch.empty(self._elements, dtype=torch.int32)
        self._columns = torch.empty(COLUMNS, self._elements, dtype=torch.float64)
        plan.active = self._field("active", self._active, _I32)
        plan.columns = address("columns", self._columns, _F64, COLUMNS * self._elements)
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
        ordered = (4**high - 4**low) // 3
        plan.order = address("order", self._order, _I64, ordered)
        plan.sums = address("sums", self._nodes, _F64, nodes)
        plan.key = address("keys", self._node_keys, _F64, nodes)
        plan.split = address("splits", self._split, torch.uint8, nodes)
        return plan

    def _make_selection_plan(self) -> SelectionPlan:
        config, plan = self.config, SelectionPlan()
        self._centres = cell_centres(config.framelet_side)
        plan.batch, plan.field_level, plan.samples = config.batch_size, config.field_level, config.samples
        plan.centre = address("centres", self._centres, _F32, 2 * config.samples)
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
    view.samples, view.state = config.samples, state_size(config.samples)
    point_at_cache(view, cache, config)
    return view


def _part_of_element(config: TsarConfig) -> Tensor:
    """For each element, the part of the map of samples it lies in, raster order."""
    x, y = deinterleave(torch.arange(config.sdf_side**2))
    shift = config.field_level - config.level_max
    return ((y >> shift) * 2**config.level_max + (x >> shift)).to(torch.int32)
