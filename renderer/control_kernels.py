"""Kernel entry points of the control stages: one launch a stage, each the recipe of its stage in ``tsar``.

They run on the CPU, where a launch is one call on one thread; the passes they call are in C.
"""

from __future__ import annotations

import warp as wp

from renderer.control_estimate import ErrorPlan, estimate_framelet, fetch_ahead
from renderer.control_ranking import count_above, kth_greatest, rank_keys
from renderer.control_response import (
    ResponsePlan,
    constrain_active,
    gather_active,
    mix_active,
    water_levels,
    write_densities,
)
from renderer.control_selection import (
    forget_slots,
    gather_credit,
    list_victims,
    place_samples,
    rank_slots,
    refresh_due,
    store_framelet,
)
from renderer.control_tiling import count_exceeding, emit_tiles, mark_splits, sum_account, sum_nodes
from renderer.launching import Address


@wp.struct
class CacheView:
    """Addresses of a framelet cache's tensors."""

    slots: wp.int32
    samples: wp.int32
    state: wp.int32
    level: wp.uint64
    index: wp.uint64
    time_s: wp.uint64
    dead: wp.uint64
    color: wp.uint64
    coefficients: wp.uint64
    slot_of_node: wp.uint64


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


@wp.kernel(enable_backward=False)
def select_tiles(
    scratch: Scratch,
    batch: wp.int32,
    field_level: wp.int32,
    tiles: wp.int32,
    level: Address,
    index: Address,
    temporal: Address,
    history: Address,
    selected: Address,
    credit: Address,
):
    """The most overdue tiles, and the credit that is left."""
    gather_credit(tiles, field_level, level, index, temporal, history, scratch.value, credit)
    rank_keys(scratch.value, tiles, scratch.key)
    threshold = kth_greatest(scratch.key, tiles, batch)
    ties = batch - count_above(scratch.key, tiles, threshold)
    refresh_due(tiles, field_level, level, index, scratch.value, scratch.key, threshold, ties, selected, credit)


@wp.kernel(enable_backward=False)
def make_batch(
    samples: wp.int32,
    centre: Address,
    now_s: wp.float32,
    count: wp.int32,
    level: Address,
    index: Address,
    selected: Address,
    level_out: Address,
    index_out: Address,
    position: Address,
    time_s: Address,
):
    """The request to the renderer."""
    for row in range(count):
        place_samples(row, samples, now_s, centre, level, index, selected, level_out, index_out, position, time_s)


@wp.func
def slot_of(cache: CacheView, level: wp.int64, index: wp.int64) -> wp.int64:
    """Slot of the newest framelet of a tile, -1 where there is none."""
    slots = wp.array(ptr=cache.slot_of_node, shape=(1,), dtype=wp.int64)
    one = wp.int64(1)
    return slots[wp.int32(((one << (wp.int64(2) * level)) - one) / wp.int64(3) + index)]


@wp.kernel(enable_backward=False)
def estimate_batch(
    plan: ErrorPlan,
    cache: CacheView,
    scratch: Address,
    bad: Address,
    count: wp.int32,
    level: Address,
    index: Address,
    color: Address,
    coefficients: Address,
    errors_spatial: Address,
    errors_temporal: Address,
):
    """Errors and wavelet states of a batch; ``bad`` receives how many framelets hold a sample that is not finite."""
    levels = wp.array(ptr=level, shape=(count,), dtype=wp.int64)
    indices = wp.array(ptr=index, shape=(count,), dtype=wp.int64)
    found = wp.int32(0)
    slot = slot_of(cache, levels[0], indices[0])
    for row in range(count):
        following = wp.min(row + 1, count - 1)
        next_slot = slot_of(cache, levels[following], indices[following])
        fetch_ahead(plan, next_slot, cache.coefficients)
        found += estimate_framelet(
            row,
            plan,
            levels[row],
            indices[row],
            slot,
            color,
            cache.coefficients,
            coefficients,
            errors_spatial,
            errors_temporal,
            scratch,
        )
        slot = next_slot
    result = wp.array(ptr=bad, shape=(1,), dtype=wp.int32)
    result[0] = found


@wp.kernel(enable_backward=False)
def insert_batch(
    cache: CacheView,
    scratch: Scratch,
    count: wp.int32,
    slot: Address,
    level: Address,
    index: Address,
    time_s: Address,
    color: Address,
    coefficients: Address,
):
    """A batch over the slots that are worth least: the dead, oldest first, then the oldest of the rest."""
    with_dead = rank_slots(cache.slots, count, cache.time_s, cache.dead, scratch.value)
    wanted = count - with_dead
    rank_keys(scratch.value, cache.slots, scratch.key)
    threshold = kth_greatest(scratch.key, cache.slots, wanted)
    ties = wanted - count_above(scratch.key, cache.slots, threshold)
    list_victims(cache.slots, scratch.key, threshold, ties, with_dead, cache.dead, slot)
    forget_slots(count, slot, cache.level, cache.index, cache.slot_of_node)
    for row in range(count):
        store_framelet(
            row, cache.samples, cache.state, slot, level, index, time_s, color, coefficients,
            cache.level, cache.index, cache.time_s, cache.color, cache.coefficients, cache.dead, cache.slot_of_node,
        )  # fmt: skip


@wp.kernel(enable_backward=False)
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
    count = gather_active(plan, spatial, temporal, error_spatial, error_temporal, active, columns)
    constrain_active(plan, count, columns)
    levels = water_levels(plan, count, columns, surplus / (plan.spatial_high * plan.temporal_high))
    mix_active(plan, count, columns, levels[0], levels[1])
    freed = write_densities(plan, count, active, columns, spatial, temporal, spatial_after, temporal_after)
    surplus_after = wp.array(ptr=result, shape=(1,), dtype=wp.float64)
    surplus_after[0] = wp.max(surplus + freed, wp.float64(0.0))


@wp.kernel(enable_backward=False)
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


@wp.kernel(enable_backward=False)
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
