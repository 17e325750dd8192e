// Passes over the field and over the quadtree for the tiling, as defined in `tsar/tiling.py`.
#pragma once
#include "lanes.h"
#include "quadtree.h"
#include "ranking.h"

namespace tiling {

using packets::d8;
using quadtree::first_node;

// Sums of the four children of each of `count` nodes; children are consecutive.
inline void sum_children(const double* below, double* sums, int count) {
    int i = 0;
    for (; i + 8 <= count; i += 8) {
        d8 v[4];
        __builtin_memcpy(v, below + 4 * i, sizeof(v));
        const d8 ab = __builtin_shufflevector(v[0], v[1], 0, 4, 8, 12, 1, 5, 9, 13);
        const d8 cd = __builtin_shufflevector(v[0], v[1], 2, 6, 10, 14, 3, 7, 11, 15);
        const d8 ab_next = __builtin_shufflevector(v[2], v[3], 0, 4, 8, 12, 1, 5, 9, 13);
        const d8 cd_next = __builtin_shufflevector(v[2], v[3], 2, 6, 10, 14, 3, 7, 11, 15);
        const d8 a = __builtin_shufflevector(ab, ab_next, 0, 1, 2, 3, 8, 9, 10, 11);
        const d8 b = __builtin_shufflevector(ab, ab_next, 4, 5, 6, 7, 12, 13, 14, 15);
        const d8 c = __builtin_shufflevector(cd, cd_next, 0, 1, 2, 3, 8, 9, 10, 11);
        const d8 d = __builtin_shufflevector(cd, cd_next, 4, 5, 6, 7, 12, 13, 14, 15);
        const d8 sum = ((a + b) + c) + d;
        __builtin_memcpy(sums + i, &sum, sizeof(sum));
    }
    for (; i < count; ++i) sums[i] = ((below[4 * i] + below[4 * i + 1]) + below[4 * i + 2]) + below[4 * i + 3];
}

// Whether all values of a field are densities, not negative, infinite or NaN. The number of elements is a multiple of
// eight.
inline bool all_densities(const double* value, int count) {
    decltype(d8() < d8()) bad = 0;
    for (int i = 0; i < count; i += 8) {
        d8 v;
        __builtin_memcpy(&v, value + i, sizeof(v));
        bad |= ~((v >= 0.0) & (v <= __DBL_MAX__));
    }
    long long any = 0;
    for (int lane = 0; lane < 8; ++lane) any |= bad[lane];
    return !any;
}

// Computes the integrals over all nodes above the elements.
inline void sum_nodes(int field_level, int level_low, const double* density, double* sums) {
    for (int level = field_level - 1; level >= level_low; --level) {
        double* here = sums + first_node(level);
        sum_children(density, here, 1 << (2 * level));
        density = here;
    }
}

// Marks the nodes above the threshold, and the first `ties` of those at it in the order for equal nodes.
inline void mark_splits(int count, const ranking::Key* key, const long long* order, ranking::Key threshold, int ties,
                        unsigned char* split) {
    for (int i = 0; i < count; ++i) split[i] = key[i] > threshold;
    for (int i = 0; i < count && ties > 0; ++i)
        if (key[order[i]] == threshold) split[order[i]] = 1, --ties;
}

// Lists the nodes that are not split, in Morton order. Returns their number.
inline int emit_tiles(int level_low, int level_high, const unsigned char* split, long long* level, long long* index) {
    const long long base = first_node(level_low);
    int tiles = 0;
    // Along the curve, take the coarsest node that begins at each place, and descend while it is split.
    for (long long place = 0; place < 1ll << (2 * level_high);) {
        const int up = place ? __builtin_ctzll(place) / 2 : level_high;
        int here = wp::max(level_low, level_high - up);
        long long node = place >> (2 * (level_high - here));
        while (here < level_high && split[first_node(here) + node - base]) {
            ++here;
            node = place >> (2 * (level_high - here));
        }
        level[tiles] = here;
        index[tiles++] = node;
        place += 1ll << (2 * (level_high - here));
    }
    return tiles;
}

}  // namespace tiling
