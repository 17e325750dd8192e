// What sampling a tile gains, and the best disjoint tiles of the quadtree at a price (tsar/filtering/tiles.py, whose
// bits these are). Levels lie one after the other, coarsest first; each has four times the tiles of the one before.
#pragma once
#include "lanes.h"

#pragma clang fp contract(off)

namespace gains {

using packets::f16;
using packets::load;
using packets::store;
using packets::vmax;
using packets::vmin;

struct Span {
    float cycle_s, reach_px, life_min_s, life_max_s;
};

// For `count` pixels.
inline void of_pixels(float spacing, const Span& span, int count, const float* variance, const float* roughness,
                      const float* rate, const float* speed, float* gain) {
    const float own = 0.5f * (spacing * spacing), share = 1.0f / (spacing * spacing);
    const float edge = (float)(0.5 + 0.35 * (spacing - 1.0)), half = 0.5f * spacing;
    for (int i = 0; i < count; i += 16) {
        const f16 g = load<f16>(roughness + i), q = load<f16>(rate + i);
        const f16 p = vmin(load<f16>(variance + i) + q * span.cycle_s, (f16)given::VARIANCE_MAX);
        f16 gained;
        if (spacing <= 1.0f) {
            gained = p * p / (p + own * g);
        } else {
            const f16 beside = (p + edge * g) * (p + half * g);
            gained = p * p * (share / (p + 0.5f * g) + (1.0f - share) * p / beside);
        }
        const f16 crossed = (1.0f / vmax(load<f16>(speed + i), (f16)1e-9f)) * span.reach_px;
        const f16 longest = vmin(vmax(crossed, (f16)span.life_min_s), (f16)span.life_max_s);
        store(gain + i, gained * vmin(vmax(gained / q, (f16)span.life_min_s), longest));
    }
}

// Sums of two by two.
inline void halve(const float* from, int side, float* to) {
    for (int row = 0; row < side / 2; ++row) {
        const float *a = from + 2 * row * side, *b = a + side;
        for (int column = 0; column < side / 2; ++column)
            to[row * (side / 2) + column] = ((a[2 * column] + a[2 * column + 1]) + b[2 * column]) + b[2 * column + 1];
    }
}

// A level of `tiles` along a side: sums of its pixels' gains. `plane` has room for one and a half images.
inline void of_level(float spacing, const Span& span, int side, int tiles, const float* variance,
                     const float* roughness, const float* rate, const float* speed, float* plane, double* gain) {
    of_pixels(spacing, span, side * side, variance, roughness, rate, speed, plane);
    float* spare = plane + side * side;
    for (; side > tiles; side /= 2) {
        halve(plane, side, spare);
        float* const other = plane;
        plane = spare;
        spare = other;
    }
    for (int i = 0; i < tiles * tiles; ++i) gain[i] = plane[i];
}

// Tiles that gain more than they cost and more than the tiles within them; returns how many no larger one covers.
// `value` and `count` have room for all levels.
inline int worth(const double* gain, int levels, int coarsest, double price, double* value, int* count,
                 unsigned char* taken) {
    int start = 0, side = coarsest;
    for (int level = 1; level < levels; ++level) start += side * side, side *= 2;
    for (int i = start; i < start + side * side; ++i) {
        taken[i] = gain[i] > price;
        value[i] = taken[i] ? gain[i] - price : 0.0;
        count[i] = taken[i];
    }
    for (int level = levels - 2; level >= 0; --level) {
        const int below = start, wide = side;
        side /= 2, start -= side * side;
        for (int row = 0; row < side; ++row)
            for (int column = 0; column < side; ++column) {
                const int i = start + row * side + column, a = below + 2 * row * wide + 2 * column, b = a + wide;
                const double within = ((value[a] + value[a + 1]) + value[b]) + value[b + 1], own = gain[i] - price;
                taken[i] = own > within && own > 0.0;
                value[i] = taken[i] ? own : within;
                count[i] = taken[i] ? 1 : count[a] + count[a + 1] + count[b] + count[b + 1];
            }
    }
    int total = 0;
    for (int i = 0; i < side * side; ++i) total += count[i];
    return total;
}

// The best tiles, `most` of them at most.
inline void best(const double* gain, int levels, int coarsest, int most, double* value, int* count,
                 unsigned char* taken) {
    int all = 0, side = coarsest;
    for (int level = 0; level < levels; ++level, side *= 2) all += side * side;
    double high = gain[0];
    for (int i = 1; i < all; ++i) high = gain[i] > high ? gain[i] : high;
    high += 1e-12;
    double low = high * given::PRICE_LEAST;
    for (int turn = 0; turn < given::BISECTIONS; ++turn) {
        const double price = __builtin_sqrt(low * high);
        (worth(gain, levels, coarsest, price, value, count, taken) > most ? low : high) = price;
    }
    worth(gain, levels, coarsest, high, value, count, taken);
    // a tile within one that is taken is not
    side = coarsest;
    int start = 0;
    for (int level = 1; level < levels; ++level, side *= 2) {
        const int next = start + side * side;
        for (int i = 0; i < 4 * side * side; ++i) {
            const int row = i / (2 * side), column = i % (2 * side), parent = start + row / 2 * side + column / 2;
            if (taken[parent]) taken[next + i] |= 2;
        }
        start = next;
    }
    for (int i = 0; i < all; ++i) taken[i] = taken[i] == 1;
}

}  // namespace gains
