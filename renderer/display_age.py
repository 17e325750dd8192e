"""Reconstruction, first half, in C: how old the newest samples are, and which framelets may still be seen.

*Cells* are tiles of the finest level, raster order. Definitions in ``tsar/reconstruction.py``.
"""

from __future__ import annotations

import warp as wp

from renderer.launching import Address


@wp.struct
class DisplayPlan:
    """What of the configuration reconstruction depends on, and where its working memory lies."""

    resolution: wp.int32
    level_low: wp.int32
    level_high: wp.int32
    side: wp.int32
    """Samples along a framelet's side."""
    half: wp.int32
    """Pixels that the smoothing of ages reaches to either side."""
    reach: wp.int32
    """Cells that smoothing and the widest margin reach to either side."""
    band: wp.int32
    """Rows of the image that are finished at a time."""
    order: wp.uint64
    """int32, raster to Morton order of a framelet's samples."""
    left: wp.uint64
    right: wp.uint64
    """int32, of each pixel of a tile along an axis, margin included: the two samples that it lies between; level after
    level from the coarsest, as are the next three."""
    share_left: wp.uint64
    share_right: wp.uint64
    """float32, their shares, which sum to one."""
    weight: wp.uint64
    """float32, below one in the margin and at the border, where the neighbouring tile adds the rest."""
    first: wp.uint64
    """int32, where a level's pixels begin in these."""
    margin: wp.uint64
    """int32, pixels of margin of a level's tiles."""
    node_time: wp.uint64
    """float64, of every node of the quadtree."""
    node_level: wp.uint64
    """int32, the same."""
    cell_age: wp.uint64
    """float32, per cell."""
    cell_least: wp.uint64
    """float32, per cell, and as much again to work in."""
    row_sum: wp.uint64
    """float64, per row of cells the sums of ages over a box of pixels around each column."""
    slot_age: wp.uint64
    """float32, per slot."""
    candidate: wp.uint64
    """int32, slots that may be seen."""
    seen: wp.uint64
    """int32, per slot."""


@wp.func_native("""
    const long long *l = (const long long*)level, *at = (const long long*)index;
    const double* t = (const double*)time_s;
    double* newest = (double*)plan.node_time;
    int* from = (int*)plan.node_level;
    const int last = ((1 << (2 * plan.level_high + 2)) - 1) / 3;
    for (int node = 0; node < last; ++node) newest[node] = -INFINITY;
    for (int i = 0; i < slots; ++i) {
        if (l[i] < 0) continue;
        const long long node = ((1ll << (2 * l[i])) - 1) / 3 + at[i];
        newest[node] = wp::max(newest[node], t[i]);
    }
    for (int here = plan.level_low; here <= plan.level_high; ++here) {
        const int base = ((1 << (2 * here)) - 1) / 3, above = ((1 << (2 * here - 2)) - 1) / 3;
        const bool top = here == plan.level_low;
        for (int i = 0; i < 1 << (2 * here); ++i) {
            const double inherited = top ? -INFINITY : newest[above + i / 4];
            const bool own = newest[base + i] >= inherited & newest[base + i] > -INFINITY;
            from[base + i] = (own | top) ? here : from[above + i / 4];
            newest[base + i] = wp::max(newest[base + i], inherited);
        }
    }
    const int side = 1 << plan.level_high, base = ((1 << (2 * plan.level_high)) - 1) / 3;
    double *map = (double*)newest_s, reference = -INFINITY;
    long long* source = (long long*)newest_level;
    for (int i = 0; i < side * side; ++i) {
        int x = 0, y = 0;
        for (int bit = 0; bit < 9; ++bit) {  // unrolled, and so vectorised; no level is finer
            x |= ((i >> (2 * bit)) & 1) << bit;
            y |= ((i >> (2 * bit + 1)) & 1) << bit;
        }
        map[y * side + x] = newest[base + i];
        source[y * side + x] = from[base + i];
        reference = wp::max(reference, newest[base + i]);
    }
    return reference > -INFINITY ? reference : 0.0;
""")
def map_newest(
    plan: DisplayPlan,
    slots: wp.int32,
    level: Address,
    index: Address,
    time_s: Address,
    newest_s: Address,
    newest_level: Address,
) -> wp.float64:
    """Newest time and its level over every cell. Returns the newest of all, 0 where there is none."""
    ...


