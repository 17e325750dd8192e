"""The control stages as CPU kernels: the decisions of the pipeline between two batches, in a few launches.

They compute the same as the functions of ``tsar``, up to rounding. They call these functions for configurations that
``coverage.py`` does not list, and for framelets with non-finite samples.
"""

from __future__ import annotations

import time
from typing import get_args

import numpy as np
import torch
from torch import Tensor

from renderer.compute import device as devices
from renderer.compute import team_kernels
from renderer.compute.launching import Command, address, require_same
from renderer.compute.memory import Memory
from renderer.compute.team import TEAM
from renderer.stages import filtering_kernels, kernels, picture_kernels, plans, reconstruction_kernels
from renderer.stages.coverage import StageName, covered, covers
from renderer.stages.filtering import filter_stages
from renderer.stages.reconstruction import Reconstructor
from renderer.stages.views import PerCache
from tsar.accounting import FAST_REFRESH, Account
from tsar.cache import FrameletCache
from tsar.clock import StageTimer
from tsar.config import StagesName, TsarConfig
from tsar.decision import Decision
from tsar.error import replace_nonfinite
from tsar.filtering.stages import reference as reference_filter
from tsar.observation import Observation
from tsar.response import respond
from tsar.selection import Request, require_full
from tsar.stages import REFERENCE, Stages, reference
from tsar.tiling import split_bounds
from tsar.types import Densities, Errors, FrameletBatch, Tiling

KERNELS = kernels, reconstruction_kernels, filtering_kernels, picture_kernels
"""Modules of kernels of all stages."""

_F32, _F64, _I32, _I64 = torch.float32, torch.float64, torch.int32, torch.int64


def stages(config: TsarConfig, name: StagesName = "compiled", threads: int = 1) -> Stages:
    """The stages of a run.

    Args:
        config: configuration of the run; the compiled stages support no other.
        name: ``compiled``, or ``reference`` for the tensor operations of ``tsar``.
        threads: number of host threads that share the observation of a batch and a reconstruction. No result depends on
            it.
    """
    return compiled_stages(config, threads) if name == "compiled" else reference(config)


def expect_stages(name: StagesName) -> None:
    """Has the kernels of a run's stages compiled beside those that are loaded next, such as the renderer's."""
    if name == "compiled":
        devices.expect_kernels((*KERNELS, team_kernels), "cpu")


def compiled_stages(config: TsarConfig, threads: int = 1) -> Stages:
    """Kernels for all stages, except where they do not cover the configuration (:mod:`renderer.stages.coverage`)."""
    devices.load_kernels(KERNELS, "cpu")
    control, reconstructor = Control(config, threads), Reconstructor(config, threads)
    return Stages(
        observe=control.observe,
        decide=control.decide,
        reconstruct=reconstructor.reconstruct,
        account=control.account,
        filtering=covered(filter_stages(config.resolution_px, threads, config.shape), reference_filter(config.window)),
        own_threads=True,
    )


