"""Parameters of the control stages' kernels for a configuration: constants, and addresses of working memory."""

from __future__ import annotations

import torch

from renderer.compute.memory import Memory
from renderer.stages.cache import CacheView, ClaimMemory
from renderer.stages.estimate import ErrorPlan
from renderer.stages.kernels import Scratch, TilingPlan
from renderer.stages.response import ResponsePlan
from renderer.stages.selection import SelectionPlan
from renderer.stages.sizes import COLUMNS, OCTAVES_MAX
from renderer.stages.views import point_at_cache
from tsar.cache import FrameletCache
from tsar.config import TsarConfig
from tsar.error import RADIANCE_MAX
from tsar.estimators import state_size, template_power
from tsar.haar import octave_count
from tsar.morton import deinterleave, first_node
from tsar.selection import cell_centres
from tsar.tiling import split_bounds, tie_order

_F32, _F64, _I32, _I64 = torch.float32, torch.float64, torch.int32, torch.int64


def scratch(config: TsarConfig, memory: Memory) -> Scratch:
    """Working memory to rank all tiles, or all slots of the cache."""
    made, count = Scratch(), max(4**config.level_max, config.cache_slots)
    made.value, made.key = memory.room("values", count, _F64), memory.room("keys", count, _F64)
    return made


def error_plan(config: TsarConfig, memory: Memory) -> ErrorPlan:
    """Parameters of the estimate of errors."""
    error, plan = config.error, ErrorPlan()
    octaves = octave_count(config.samples)
    plan.samples, plan.octaves, plan.state = config.samples, octaves, state_size(config.samples, error)
    plan.field_level = config.field_level
    plan.linf, plan.difference = int(error.norm == "linf"), int(error.form == "difference")
    plan.greatest, plan.per_tile = int(error.octaves == "greatest"), int(error.extent == "tile")
    templates = torch.zeros(2, OCTAVES_MAX, OCTAVES_MAX)
    for axis, name in enumerate(("spatial", "temporal")):
        offset, slope = (getattr(error, f"{name}_{part}") for part in ("offset", "slope"))
        for k in range(octaves):
            templates[axis, k, :octaves] = template_power(config.samples, 4**k, offset, slope, error)
    plan.templates = memory.keep("templates", templates, _F32, templates.numel())
    plan.radiance_max = RADIANCE_MAX
    return plan


def claim_memory(config: TsarConfig, memory: Memory) -> ClaimMemory:
    """Working memory for the slots that a batch takes."""
    claim, batch, slots = ClaimMemory(), config.batch_size, config.cache_slots
    claim.slot, claim.past = memory.room("slots", batch, _I64), memory.room("pasts", batch, _I64)
    claim.spare = memory.room("spare", batch * state_size(config.samples, config.error))
    claim.marks = memory.zeros("marks", slots, torch.bool)
    return claim


def cache_view(cache: FrameletCache, config: TsarConfig) -> CacheView:
    """Addresses of a cache's tensors."""
    view = CacheView()
    view.samples, view.state = config.samples, state_size(config.samples, config.error)
    point_at_cache(view, cache, config)
    return view


def response_plan(config: TsarConfig, memory: Memory) -> ResponsePlan:
    """Parameters of the control decision."""
    plan, elements = ResponsePlan(), config.sdf_side**2
    (spatial_low, spatial_high), (temporal_low, temporal_high) = config.spatial_bounds, config.temporal_bounds
    plan.elements = elements
    plan.spatial_high, plan.temporal_high = spatial_high, temporal_high
    plan.spatial_min, plan.temporal_min = spatial_low / spatial_high, temporal_low / temporal_high
    plan.gain, plan.shift = config.response.gain, 2.0**config.response.bias
    plan.surplus_max = config.response.surplus_max * config.budget / (spatial_high * temporal_high)
    plan.active = memory.room("active", elements, _I32)
    plan.columns = memory.room("columns", COLUMNS * elements, _F64)
    return plan


def tiling_plan(config: TsarConfig, memory: Memory) -> TilingPlan:
    """Parameters of the tiling."""
    plan, nodes = TilingPlan(), 4**config.field_level
    low, high = config.level_min, config.level_max
    plan.field_level, plan.level_low, plan.level_high = config.field_level, low, high
    plan.splits_least, plan.splits_most = split_bounds(config)
    plan.threshold = config.threshold_samples
    order = tie_order(low, high) if high > low else torch.empty(0, dtype=_I64)
    plan.order = memory.keep("order", order, _I64, first_node(high) - first_node(low))
    plan.sums, plan.key = memory.room("node sums", nodes, _F64), memory.room("node keys", nodes, _F64)
    plan.split = memory.room("splits", nodes, torch.uint8)
    return plan


def selection_plan(config: TsarConfig, memory: Memory) -> SelectionPlan:
    """Parameters of the selection of tiles."""
    plan = SelectionPlan()
    plan.batch, plan.field_level, plan.samples = config.batch_size, config.field_level, config.samples
    plan.centre = memory.keep("centres", cell_centres(config.framelet_side), _F32, 2 * config.samples)
    return plan


def part_of_element(config: TsarConfig, memory: Memory) -> int:
    """Address of int32 indices: for each element, the part of the sample map that contains it, raster order."""
    count = config.sdf_side**2
    x, y = deinterleave(torch.arange(count))
    shift = config.field_level - config.level_max
    return memory.keep("parts", ((y >> shift) * 2**config.level_max + (x >> shift)).to(_I32), _I32, count)
