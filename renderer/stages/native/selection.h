// Passes over the field for the selection and the tiling; definitions in `tsar/selection.py` and `tsar/tiling.py`.
#pragma once
#include "lanes.h"

namespace selection {

typedef double d2 __attribute__((ext_vector_type(2)));
typedef double d4 __attribute__((ext_vector_type(4)));
typedef double d8 __attribute__((ext_vector_type(8)));

// Sums of the four first and the four last: neighbours first, as everywhere up the quadtree.
inline d2 sums_of_four(d8 v) {
    const d4 pairs = v.even + v.odd;
    return pairs.even + pairs.odd;
}

// Sums of the four children of each of `count` nodes; children lie one after the other.
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

// Whether all values of a field are densities, neither negative nor infinite nor no number. A field has a multiple of
// eight elements.
inline bool all_densities(const double* value, int count) {
    decltype(d8() < d8()) bad = 0;
    for (int i = 0; i < count; i += 8) {
        d8 v;
        __builtin_memcpy(&v, value + i, sizeof(v));
        bad |= ~((v >= 0.0) & (v <= 1.7976931348623157e308));
    }
    long long any = 0;
    for (int lane = 0; lane < 8; ++lane) any |= bad[lane];
    return !any;
}

// Adds up sums of equal nodes that come one after the other, by fours: the sum of a node is made when its last child
// arrives.
struct Pyramid {
    double waiting[16][4];
    int arrived = 0;

    // Returns the sum of the largest node that is now complete.
    double add(double sum) {
        double* children = waiting[0];
        int place = arrived++;
        for (; (place & 3) == 3; place >>= 2, children += 4)
            sum = (children[0] + children[1]) + (children[2] + sum);
        children[place & 3] = sum;
        return sum;
    }
};

// Credit of the elements of one tile, which has a power of four of them. Returns their mean.
inline double gather_tile(int count, const double* past, const double* rate, double* now) {
    if (count < 16) {
        for (int i = 0; i < count; ++i) now[i] = past[i] + rate[i];
        return count == 1 ? now[0] : ((now[0] + now[1]) + (now[2] + now[3])) * 0.25;
    }
    Pyramid pyramid;
    double sum = 0.0;
    for (int i = 0; i < count; i += 16) {
        d8 v[2];
        for (int half = 0; half < 2; ++half) {
            d8 a, b;
            __builtin_memcpy(&a, past + i + 8 * half, sizeof(d8));
            __builtin_memcpy(&b, rate + i + 8 * half, sizeof(d8));
            v[half] = a + b;
            __builtin_memcpy(now + i + 8 * half, &v[half], sizeof(d8));
        }
        const d2 first = sums_of_four(v[0]), second = sums_of_four(v[1]);
        sum = pyramid.add((first.x + first.y) + (second.x + second.y));
    }
    return sum / count;
}

}  // namespace selection
