"""Reconstruction, first half, in C: how old the newest samples are, and which framelets may still be seen.

*Cells* are tiles of the finest level, raster order. Definitions in ``tsar/reconstruction.py``.
"""

from __future__ import annotations

import warp as wp

from renderer.compute.launching import Address


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
    row_integral: wp.uint64
    """float64, working memory: one for each pixel of a row that smoothing reaches, and one more."""
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
    const int side = 1 << plan.level_high, n = plan.resolution, width = n >> plan.level_high, half = plan.half;
    float* age = (float*)plan.cell_age;
    for (int i = 0; i < side * side; ++i) age[i] = (float)wp::max((map[i] - reference) / cycle_s, -1e6);
    double* __restrict__ upto = (double*)plan.row_integral;  // the integral up to each pixel, borders repeated
    for (int row = 0; row < side; ++row) {
        double sum = 0.0, here = 0.0;
        int at = 0;
        for (int cell = -1; cell <= side; ++cell) {
            // Whole numbers of 1 / 65536 cycles, which float64 adds without rounding, in any order.
            here = __builtin_rint((double)age[row * side + wp::min(wp::max(cell, 0), side - 1)] * 65536.0);
            const int pixels = cell < 0 ? half : cell < side ? width : half + 1;
            for (int i = 0; i < pixels; ++i) upto[at + i] = sum + here * i;
            sum += here * pixels, at += pixels;
        }
        double* __restrict__ out = (double*)plan.row_sum + (long long)row * n;
        for (int x = 0; x < n; ++x) out[x] = upto[x + 2 * half + 1] - upto[x];
    }
""")
def smooth_rows(plan: DisplayPlan, reference: wp.float64, cycle_s: wp.float64, newest_s: Address):
    """Ages of the cells in cycles, and their sums along rows."""
    ...


@wp.func_native("""
    const int side = 1 << plan.level_high;
    const float* age = (const float*)plan.cell_age;
    float *least = (float*)plan.cell_least, *__restrict__ across = least + side * side;
    for (int y = 0; y < side; ++y) {
        for (int x = 0; x < side; ++x) across[y * side + x] = 0.0f;
        for (int by = -plan.reach; by <= plan.reach; ++by)
            for (int x = wp::max(-by, 0); x < wp::min(side - by, side); ++x)
                across[y * side + x] = wp::min(across[y * side + x], age[y * side + x + by]);
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