class Control:
    """The stages between two batches for one configuration.

    Holds constants of the configuration, recorded launches and working memory, but no state of a run: every method
    returns the same for the same arguments.
    """

    def __init__(self, config: TsarConfig, threads: int = 1) -> None:
        """Prepares the launches of a configuration; ``threads`` host threads share the larger stages."""
        self.config, self._threads = config, threads
        self._covered: dict[StageName, bool] = {stage: covers(config, stage) for stage in get_args(StageName)}
        self._elements = config.sdf_side**2
        self._most_tiles = 4**config.level_min + 3 * split_bounds(config)[1]
        self._memory = Memory()
        self._scratch = plans.scratch(config, self._memory)
        self._prepare_observation()
        self._prepare_decision()
        self._sums = np.zeros(3)
        parts = plans.part_of_element(config, self._memory)
        fixed = self._elements, FAST_REFRESH, parts, address("sums", self._sums, _F64, 3)
        self._account = Command(kernels.take_account, *fixed)

    def observe(
        self, batch: FrameletBatch, color: Tensor, cache: FrameletCache, config: TsarConfig, timer: StageTimer
    ) -> Observation:
        """Like :func:`tsar.observation.observe`. Framelets with non-finite samples are repaired and observed after the
        others.

        The slots are chosen first, so that colours and wavelet states are written there directly.

        Raises:
            ValueError: if the batch is larger than the configuration's.
        """
        require_same(config, self.config)
        if not self._covered["observe"]:
            return REFERENCE.observe(batch, color, cache, config, timer)
        count, nonfinite = batch.level.shape[0], 0
        if count > config.batch_size:
            raise ValueError(f"batch: expected at most {config.batch_size} framelets, got {count}")
        with timer("cache"):
            claim, observe = self._per_cache(cache)
            color = _single(color).contiguous()
            spatial, temporal = torch.empty(self._elements), torch.empty(self._elements)
            fields = self._field("errors.spatial", spatial, _F32), self._field("errors.temporal", temporal, _F32)
            level = address("batch.level", batch.level, _I64, count)
            tiles = count, level, address("batch.index", batch.index, _I64, count)
            colors = address("color", color, _F32, count * 3 * config.samples)
            claim(*tiles, self._times_of(batch), *fields)
        with timer("error"):
            self._run(observe, *tiles, colors, *fields)
            if self._progress[1]:
                color, nonfinite = replace_nonfinite(color, config.framelet_side)
                self._run(observe, *tiles, address("color", color, _F32, count * 3 * config.samples), *fields)
        return Observation(Errors(spatial, temporal), nonfinite)

    def decide(
        self, densities: Densities, errors: Errors, history: Tensor, config: TsarConfig, timer: StageTimer
    ) -> Decision:
        """Like :func:`tsar.decision.decide`; the reference runs responses that are not compiled.

        Raises:
            ValueError: if a density is negative or not finite, or the tiling is too small for a batch.
        """
        require_same(config, self.config)
        if not self._covered["decide"]:
            return REFERENCE.decide(densities, errors, history, config, timer)
        compiled = self._covered["respond"]
        if not compiled:
            with timer("response"):
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
        timer.divide(time.perf_counter() - start, shares)
        return Decision(Densities(spatial, temporal, surplus), tiling, request)

    def account(self, densities: Densities, errors: Errors, newest_s: Tensor, config: TsarConfig) -> Account:
        """Like :func:`tsar.accounting.account`."""
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
        """Address of the times of the framelets, those of their first samples."""
        time_s, count = batch.time_s, len(batch.level)
        if isinstance(time_s, Tensor) and len(time_s) != count:
            raise ValueError(f"batch.time_s: expected {count} framelets, got {len(time_s)}")
        self._times[:count] = time_s[:, 0].numpy() if isinstance(time_s, Tensor) else time_s
        return self._times_address

    def _run(self, observe: Command, *arguments: int) -> None:
        """Runs the observation of a batch on all threads."""
        self._progress[:] = 0
        observe.set(*arguments)
        TEAM.run([observe] * self._threads)

    def _record(self, cache: FrameletCache) -> tuple[Command, Command]:
        """Launches recorded for a cache: one claims slots, one observes a batch."""
        pending = address("pending", self._pending, torch.uint8, self.config.batch_size)
        fixed = self._error_plan, plans.cache_view(cache, self.config), self._claim, pending
        progress = address("progress", self._progress, _I32, 2)
        return (
            Command(kernels.claim_slots, *fixed, self._scratch),
            Command(kernels.observe_batch, *fixed, progress),
        )

    def _prepare_observation(self) -> None:
        config, batch = self.config, self.config.batch_size
        self._per_cache = PerCache(self._record)
        self._error_plan, self._claim = plans.error_plan(config, self._memory), plans.claim_memory(config, self._memory)
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
        config, memory = self.config, self._memory
        response, tiling = plans.response_plan(config, memory), plans.tiling_plan(config, memory)
        selection = plans.selection_plan(config, memory)
        self._decide = Command(kernels.decide_next, response, tiling, selection, self._scratch, *results)


def _single(field: Tensor) -> Tensor:
    return field if field.dtype == torch.float32 else field.to(torch.float32)
