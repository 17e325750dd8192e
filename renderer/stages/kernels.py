"""Kernel entry points of the control stages; each follows its stages in ``tsar`` step by step.

They run on the CPU, where a launch is one call on one thread; threads share the larger ones. The passes that they call
are in C++.
"""

from __future__ import annotations

import warp as wp

from renderer.compute.launching import Address
from renderer.compute.native_code import module_options
from renderer.stages import sizes
from renderer.stages.cache import CacheView, ClaimMemory, choose_victims, sign_over
from renderer.stages.estimate import ErrorPlan, observe_framelets, start_observing
from renderer.stages.ranking import count_above, kth_greatest, rank_keys
from renderer.stages.response import ResponsePlan, decide
from renderer.stages.selection import Due, SelectionPlan, gather_credit, place_framelets, refresh_due
from renderer.stages.tiling import (
    are_densities,
    count_exceeding,
    emit_tiles,
    first_node,
    mark_splits,
    sum_account,
    sum_nodes,
)

_HEADERS = "account.h", "claims.h", "framelets.h", "response.h", "selection.h", "ticks.h", "tiling.h"
wp.set_module_options(module_options(*_HEADERS, given=sizes.GIVEN))


@wp.struct
class Scratch:
    """Addresses of working memory without contents between launches."""

    value: wp.uint64
    """float64: one per tile or slot."""
    key: wp.uint64
    """uint64: one per tile or slot."""


@wp.struct
class TilingPlan:
    """Parameters of the tiling."""

    field_level: wp.int32
    level_low: wp.int32
    level_high: wp.int32
    splits_least: wp.int32
    splits_most: wp.int32
    threshold: wp.float64
    order: wp.uint64
    """int64: order in which equal nodes split."""
    sums: wp.uint64
    key: wp.uint64
    split: wp.uint64


@wp.func_native("return ticks::now();")
def ticks() -> wp.int64:
    """A count that grows with time."""
    ...


@wp.kernel
def claim_slots(
    plan: ErrorPlan,
    cache: CacheView,
    memory: ClaimMemory,
    pending: Address,
    scratch: Scratch,
    count: wp.int32,
    level: Address,
    index: Address,
    time_s: Address,
    errors_spatial: Address,
    errors_temporal: Address,
):
    """Assigns slots to a batch: those of dead framelets from the oldest on, then those of the oldest others."""
    choose_victims(cache, scratch.value, scratch.key, count, memory.slot)
    sign_over(cache, memory, count, level, index, time_s)
    start_observing(plan, count, pending, errors_spatial, errors_temporal)


@wp.kernel
def observe_batch(
    plan: ErrorPlan,
    cache: CacheView,
    memory: ClaimMemory,
    pending: Address,
    progress: Address,
    count: wp.int32,
    level: Address,
    index: Address,
    color: Address,
    errors_spatial: Address,
    errors_temporal: Address,
):
    """Stores a batch in its slots and computes its errors; threads share it."""
    observe_framelets(
        plan, cache, memory, pending, progress, count, level, index, color, errors_spatial, errors_temporal
    )


@wp.func
def build_tiling(plan: TilingPlan, density: Address, level: Address, index: Address) -> wp.int32:
    """Builds the tiling of a density field. Returns the number of tiles."""
    sum_nodes(plan.field_level, plan.level_low, density, plan.sums)
    base, end = first_node(plan.level_low), first_node(plan.level_high)
    nodes, values = end - base, plan.sums + Address(8 * base)
    splits = wp.max(count_exceeding(values, nodes, plan.threshold), plan.splits_least)
    splits = wp.min(wp.min(splits, plan.splits_most), nodes)
    rank_keys(values, nodes, plan.key)
    threshold = kth_greatest(plan.key, nodes, wp.max(splits, 1))
    ties = splits - count_above(plan.key, nodes, threshold)
    if splits == 0:
        threshold = ~Address(0)
    mark_splits(nodes, plan.key, plan.order, threshold, ties, plan.split)
    return emit_tiles(plan.level_low, plan.level_high, plan.split, level, index)


@wp.func
def request_batch(
    plan: SelectionPlan,
    scratch: Scratch,
    tiles: wp.int32,
    level: Address,
    index: Address,
    temporal: Address,
    history: Address,
    due: Due,
):
    """Selects the most overdue tiles, and computes the remaining credit and the positions of the samples."""
    gather_credit(tiles, plan.field_level, level, index, temporal, history, scratch.value, due.history)
    rank_keys(scratch.value, tiles, scratch.key)
    threshold = kth_greatest(scratch.key, tiles, plan.batch)
    ties = plan.batch - count_above(scratch.key, tiles, threshold)
    refresh_due(tiles, plan.field_level, level, index, scratch.value, scratch.key, threshold, ties, due)
    place_framelets(plan, level, index, due)


@wp.kernel
def decide_next(
    response: ResponsePlan,
    tiling: TilingPlan,
    selection: SelectionPlan,
    scratch: Scratch,
    surplus_after: Address,
    tile_count: Address,
    times: Address,
    responds: wp.int32,
    surplus: wp.float64,
    spatial_before: Address,
    temporal_before: Address,
    error_spatial: Address,
    error_temporal: Address,
    spatial: Address,
    temporal: Address,
    level: Address,
    index: Address,
    history: Address,
    due_selected: Address,
    due_history: Address,
    due_level: Address,
    due_index: Address,
    due_position: Address,
):
    """Computes new densities, unless the reference has, their tiling, and the tiles that are due.

    ``surplus_after`` receives the surplus, ``tile_count`` the number of tiles, and ``times`` the ticks at the start and
    after each of the three steps. If a density is negative or not finite, the count is 0; if the tiling is too small
    for a batch, nothing is requested.
    """
    clock = wp.array(ptr=times, shape=(4,), dtype=wp.int64)
    clock[0] = ticks()
    if responds == 1:
        surplus_out = wp.array(ptr=surplus_after, shape=(1,), dtype=wp.float64)
        surplus_out[0] = decide(
            response, surplus, spatial_before, temporal_before, error_spatial, error_temporal, spatial, temporal
        )
    clock[1] = ticks()
    count_out = wp.array(ptr=tile_count, shape=(1,), dtype=wp.int32)
    tiles = wp.int32(0)
    if are_densities(response.elements, spatial) and are_densities(response.elements, temporal):
        tiles = build_tiling(tiling, spatial, level, index)
    count_out[0] = tiles
    clock[2] = ticks()
    if tiles >= selection.batch:
        due = Due(due_selected, due_history, due_level, due_index, due_position)
        request_batch(selection, scratch, tiles, level, index, temporal, history, due)
    clock[3] = ticks()


@wp.kernel
def take_account(
    elements: wp.int32,
    fast: wp.float64,
    part_of_element: Address,
    result: Address,
    spatial: Address,
    temporal: Address,
    error_spatial: Address,
    error_temporal: Address,
    newest_s: Address,
):
    """Sums for the record of a cycle: combined density, spread of ages, number of non-finite values."""
    sum_account(elements, fast, spatial, temporal, error_spatial, error_temporal, newest_s, part_of_element, result)
