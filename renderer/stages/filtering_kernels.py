"""Kernel entry points of the filter's stages (``native/surfels.h``, ``taking.h``, ``batches.h``, ``gains.h``,
``pyramid.h``), defined in ``tsar/filtering``. Threads take rows."""

from __future__ import annotations

import warp as wp

from renderer.compute.launching import Address
from renderer.compute.native_code import module_options
from renderer.stages import sizes

wp.set_module_options(module_options("batches.h", "gains.h", "pyramid.h", "taking.h", given=sizes.FILTERING))


@wp.struct
class FilterPlan:
    """Size of the picture, and addresses of working memory for each of its pixels."""

    side: wp.int32
    perspective: wp.int32
    motion: wp.uint64
    """float32, where surfels are and how far they moved, pixels: x, y, x, y."""
    aged: wp.uint64
    """float32, variance by change at the new time."""
    depth: wp.uint64
    """float64."""
    front: wp.uint64
    """float64, depth of the surfel that each pixel takes, infinite in the frame around them."""
    source: wp.uint64
    """int32, the surfel that each pixel takes, -1 where it takes none."""
    slot: wp.uint64
    """int32, where the sums of a pixel's samples are, -1 between launches."""
    pixel: wp.uint64
    """``batches::Pixel`` for every sample of a batch."""
    done: wp.uint64
    """uint8, 0 between launches."""


@wp.func_native("""
    surfels::offer_own(plan, {(const double*)rows, row_count, tan_x, tan_y}, (const long long*)instance,
                       (const float*)point, (const float*)position,
                       {(const float*)plan.aged, (const float*)inverse, (const float*)roughness},
                       {(const float*)aged, (const float*)rate, seconds}, ((surfels::Band*)bands)[number]);
""")
def native_offer(
    plan: FilterPlan,
    bands: Address,
    number: wp.int32,
    rows: Address,
    row_count: wp.int32,
    tan_x: wp.float64,
    tan_y: wp.float64,
    instance: Address,
    point: Address,
    inverse: Address,
    roughness: Address,
    position: Address,
    aged: Address,
    rate: Address,
    seconds: wp.float32,
): ...


@wp.func_native("""
    surfels::choose(plan, {(const double*)rows, row_count, tan_x, tan_y}, (const long long*)instance,
                    (const float*)point, {(const float*)plan.aged, (const float*)inverse, (const float*)roughness},
                    (const surfels::Band*)bands, band_count, number);
""")
def native_choose(
    plan: FilterPlan,
    bands: Address,
    band_count: wp.int32,
    number: wp.int32,
    rows: Address,
    row_count: wp.int32,
    tan_x: wp.float64,
    tan_y: wp.float64,
    instance: Address,
    point: Address,
    inverse: Address,
    roughness: Address,
): ...


@wp.func_native("surfels::take_rows(plan, (const long long*)planes, ((const surfels::Band*)bands)[number]);")
def native_take(plan: FilterPlan, bands: Address, number: wp.int32, planes: Address): ...


@wp.func_native("""
    batches::take_in(plan, (const long long*)addresses, tiles, {(const double*)rows, row_count, tan_x, tan_y},
                     {(const double*)earlier_rows, earlier_count, earlier_tan_x, earlier_tan_y},
                     {now_s, memory_s, rate_max, reprojected, accumulates, spreads}, (int*)plan.slot,
                     (batches::Pixel*)plan.pixel, (unsigned char*)plan.done);
""")
def native_take_in(
    plan: FilterPlan,
    addresses: Address,
    tiles: wp.int32,
    now_s: wp.float64,
    memory_s: wp.float32,
    rate_max: wp.float32,
    reprojected: wp.int32,
    accumulates: wp.int32,
    spreads: wp.int32,
    rows: Address,
    row_count: wp.int32,
    tan_x: wp.float64,
    tan_y: wp.float64,
    earlier_rows: Address,
    earlier_count: wp.int32,
    earlier_tan_x: wp.float64,
    earlier_tan_y: wp.float64,
): ...


@wp.func_native("""
    gains::of_tiles({(const float*)variance, (const float*)roughness, (const float*)rate, (const float*)step,
                     (const long long*)instance},
                    {cycle_s, reach_px, life_min_s, life_max_s}, side, coarsest, levels, spacing, first, last,
                    (double*)gain);
""")
def native_gain(
    side: wp.int32,
    coarsest: wp.int32,
    levels: wp.int32,
    spacing: wp.float32,
    gain: Address,
    first: wp.int32,
    last: wp.int32,
    variance: Address,
    roughness: Address,
    rate: Address,
    step: Address,
    instance: Address,
    cycle_s: wp.float32,
    reach_px: wp.float32,
    life_min_s: wp.float32,
    life_max_s: wp.float32,
): ...


@wp.func_native("""
    *(int*)found = gains::best((const double*)gain, levels, coarsest, limit, (double*)most, (unsigned char*)taken);
""")
def native_best(
    gain: Address,
    levels: wp.int32,
    coarsest: wp.int32,
    most: Address,
    taken: Address,
    found: Address,
    limit: wp.int32,
): ...


