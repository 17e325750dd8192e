// Gains of tiles, and the best disjoint tiles of the quadtree at a price, with the same bits as
// tsar/filtering/tiles.py. Levels are stored one after the other, coarsest first; each has four times the tiles of the
// one before.
#pragma once
#include "lanes.h"

#pragma clang fp contract(off)

namespace gains {

using packets::f16;
using packets::f8;
using packets::i16;
using packets::load;
using packets::store;
using packets::vabs;
using packets::vmax;
using packets::vmin;

typedef long long l16 __attribute__((ext_vector_type(16)));

static_assert(given::ELEMENT_PX == 4);
constexpr int LEVELS_MAX = 8, TILE_MAX_PX = 64;

// Inputs by pixels; the rate is by elements. `step` is null if nothing moves.
struct Planes {
    const float *variance, *roughness, *rate, *step;
    const long long* instance;
};

struct Span {
    float cycle_s, reach_px, life_min_s, life_max_s;
};

// Sixteen adjacent pixels.
struct Sixteen {
    f16 p, roughness, rate, longest_s;
};

inline Sixteen read(const Planes& planes, const Span& span, int side, int row, int column) {
    const int at = row * side + column, element = row / 4 * (side / 4) + column / 4;
    const float* q = planes.rate + element;
    const f16 rate = {q[0], q[0], q[0], q[0], q[1], q[1], q[1], q[1], q[2], q[2], q[2], q[2], q[3], q[3], q[3], q[3]};
    f16 speed = 0.0f;
    if (planes.step) {
        const f16 across = load<f16>(planes.step + at), down = load<f16>(planes.step + side * side + at);
        const i16 instance = __builtin_convertvector(load<l16>(planes.instance + at), i16);
        const f16 seen = vmax(vabs(across), vabs(down)) / span.cycle_s;
        speed = instance == given::UNSEEN ? (f16)__builtin_inff() : seen;
    }
    const f16 crossed_s = (1.0f / vmax(speed, (f16)given::SPEED_LEAST)) * span.reach_px;
    const f16 p = vmin(load<f16>(planes.variance + at) + rate * span.cycle_s, (f16)given::VARIANCE_MAX);
    const f16 longest_s = vmin(vmax(crossed_s, (f16)span.life_min_s), (f16)span.life_max_s);
    return {p, load<f16>(planes.roughness + at), rate, longest_s};
}

inline f16 of_pixels(const Sixteen& s, float spacing, float life_min_s) {
    const f16 p = s.p, g = s.roughness;
    f16 gained;
    if (spacing <= 1.0f) {
        gained = p * p / (p + 0.5f * (spacing * spacing) * g);
    } else {
        const float share = 1.0f / (spacing * spacing), edge = (float)(0.5 + given::EDGE_GROWTH * (spacing - 1.0));
        const f16 beside = (p + edge * g) * (p + 0.5f * spacing * g);
        gained = p * p * (share / (p + 0.5f * g) + (1.0f - share) * p / beside);
    }
    return gained * vmin(vmax(gained / s.rate, (f16)life_min_s), s.longest_s);
}

// Sums over 2 x 2 values.
inline f8 halved(f16 above, f16 below) {
    const auto even = [](f16 a) { return __builtin_shufflevector(a, a, 0, 2, 4, 6, 8, 10, 12, 14); };
    const auto odd = [](f16 a) { return __builtin_shufflevector(a, a, 1, 3, 5, 7, 9, 11, 13, 15); };
    return ((even(above) + odd(above)) + even(below)) + odd(below);
}
inline void halve(const float* from, int side, float* to) {
    for (int row = 0; row < side / 2; ++row) {
        const float *a = from + 2 * row * side, *b = a + side;
        for (int column = 0; column < side / 2; ++column)
            to[row * (side / 2) + column] = ((a[2 * column] + a[2 * column + 1]) + b[2 * column]) + b[2 * column + 1];
    }
}

// Gains of all tiles within some rows of the coarsest. `coarsest` is the number of these along a side, `spacing` their
// spacing.
inline void of_tiles(const Planes& planes, const Span& span, int side, int coarsest, int levels, float spacing,
                     int first, int last, double* gain) {
    const int wide = side / coarsest, half = wide / 2;
    float sums[LEVELS_MAX][TILE_MAX_PX * TILE_MAX_PX / 4], spare[TILE_MAX_PX * TILE_MAX_PX / 16];
    for (int tile = first * coarsest; tile < last * coarsest; ++tile) {
        const int top = tile / coarsest, left = tile % coarsest;
        for (int row = 0; row < half; ++row)
            for (int column = 0; column < wide; column += 16) {
                const int y = top * wide + 2 * row, x = left * wide + column;
                const Sixteen above = read(planes, span, side, y, x), below = read(planes, span, side, y + 1, x);
                float apart = spacing;
                for (int level = 0; level < levels; ++level, apart /= 2)
                    store(sums[level] + row * half + column / 2,
                          halved(of_pixels(above, apart, span.life_min_s), of_pixels(below, apart, span.life_min_s)));
            }
        double* to = gain;
        for (int level = 0, tiles = 1; level < levels; ++level, tiles *= 2) {
            float *from = sums[level], *other = spare;
            for (int now = half; now > tiles; now /= 2) {
                halve(from, now, other);
                float* const done = other;
                other = from, from = done;
            }
            const int across = coarsest * tiles;
            for (int row = 0; row < tiles; ++row)
                for (int column = 0; column < tiles; ++column)
                    to[(top * tiles + row) * across + left * tiles + column] = from[row * tiles + column];
            to += across * across;
        }
    }
}

// The tiles of all levels and their price.
struct Market {
    const double* gain;
    const double* most;  // greatest gain among a tile and those within it
    int levels;
    int start[LEVELS_MAX], side[LEVELS_MAX];
    double price;
};
struct Worth {
    double value;
    int count;
};

// Profit and number of the best tiles: the tile itself or tiles within it.
inline Worth worth(const Market& m, int level, int row, int column) {
    const int i = m.start[level] + row * m.side[level] + column;
    if (!(m.most[i] > m.price)) return {0.0, 0};
    const double own = m.gain[i] - m.price;
    if (level + 1 == m.levels) return {own, 1};
    const Worth a = worth(m, level + 1, 2 * row, 2 * column), b = worth(m, level + 1, 2 * row, 2 * column + 1),
                c = worth(m, level + 1, 2 * row + 1, 2 * column), d = worth(m, level + 1, 2 * row + 1, 2 * column + 1);
    const double within = ((a.value + b.value) + c.value) + d.value;
    if (own > within && own > 0.0) return {own, 1};
    return {within, a.count + b.count + c.count + d.count};
}

inline bool more_than(const Market& m, int limit) {
    int total = 0;
    for (int row = 0; row < m.side[0]; ++row)
        for (int column = 0; column < m.side[0]; ++column) {
            total += worth(m, 0, row, column).count;
            if (total > limit) return true;
        }
    return false;
}

// Marks the best tiles: the tile itself or tiles within it.
inline void mark(const Market& m, int level, int row, int column, unsigned char* taken) {
    const int i = m.start[level] + row * m.side[level] + column;
    if (!(m.most[i] > m.price)) return;
    // the best of a finest tile is itself
    if (level + 1 == m.levels) {
        taken[i] = 1;
        return;
    }
    double within = 0.0;
    for (int k = 0; k < 4; ++k) within = within + worth(m, level + 1, 2 * row + k / 2, 2 * column + k % 2).value;
    const double own = m.gain[i] - m.price;
    if (own > within && own > 0.0) {
        taken[i] = 1;
        return;
    }
    for (int k = 0; k < 4; ++k) mark(m, level + 1, 2 * row + k / 2, 2 * column + k % 2, taken);
}

// Finds the best tiles, at most `limit`; `found` receives their number. `most` has room for all levels.
inline void best(const double* gain, int levels, int coarsest, int limit, double* most, unsigned char* taken,
                 int* found) {
    Market m{gain, most, levels};
    int all = 0;
    for (int level = 0; level < levels; ++level) {
        m.start[level] = all, m.side[level] = coarsest << level;
        all += m.side[level] * m.side[level];
    }
    for (int i = 0; i < all; ++i) most[i] = gain[i], taken[i] = 0;
    const auto larger = [](double a, double b) { return a > b ? a : b; };
    for (int level = levels - 2; level >= 0; --level) {
        const int side = m.side[level];
        for (int row = 0; row < side; ++row)
            for (int column = 0; column < side; ++column) {
                const double* within = most + m.start[level + 1] + 4 * row * side + 2 * column;
                double& own = most[m.start[level] + row * side + column];
                own = larger(larger(own, larger(within[0], within[1])), larger(within[2 * side], within[2 * side + 1]));
            }
    }
    double high = most[0];
    for (int i = 1; i < coarsest * coarsest; ++i) high = larger(high, most[i]);
    high += given::PRICE_ABOVE;
    double low = high * given::PRICE_LEAST;
    for (int turn = 0; turn < given::BISECTIONS; ++turn) {
        m.price = __builtin_sqrt(low * high);
        (more_than(m, limit) ? low : high) = m.price;
    }
    m.price = high;
    for (int row = 0; row < coarsest; ++row)
        for (int column = 0; column < coarsest; ++column) mark(m, 0, row, column, taken);
    *found = 0;
    for (int i = 0; i < all; ++i) *found += taken[i];
}

}  // namespace gains
