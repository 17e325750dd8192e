// Ages of the newest samples, and framelets that may be visible. *Cells* are tiles of the finest level in raster order.
// Definitions are in `tsar/reconstruction.py`.
#pragma once
#include "quadtree.h"

namespace display {

using namespace given;
using quadtree::column_of;
using quadtree::first_node;
using quadtree::row_of;

// Newest time of every node, and then of every node and its ancestors, with its level.
template <class Plan>
inline void newest_of_nodes(const Plan& plan, int slots, const long long* level, const long long* index,
                            const double* time_s) {
    double* newest = (double*)plan.node_time;
    int* from = (int*)plan.node_level;
    const long long nodes = first_node(plan.level_high + 1);
    for (int node = 0; node < nodes; ++node) newest[node] = -__builtin_inf();
    for (int i = 0; i < slots; ++i) {
        if (level[i] < 0) continue;
        double& node = newest[first_node(level[i]) + index[i]];
        node = wp::max(node, time_s[i]);
    }
    for (int here = plan.level_low; here <= plan.level_high; ++here) {
        const bool top = here == plan.level_low;
        const int base = (int)first_node(here), above = top ? 0 : (int)first_node(here - 1);
        for (int i = 0; i < 1 << (2 * here); ++i) {
            const double inherited = top ? -__builtin_inf() : newest[above + i / 4];
            const bool own = newest[base + i] >= inherited & newest[base + i] > -__builtin_inf();
            from[base + i] = (own | top) ? here : from[above + i / 4];
            newest[base + i] = wp::max(newest[base + i], inherited);
        }
    }
}

// Newest time and its level over every cell. Returns the newest of all, 0 if there is none.
template <class Plan>
inline double map_newest(const Plan& plan, int slots, const long long* level, const long long* index,
                         const double* time_s, double* newest_s, long long* newest_level) {
    newest_of_nodes(plan, slots, level, index, time_s);
    const int side = 1 << plan.level_high, base = (int)first_node(plan.level_high);
    const double* newest = (const double*)plan.node_time + base;
    const int* from = (const int*)plan.node_level + base;
    double reference = -__builtin_inf();
    for (int i = 0; i < side * side; ++i) {
        const int cell = row_of(i) * side + column_of(i);
        newest_s[cell] = newest[i];
        newest_level[cell] = from[i];
        reference = wp::max(reference, newest[i]);
    }
    return reference > -__builtin_inf() ? reference : 0.0;
}

// Ages of the cells in cycles, and their sums along rows.
template <class Plan>
inline void smooth_rows(const Plan& plan, double reference, double cycle_s, const double* newest_s) {
    const int side = 1 << plan.level_high, n = plan.resolution, width = n >> plan.level_high, half = plan.half;
    float* age = (float*)plan.cell_age;
    for (int i = 0; i < side * side; ++i)
        age[i] = (float)wp::max((newest_s[i] - reference) / cycle_s, (double)-AGE_MOST);
    double* __restrict__ upto = (double*)plan.row_integral;  // sum up to each pixel, with borders repeated
    for (int row = 0; row < side; ++row) {
        double sum = 0.0, here = 0.0;
        int at = 0;
        for (int cell = -1; cell <= side; ++cell) {
            // Integers, which float64 adds without rounding, in any order.
            here = __builtin_rint((double)age[row * side + wp::min(wp::max(cell, 0), side - 1)] * (double)AGE_STEPS);
            const int pixels = cell < 0 ? half : cell < side ? width : half + 1;
            for (int i = 0; i < pixels; ++i) upto[at + i] = sum + here * i;
            sum += here * pixels, at += pixels;
        }
        double* __restrict__ out = (double*)plan.row_sum + (long long)row * n;
        for (int x = 0; x < n; ++x) out[x] = upto[x + 2 * half + 1] - upto[x];
    }
}

// The least age of the cells within reach of smoothing and margins from each cell.
template <class Plan> inline const float* least_ages(const Plan& plan) {
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
    return least;
}

// Lists the slots that are not older than all cells within reach of smoothing and their margins; the others cannot be
// visible. Returns their number.
template <class Plan>
inline int list_candidates(const Plan& plan, double reference, double cycle_s, int slots, const long long* level,
                           const long long* index, const double* time_s) {
    const int side = 1 << plan.level_high;
    const float* least = least_ages(plan);
    float* own = (float*)plan.slot_age;
    int *out = (int*)plan.candidate, *seen = (int*)plan.seen, count = 0;
    for (int i = 0; i < slots; ++i) {
        seen[i] = 0;
        if (level[i] < 0) continue;
        own[i] = (float)((time_s[i] - reference) / cycle_s);
        const int shift = plan.level_high - (int)level[i], cells = 1 << shift;
        const int left = column_of(index[i]) << shift, top = row_of(index[i]) << shift;
        float low = 0.0f;
        for (int y = top; y < top + cells; ++y)
            for (int x = left; x < left + cells; ++x) low = wp::min(low, least[y * side + x]);
        // Tolerance: one rounding step of ages.
        if (own[i] >= low - 2e-5f - 1e-6f * wp::abs(low)) out[count++] = i;
    }
    return count;
}

}  // namespace display