@wp.func_native("pyramid::shrink(*(const pyramid::Picture*)picture, side, seconds, first, last, (float*)spare);")
def native_shrink(
    picture: Address, side: wp.int32, first: wp.int32, last: wp.int32, spare: Address, seconds: wp.float32
): ...


@wp.func_native("pyramid::smooth((float*)levels, side, (float*)spare);")
def native_smooth(levels: Address, side: wp.int32, spare: Address): ...


@wp.func_native("pyramid::show(*(const pyramid::Picture*)picture, side, first, last, (float*)spare);")
def native_show(picture: Address, side: wp.int32, first: wp.int32, last: wp.int32, spare: Address): ...


@wp.kernel
def offer(
    plan: FilterPlan,
    bands: Address,
    number: wp.int32,
    rows: Address,
    row_count: wp.int32,
    tan_x: wp.float64,
    tan_y: wp.float64,
    instance: Address,
    point: Address,
    inverse: Address,
    roughness: Address,
    position: Address,
    aged: Address,
    rate: Address,
    seconds: wp.float32,
):
    """Where the surfels of a band are seen, and the best of them for each of its pixels; ``bands`` are
    ``surfels::Band``."""
    native_offer(plan, bands, number, rows, row_count, tan_x, tan_y, instance, point, inverse, roughness, position,
                 aged, rate, seconds)  # fmt: skip


@wp.kernel
def choose(
    plan: FilterPlan,
    bands: Address,
    band_count: wp.int32,
    number: wp.int32,
    rows: Address,
    row_count: wp.int32,
    tan_x: wp.float64,
    tan_y: wp.float64,
    instance: Address,
    point: Address,
    inverse: Address,
    roughness: Address,
):
    """The best of all surfels for each pixel of a band, once all bands were offered theirs."""
    native_choose(plan, bands, band_count, number, rows, row_count, tan_x, tan_y, instance, point, inverse,
                  roughness)  # fmt: skip


@wp.kernel
def take(plan: FilterPlan, bands: Address, number: wp.int32, planes: Address):
    """Estimates and surfels that the pixels of a band keep; ``planes`` are addresses of int64: of what there was
    (``surfels::Before``), then of what is written (``surfels::Planes``)."""
    native_take(plan, bands, number, planes)


@wp.kernel
def take_in(
    plan: FilterPlan,
    addresses: Address,
    tiles: wp.int32,
    now_s: wp.float64,
    memory_s: wp.float32,
    rate_max: wp.float32,
    reprojected: wp.int32,
    accumulates: wp.int32,
    spreads: wp.int32,
    rows: Address,
    row_count: wp.int32,
    tan_x: wp.float64,
    tan_y: wp.float64,
    earlier_rows: Address,
    earlier_count: wp.int32,
    earlier_tan_x: wp.float64,
    earlier_tan_y: wp.float64,
):
    """Estimates, surfels and change after a batch; ``addresses`` are int64, those of ``batches::Traced``,
    ``surfels::Planes`` and ``batches::Change``."""
    native_take_in(plan, addresses, tiles, now_s, memory_s, rate_max, reprojected, accumulates, spreads, rows,
                   row_count, tan_x, tan_y, earlier_rows, earlier_count, earlier_tan_x, earlier_tan_y)  # fmt: skip


@wp.kernel
def gain(
    side: wp.int32,
    coarsest: wp.int32,
    levels: wp.int32,
    spacing: wp.float32,
    gain: Address,
    first: wp.int32,
    last: wp.int32,
    variance: Address,
    roughness: Address,
    rate: Address,
    step: Address,
    instance: Address,
    cycle_s: wp.float32,
    reach_px: wp.float32,
    life_min_s: wp.float32,
    life_max_s: wp.float32,
):
    """What the tiles of all levels gain, in some rows of the coarsest."""
    native_gain(side, coarsest, levels, spacing, gain, first, last, variance, roughness, rate, step, instance,
                cycle_s, reach_px, life_min_s, life_max_s)  # fmt: skip


@wp.kernel
def best(
    gain: Address,
    levels: wp.int32,
    coarsest: wp.int32,
    most: Address,
    taken: Address,
    found: Address,
    limit: wp.int32,
):
    """The best tiles of all levels, and how many they are."""
    native_best(gain, levels, coarsest, most, taken, found, limit)


@wp.kernel
def shrink(picture: Address, side: wp.int32, first: wp.int32, last: wp.int32, spare: Address, seconds: wp.float32):
    """Some rows of the second finest level from the estimates; ``picture`` is a ``pyramid::Picture``."""
    native_shrink(picture, side, first, last, spare, seconds)


@wp.kernel
def smooth(levels: Address, side: wp.int32, spare: Address):
    """The coarser levels, from the second finest on, in place."""
    native_smooth(levels, side, spare)


@wp.kernel
def show(picture: Address, side: wp.int32, first: wp.int32, last: wp.int32, spare: Address):
    """The picture, from some rows of the second finest level."""
    native_show(picture, side, first, last, spare)
