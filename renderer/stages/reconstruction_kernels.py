"""Kernel entry points of reconstruction on the CPU: ages, bands of the image, dead framelets."""

from __future__ import annotations

import warp as wp

from renderer.compute.launching import Address
from renderer.compute.native_code import module_options
from renderer.stages import sizes
from renderer.stages.ages import DisplayPlan, list_candidates, map_newest, smooth_rows
from renderer.stages.bands import begin_band, blend_rows, bury, corner, expand_rows, finish_band, passes

wp.set_module_options(module_options("ages.h", "bands.h", "display.h", given=sizes.GIVEN))


@wp.struct
class CachedFramelets:
    """Addresses of a framelet cache's tensors."""

    slots: wp.int32
    level: wp.uint64
    index: wp.uint64
    time_s: wp.uint64
    dead: wp.uint64
    color: wp.uint64


@wp.struct
class Worker:
    """Addresses of the working memory of one thread."""

    planes: wp.uint64
    samples: wp.uint64
    """float32: rows of a framelet before interpolation."""
    rows: wp.uint64
    box: wp.uint64
    ages: wp.uint64
    result: wp.uint64
    """int32: whether there is a hole."""


@wp.kernel
def find_candidates(
    plan: DisplayPlan,
    cache: CachedFramelets,
    result: Address,
    cycle_s: wp.float64,
    newest_s: Address,
    newest_level: Address,
):
    """Computes the newest samples of every cell and their smoothed ages, and lists the framelets that may be visible;
    ``result`` receives their number."""
    reference = map_newest(plan, cache.slots, cache.level, cache.index, cache.time_s, newest_s, newest_level)
    smooth_rows(plan, reference, cycle_s, newest_s)
    count = wp.array(ptr=result, shape=(1,), dtype=wp.int32)
    count[0] = list_candidates(plan, reference, cycle_s, cache.slots, cache.level, cache.index, cache.time_s)


@wp.func_native("return __atomic_fetch_add((int*)counter, 1, __ATOMIC_RELAXED);")
def take(counter: Address) -> wp.int32:
    """The next number of a shared counter."""
    ...


@wp.kernel
def paint_bands(
    plan: DisplayPlan,
    cache: CachedFramelets,
    worker: Worker,
    taken: Address,
    candidates: wp.int32,
    image: Address,
):
    """Renders bands that no other thread has taken. A pixel sums its framelets in the order of their slots, so its bits
    do not depend on the distribution of bands."""
    slots = wp.array(ptr=plan.candidate, shape=(candidates,), dtype=wp.int32)
    levels = wp.array(ptr=cache.level, shape=(cache.slots,), dtype=wp.int64)
    indices = wp.array(ptr=cache.index, shape=(cache.slots,), dtype=wp.int64)
    ages = wp.array(ptr=plan.slot_age, shape=(cache.slots,), dtype=wp.float32)
    seen = wp.array(ptr=plan.seen, shape=(cache.slots,), dtype=wp.int32)
    holes = wp.array(ptr=worker.result, shape=(1,), dtype=wp.int32)
    holes[0] = 0
    band = take(taken)
    while band < plan.resolution / plan.band:
        top = band * plan.band
        bottom = top + plan.band
        begin_band(plan, top, bottom, worker.planes, worker.box, worker.ages)
        for i in range(candidates):
            slot = slots[i]
            level = wp.int32(levels[slot])
            y = corner(plan, level, indices[slot], 1)
            x = corner(plan, level, indices[slot], 0)
            if passes(plan, level, x, y, ages[slot], top, bottom, worker.planes) != 0:
                seen[slot] = 1
                expand_rows(plan, slot, level, y, top, bottom, cache.color, worker.samples, worker.rows)
                blend_rows(plan, level, x, y, ages[slot], top, bottom, worker.rows, worker.planes)
        holes[0] = holes[0] | finish_band(plan, top, bottom, worker.planes, image)
        band = take(taken)


@wp.kernel
def bury_dead(plan: DisplayPlan, cache: CachedFramelets, result: Address):
    """Flags the framelets that were not visible; ``result`` receives the area of the others."""
    overdraw = wp.array(ptr=result, shape=(1,), dtype=wp.float64)
    overdraw[0] = bury(plan, cache.slots, cache.level, cache.dead)