@wp.func_native("""
    const double* map = (const double*)newest_s;
    const int side = 1 << plan.level_high, shift = 31 - __builtin_clz(plan.resolution >> plan.level_high);
    const double width = 1 << shift;  // of a cell, pixels
    float* age = (float*)plan.cell_age;
    for (int i = 0; i < side * side; ++i) age[i] = (float)wp::max((map[i] - reference) / cycle_s, -1e6);
    for (int row = 0; row < side; ++row) {
        // Whole numbers of 1 / 65536 cycles, which float64 adds without rounding, in any order.
        double before[513];
        before[0] = 0.0;
        const float* cell = age + row * side;
        for (int i = 0; i < side; ++i) before[i + 1] = before[i] + __builtin_rint((double)cell[i] * 65536.0);
        double* out = (double*)plan.row_sum + (long long)row * plan.resolution;
        const double leftmost = before[1], rightmost = before[side] - before[side - 1];
        for (int x = 0; x < plan.resolution; ++x) {
            // Sum over the pixels from x - half to x + half, borders repeated: a difference of two integrals.
            const int low = x - plan.half, high = x + plan.half + 1;
            const int a = wp::max(low, 0), b = wp::min(high, plan.resolution);
            const int cell_a = wp::min(a >> shift, side - 1), cell_b = wp::min(b >> shift, side - 1);
            const int past_a = a - (cell_a << shift), past_b = b - (cell_b << shift);
            const double upto_a = before[cell_a] * width + (before[cell_a + 1] - before[cell_a]) * past_a;
            const double upto_b = before[cell_b] * width + (before[cell_b + 1] - before[cell_b]) * past_b;
            out[x] = upto_b - upto_a + leftmost * (a - low) + rightmost * (high - b);
        }
    }
""")
def smooth_rows(plan: DisplayPlan, reference: wp.float64, cycle_s: wp.float64, newest_s: Address):
    """Ages of the cells in cycles, and their sums along rows."""
    ...


@wp.func_native("""
    const int side = 1 << plan.level_high;
    const float* age = (const float*)plan.cell_age;
    float *least = (float*)plan.cell_least, *across = least + side * side;
    for (int y = 0; y < side; ++y)
        for (int x = 0; x < side; ++x) {
            float low = 0.0f;
            for (int i = wp::max(x - plan.reach, 0); i <= wp::min(x + plan.reach, side - 1); ++i)
                low = wp::min(low, age[y * side + i]);
            across[y * side + x] = low;
        }
    for (int y = 0; y < side; ++y) {
        for (int x = 0; x < side; ++x) least[y * side + x] = 0.0f;
        for (int i = wp::max(y - plan.reach, 0); i <= wp::min(y + plan.reach, side - 1); ++i)
            for (int x = 0; x < side; ++x) least[y * side + x] = wp::min(least[y * side + x], across[i * side + x]);
    }
    const long long *l = (const long long*)level, *at = (const long long*)index;
    const double* t = (const double*)time_s;
    float* own = (float*)plan.slot_age;
    int *out = (int*)plan.candidate, *flag = (int*)plan.seen, count = 0;
    for (int i = 0; i < slots; ++i) {
        flag[i] = 0;
        if (l[i] < 0) continue;
        own[i] = (float)((t[i] - reference) / cycle_s);
        int x = 0, y = 0;
        for (int bit = 0; bit < l[i]; ++bit) {
            x |= ((at[i] >> (2 * bit)) & 1) << bit;
            y |= ((at[i] >> (2 * bit + 1)) & 1) << bit;
        }
        const int shift = plan.level_high - (int)l[i], cells = 1 << shift;
        float low = 0.0f;
        for (int v = y << shift; v < (y << shift) + cells; ++v)
            for (int u = x << shift; u < (x << shift) + cells; ++u) low = wp::min(low, least[v * side + u]);
        // One step of the rounding of ages to spare.
        if (own[i] >= low - 2e-5f - 1e-6f * wp::abs(low)) out[count++] = i;
    }
    return count;
""")
def list_candidates(
    plan: DisplayPlan,
    reference: wp.float64,
    cycle_s: wp.float64,
    slots: wp.int32,
    level: Address,
    index: Address,
    time_s: Address,
) -> wp.int32:
    """Slots not older than everything that smoothing and their margins reach; the others cannot be seen."""
    ...
