// Bands of rows, each small enough for the second-level cache, from the threshold of ages to finished pixels.
// Definitions are in `tsar/reconstruction.py`.
#pragma once
#include "lanes.h"
#include "quadtree.h"

namespace display {

using namespace given;

// Sets the thresholds of the rows from `top` to before `bottom`, and clears the sums.
template <class Plan>
inline void begin_band(const Plan& plan, int top, int bottom, float* __restrict__ planes, double* __restrict__ box,
                       float* __restrict__ ages) {
    const int side = 1 << plan.level_high, n = plan.resolution;
    const int shift = 31 - __builtin_clz(n >> plan.level_high), width = 1 << shift;  // width of a cell, pixels
    const double* rows = (const double*)plan.row_sum;
    const float support = 2 * plan.half + 1, scale = AGE_STEPS * support * support;
    for (int x = 0; x < n; ++x) box[x] = 0.0;
    for (int i = -plan.half; i <= plan.half; ++i) {
        const double* __restrict__ row = rows + (long long)(wp::min(wp::max(top + i, 0), n - 1) >> shift) * n;
        for (int x = 0; x < n; ++x) box[x] += row[x];
    }
    for (int y = top; y < bottom; ++y) {
        if (y == top || y % width == 0)
            for (int x = 0; x < n; ++x) ages[x] = ((const float*)plan.cell_age)[(y >> shift) * side + (x >> shift)];
        float* __restrict__ to = planes + (long long)(y - top) * n;
        for (int x = 0; x < n; ++x) to[x] = plan.half == 0 ? ages[x] : wp::min(ages[x], (float)box[x] / scale);
        const int enters = wp::min(y + plan.half + 1, n - 1) >> shift, leaves = wp::max(y - plan.half, 0) >> shift;
        if (enters == leaves) continue;
        const double* __restrict__ in = rows + (long long)enters * n, * __restrict__ off = rows + (long long)leaves * n;
        for (int x = 0; x < n; ++x) box[x] += in[x] - off[x];
    }
    const long long plane = (long long)plan.band * n;
    __builtin_memset(planes + plane, 0, (PLANES - 1) * sizeof(float) * plane);
}

// First pixel of a tile along an axis; 0 is x.
template <class Plan> inline int corner(const Plan& plan, int level, long long index, int axis) {
    return quadtree::every_second_bit(index >> axis) * (plan.resolution >> level);
}

// Whether a framelet is not older than the threshold at some pixel of the band that it reaches.
template <class Plan>
inline bool passes(const Plan& plan, int level, int x, int y, float age, int top, int bottom, const float* threshold) {
    const int n = plan.resolution, width = n >> level, margin = ((const int*)plan.margin)[level - plan.level_low];
    const int left = wp::max(x - margin, 0), right = wp::min(x + width + margin, n);
    for (int row = wp::max(y - margin, top); row < wp::min(y + width + margin, bottom); ++row) {
        const float* line = threshold + (long long)(row - top) * n;
        int passing = 0;
        for (int i = left; i < right; ++i) passing |= age >= line[i];
        if (passing) return true;
    }
    return false;
}

// Converts sums to colours. Returns whether any pixel has none.
template <class Plan>
inline bool finish_band(const Plan& plan, int top, int bottom, const float* planes, float* image) {
    const long long plane = (long long)plan.band * plan.resolution, count = (long long)(bottom - top) * plan.resolution;
    const float* __restrict__ sum = planes + plane;
    const float* __restrict__ red = sum + plane, * __restrict__ green = red + plane, * __restrict__ blue = green + plane;
    float* __restrict__ out = image + 3ll * top * plan.resolution;
    int holes = 0;
    for (long long i = 0; i < count; ++i) {
        holes |= !(sum[i] > 0.0f);
        const float by = 1.0f / sum[i];
        out[3 * i] = red[i] * by, out[3 * i + 1] = green[i] * by, out[3 * i + 2] = blue[i] * by;
    }
    return holes;
}

// Flags the framelets that were visible nowhere. Returns the total area of the others, in units of the image.
template <class Plan> inline double bury(const Plan& plan, int slots, const long long* level, unsigned char* dead) {
    const int* seen = (const int*)plan.seen;
    double pixels = 0.0;
    for (int i = 0; i < slots; ++i) {
        if (level[i] < 0) continue;
        const double reach = (plan.resolution >> level[i]) + 2 * ((const int*)plan.margin)[level[i] - plan.level_low];
        if (seen[i])
            pixels += reach * reach;
        else
            dead[i] = 1;
    }
    return pixels / ((double)plan.resolution * plan.resolution);
}

}  // namespace display
