"""Kernel entry points of the control stages: one launch a stage, each the recipe of its stage in ``tsar``.

They run on the CPU, where a launch is one call on one thread; the passes they call are in C and C++.
"""

from __future__ import annotations

import warp as wp

from renderer.control_cache import CacheView, choose_victims, sign_over
from renderer.control_estimate import ErrorPlan, observe_framelets, start_observing
from renderer.control_ranking import count_above, kth_greatest, rank_keys
from renderer.control_response import ResponsePlan, decide
from renderer.control_selection import gather_credit, place_framelets, refresh_due
from renderer.control_tiling import count_exceeding, emit_tiles, mark_splits, sum_account, sum_nodes
from renderer.launching import Address
from renderer.native_code import module_options

wp.set_module_options(module_options("framelets.h", "response.h", "selection.h"))


@wp.struct
class Scratch:
    """Addresses of working memory that holds nothing between launches."""

    value: wp.uint64
    """float64, one a tile or slot."""
    key: wp.uint64
    """The same, unsigned."""


@wp.struct
class TilingPlan:
    """What of the configuration the tiling depends on."""

    field_level: wp.int32
    level_low: wp.int32
    level_high: wp.int32
    splits_least: wp.int32
    splits_most: wp.int32
    threshold: wp.float64
    order: wp.uint64
    """Order in which equal nodes split."""
    sums: wp.uint64
    key: wp.uint64
    split: wp.uint64


@wp.kernel
def request_batch(
    scratch: Scratch,
    batch: wp.int32,
    field_level: wp.int32,
    samples: wp.int32,
    centre: Address,
    tiles: wp.int32,
    now_s: wp.float32,
    level: Address,
    index: Address,
    temporal: Address,
    history: Address,
    credit: Address,
    selected: Address,
    level_out: Address,
    index_out: Address,
    position: Address,
    time_s: Address,
):
    """The most overdue tiles, the credit that is left, and the request to the renderer."""
    times = wp.array(ptr=time_s, shape=(1,), dtype=wp.float32)
    times[0] = now_s
    gather_credit(tiles, field_level, level, index, temporal, history, scratch.value, credit)
    rank_keys(scratch.value, tiles, scratch.key)
    threshold = kth_greatest(scratch.key, tiles, batch)
    ties = batch - count_above(scratch.key, tiles, threshold)
    refresh_due(tiles, field_level, level, index, scratch.value, scratch.key, threshold, ties, selected, credit)
    place_framelets(batch, samples, centre, level, index, selected, level_out, index_out, position)


@wp.kernel
def claim_slots(
    cache: CacheView,
    scratch: Scratch,
    past: Address,
    spare: Address,
    marks: Address,
    count: wp.int32,
    level: Address,
    index: Address,
    time_s: Address,
    time_stride: wp.int32,
    slot: Address,
):
    """Gives a batch its slots: of the dead framelets, oldest first, then of the oldest of the rest."""
    choose_victims(cache, scratch.value, scratch.key, count, slot)
    sign_over(cache, count, level, index, time_s, time_stride, slot, past, spare, marks)


@wp.kernel
def observe_batch(
    plan: ErrorPlan,
    cache: CacheView,
    past: Address,
    pending: Address,
    result: Address,
    again: wp.int32,
    count: wp.int32,
    color: Address,
    level: Address,
    index: Address,
    slot: Address,
    errors_spatial: Address,
    errors_temporal: Address,
):
    """Errors of a batch, and the batch into its slots; ``again`` does what was left the last time.

    ``result`` receives how many framelets hold a sample that is not finite, and are still pending.
    """
    if again == 0:
        start_observing(plan, count, pending, errors_spatial, errors_temporal)
    left = wp.array(ptr=result, shape=(1,), dtype=wp.int32)
    left[0] = observe_framelets(
        plan, cache, count, level, index, color, slot, past, pending, errors_spatial, errors_temporal
    )


@wp.kernel
def respond(
    plan: ResponsePlan,
    active: Address,
    columns: Address,
    result: Address,
    surplus: wp.float64,
    spatial: Address,
    temporal: Address,
    error_spatial: Address,
    error_temporal: Address,
    spatial_after: Address,
    temporal_after: Address,
):
    """One control decision over the whole field; ``result`` receives the new surplus."""
    surplus_after = wp.array(ptr=result, shape=(1,), dtype=wp.float64)
    surplus_after[0] = decide(
        plan, surplus, spatial, temporal, error_spatial, error_temporal, spatial_after, temporal_after, columns, active
    )


@wp.kernel
def build_tiling(plan: TilingPlan, result: Address, density: Address, level: Address, index: Address):
    """The tiling of a density field; ``result`` receives the number of tiles, 0 where the field is not a density."""
    tiles = wp.array(ptr=result, shape=(1,), dtype=wp.int32)
    tiles[0] = 0
    if sum_nodes(plan.field_level, plan.level_low, density, plan.sums) == 0:
        return
    base, end = (wp.int32(1) << (2 * plan.level_low)) / 3, (wp.int32(1) << (2 * plan.level_high)) / 3
    nodes, values = end - base, plan.sums + Address(8 * base)
    splits = wp.max(count_exceeding(values, nodes, plan.threshold), plan.splits_least)
    splits = wp.min(wp.min(splits, plan.splits_most), nodes)
    rank_keys(values, nodes, plan.key)
    threshold = kth_greatest(plan.key, nodes, wp.max(splits, 1))
    ties = splits - count_above(plan.key, nodes, threshold)
    if splits == 0:
        threshold = ~Address(0)
    mark_splits(nodes, plan.key, plan.order, threshold, ties, plan.split)
    tiles[0] = emit_tiles(plan.level_low, plan.level_high, plan.split, level, index)


@wp.kernel
def take_account(
    elements: wp.int32,
    fast: wp.float64,
    part_of_element: Address,
    result: Address,
    spatial: Address,
    temporal: Address,
    newest_s: Address,
):
    """Sums for the record of a cycle: combined density, spread of ages."""
    sum_account(elements, fast, spatial, temporal, newest_s, part_of_element, result)
