// Passes over the field and over the tiles for the selection, as defined in `tsar/selection.py`.
#pragma once
#include "framelets.h"
#include "ranking.h"

namespace selection {

typedef double d2 __attribute__((ext_vector_type(2)));
typedef double d4 __attribute__((ext_vector_type(4)));
typedef packets::d8 d8;

// Sums of the first four and the last four lanes, of neighbours first, as at all levels of the quadtree.
inline d2 sums_of_four(d8 v) {
    const d4 pairs = v.even + v.odd;
    return pairs.even + pairs.odd;
}

// Sums over successive nodes of equal size, four at a time: the sum of a node is completed by its last child.
struct Pyramid {
    double waiting[16][4];
    int arrived = 0;

    // Returns the sum of the largest node that is now complete.
    double add(double sum) {
        double* children = waiting[0];
        int place = arrived++;
        for (; (place & 3) == 3; place >>= 2, children += 4) sum = (children[0] + children[1]) + (children[2] + sum);
        children[place & 3] = sum;
        return sum;
    }
};

// Updates the credit of one tile's elements, whose number is a power of four. Returns the mean.
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

// Updates the credit of every element, and computes its mean over every tile.
inline void gather_credit(int tiles, int field_level, const long long* level, const long long* index,
                          const double* temporal, const double* history, double* overdue, double* credit) {
    for (int tile = 0; tile < tiles; ++tile) {
        const int shift = 2 * (field_level - (int)level[tile]);
        const long long first = index[tile] << shift;
        overdue[tile] = gather_tile(1 << shift, history + first, temporal + first, credit + first);
    }
}

// Selects the tiles above the threshold and the first `ties` of those at it, and subtracts a refresh from their credit.
template <class Due>
inline void refresh_due(int tiles, int field_level, const long long* level, const long long* index,
                        const double* overdue, const ranking::Key* key, ranking::Key threshold, int ties,
                        const Due& due) {
    long long* chosen = (long long*)due.selected;
    double* credit = (double*)due.history;
    for (int tile = 0, out = 0; tile < tiles; ++tile) {
        if (!ranking::is_taken(key[tile], threshold, ties)) continue;
        chosen[out++] = tile;
        const double left = wp::min(wp::max(overdue[tile] - 1.0, -1.0), 1.0);
        const int shift = 2 * (field_level - (int)level[tile]);
        for (long long i = index[tile] << shift; i < (index[tile] + 1) << shift; ++i) credit[i] = left;
    }
}

// Stores the tiles of a batch and the positions of its samples.
template <class Plan, class Due>
inline void place_framelets(const Plan& plan, const long long* level, const long long* index, const Due& due) {
    const long long* chosen = (const long long*)due.selected;
    long long *due_level = (long long*)due.level, *due_index = (long long*)due.index;
    for (int row = 0; row < plan.batch; ++row) {
        due_level[row] = level[chosen[row]];
        due_index[row] = index[chosen[row]];
        framelets::place(due_level[row], due_index[row], plan.samples, (const float*)plan.centre,
                         (float*)due.position + 2ll * plan.samples * row);
    }
}

}  // namespace selection
