// Passes over the field for the selection; definition in `tsar/selection.py`.
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
