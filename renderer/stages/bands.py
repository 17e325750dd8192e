"""Reconstruction, second half, in C: bands of rows, each small enough for the second-level cache, from the threshold
of ages to finished pixels. Definitions in ``tsar/reconstruction.py``.

A band's working memory holds five planes of its pixels: threshold, sums of weight, red, green, blue. A framelet is
first expanded along rows to pixels (*rows*, one per row of samples), then every row of pixels is a blend of two of
these: ``native/display.h``.
"""

from __future__ import annotations

import warp as wp

from renderer.compute.launching import Address
from renderer.stages.ages import DisplayPlan

PLANES = 5


@wp.func_native("""
    const int side = 1 << plan.level_high, n = plan.resolution;
    const int shift = 31 - __builtin_clz(n >> plan.level_high), width = 1 << shift;  // of a cell, pixels
    const double* rows = (const double*)plan.row_sum;
    float* __restrict__ out = (float*)planes;
    double* __restrict__ sum = (double*)box;
    float* __restrict__ own = (float*)ages;
    const float support = 2 * plan.half + 1, scale = 65536.0f * support * support;
    for (int x = 0; x < n; ++x) sum[x] = 0.0;
    for (int i = -plan.half; i <= plan.half; ++i) {
        const double* __restrict__ row = rows + (long long)(wp::min(wp::max(top + i, 0), n - 1) >> shift) * n;
        for (int x = 0; x < n; ++x) sum[x] += row[x];
    }
    for (int y = top; y < bottom; ++y) {
        if (y == top || y % width == 0)
            for (int x = 0; x < n; ++x) own[x] = ((const float*)plan.cell_age)[(y >> shift) * side + (x >> shift)];
        float* __restrict__ to = out + (long long)(y - top) * n;
        for (int x = 0; x < n; ++x) to[x] = plan.half == 0 ? own[x] : wp::min(own[x], (float)sum[x] / scale);
        const int enters = wp::min(y + plan.half + 1, n - 1) >> shift, leaves = wp::max(y - plan.half, 0) >> shift;
        if (enters == leaves) continue;
        const double *__restrict__ in = rows + (long long)enters * n, *__restrict__ off = rows + (long long)leaves * n;
        for (int x = 0; x < n; ++x) sum[x] += in[x] - off[x];
    }
    memset(out + (long long)plan.band * n, 0, 16ll * plan.band * n);
""")
def begin_band(plan: DisplayPlan, top: wp.int32, bottom: wp.int32, planes: Address, box: Address, ages: Address):
    """Thresholds of the rows from ``top`` to before ``bottom``, and empty sums."""
    ...


@wp.func_native("""
    long long place = 0;
    for (int bit = 0; bit < level; ++bit) place |= ((index >> (2 * bit + axis)) & 1) << bit;
    return (int)place * (plan.resolution >> level);
""")
def corner(plan: DisplayPlan, level: wp.int32, index: wp.int64, axis: wp.int32) -> wp.int32:
    """First pixel of a tile along an axis, x being 0."""
    ...


@wp.func_native("""
    const int n = plan.resolution, width = n >> level, margin = ((const int*)plan.margin)[level - plan.level_low];
    const float* threshold = (const float*)planes;
    const int left = wp::max(x - margin, 0), right = wp::min(x + width + margin, n);
    for (int row = wp::max(y - margin, top); row < wp::min(y + width + margin, bottom); ++row) {
        const float* line = threshold + (long long)(row - top) * n;
        int passing = 0;
        for (int i = left; i < right; ++i) passing |= age >= line[i];
        if (passing) return 1;
    }
    return 0;
""")
def passes(
    plan: DisplayPlan,
    level: wp.int32,
    x: wp.int32,
    y: wp.int32,
    age: wp.float32,
    top: wp.int32,
    bottom: wp.int32,
    planes: Address,
) -> wp.int32:
    """Whether a framelet is not older than the threshold at some pixel of the band that it reaches."""
    ...


@wp.func_native(
    "display::expand_rows(plan, slot, level, y, top, bottom, (const float*)color, (float*)samples, (float*)rows);"
)
def expand_rows(
    plan: DisplayPlan,
    slot: wp.int32,
    level: wp.int32,
    y: wp.int32,
    top: wp.int32,
    bottom: wp.int32,
    color: Address,
    samples: Address,
    rows: Address,
):
    """Rows of a framelet's samples, as many as the band needs, interpolated to pixels; per row red, green, blue."""
    ...


@wp.func_native("display::blend_rows(plan, level, x, y, age, top, bottom, (const float*)rows, (float*)planes);")
def blend_rows(
    plan: DisplayPlan,
    level: wp.int32,
    x: wp.int32,
    y: wp.int32,
    age: wp.float32,
    top: wp.int32,
    bottom: wp.int32,
    rows: Address,
    planes: Address,
):
    """Adds a framelet to the band's sums: cycles by which it is newer than the threshold, and half a cycle more."""
    ...


@wp.func_native("""
    const long long plane = (long long)plan.band * plan.resolution, count = (long long)(bottom - top) * plan.resolution;
    const float* __restrict__ sum = (const float*)planes + plane;
    const float *__restrict__ red = sum + plane, *__restrict__ green = red + plane, *__restrict__ blue = green + plane;
    float* __restrict__ out = (float*)image + 3ll * top * plan.resolution;
    int holes = 0;
    for (long long i = 0; i < count; ++i) {
        holes |= !(sum[i] > 0.0f);
        const float by = 1.0f / sum[i];
        out[3 * i] = red[i] * by, out[3 * i + 1] = green[i] * by, out[3 * i + 2] = blue[i] * by;
    }
    return holes;
""")
def finish_band(plan: DisplayPlan, top: wp.int32, bottom: wp.int32, planes: Address, image: Address) -> wp.int32:
    """Sums to colours. Returns whether some pixel has none."""
    ...


@wp.func_native("""
    const long long* l = (const long long*)level;
    unsigned char* gone = (unsigned char*)dead;
    const int* flag = (const int*)plan.seen;
    double pixels = 0.0;
    for (int i = 0; i < slots; ++i) {
        if (l[i] < 0) continue;
        const double reach = (plan.resolution >> l[i]) + 2 * ((const int*)plan.margin)[l[i] - plan.level_low];
        if (flag[i]) pixels += reach * reach; else gone[i] = 1;
    }
    return pixels / ((double)plan.resolution * plan.resolution);
""")
def bury(plan: DisplayPlan, slots: wp.int32, level: Address, dead: Address) -> wp.float64:
    """Flags the framelets that passed nowhere. Returns the area of the others, in units of the image."""
    ...
