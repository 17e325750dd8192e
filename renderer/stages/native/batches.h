// The update of estimates and surfels by a batch of samples, with the same bits as tsar/filtering/batches.py and
// samples.py. Only pixels with samples are visited. Threads first share tiles, and then rows of the image in three
// passes; each must be complete before the next.
#pragma once
#include "changes.h"
#include "quadtree.h"
#include "taking.h"

#pragma clang fp contract(off)

namespace batches {

using packets::d8;
using packets::f16;
using packets::f8;
using packets::i8;
using packets::l8;
using packets::load;
using packets::store;
using surfels::Planes;

constexpr int TILE = given::TILE_SIDE, SAMPLES = TILE * TILE;

struct Traced {
    const float *color, *position;
    const double* time_s;
    const float* spacing;
    const int* instance;
    const float* point;
    long long tiles;
};

// Data of each sample: its pixel (-1 outside the image), its semivariance, and the position and displacement of its
// surface on the image.
struct Samples {
    int* at;
    float *semivariance, *x, *y, *step_x, *step_y;
};

// Inputs and outputs of the update by a batch.
struct Batch {
    Traced traced;
    Planes planes;
    Change change;
    Samples samples;
    surfels::Poses now, earlier;  // the rows of the second are null if there are none
    Moment moment;
};

// Semivariance: half the mean squared difference of each sample from its neighbours in the tile.
inline void semivariances(const float* color, float* found) {
    static_assert(TILE == 8);
    float value[3][SAMPLES], raster[SAMPLES];
    for (int i = 0; i < SAMPLES; ++i)
        for (int k = 0; k < 3; ++k)
            value[k][quadtree::row_of(i) * TILE + quadtree::column_of(i)] = clipped(color[3 * i + k]);
    f8 v[3][TILE];
    for (int k = 0; k < 3; ++k)
        for (int row = 0; row < TILE; ++row) v[k][row] = packets::vsqrt(load<f8>(value[k] + TILE * row));
    const auto half = [](f8 red, f8 green, f8 blue) {
        return 0.5f * ((red * red + green * green + blue * blue) / 3.0f);
    };
    const f8 none = 0.0f, beside = {1, 2, 2, 2, 2, 2, 2, 1};
    // lane i: difference from the next sample, and from the previous one
    const auto after = [](f8 a) { return __builtin_shufflevector(a, a, 1, 2, 3, 4, 5, 6, 7, 7) - a; };
    f8 above = none;
    for (int row = 0; row < TILE; ++row) {
        const f8 right = half(after(v[0][row]), after(v[1][row]), after(v[2][row]));
        const f8 left = __builtin_shufflevector(right, none, 8, 0, 1, 2, 3, 4, 5, 6);
        f8 below = none;
        if (row + 1 < TILE)
            below = half(v[0][row + 1] - v[0][row], v[1][row + 1] - v[1][row], v[2][row + 1] - v[2][row]);
        const float rows = row == 0 || row + 1 == TILE ? 1.0f : 2.0f;
        store(raster + TILE * row, (((left + right) + above) + below) / (beside + rows));
        above = below;
    }
    for (int i = 0; i < SAMPLES; ++i) found[i] = raster[quadtree::row_of(i) * TILE + quadtree::column_of(i)];
}

// Finds the pixels of the samples of some tiles.
template <class Plan> inline void locate(const Plan& plan, const Batch& b, int first, int last) {
    const Samples& s = b.samples;
    for (int tile = first; tile < last; ++tile)
        semivariances(b.traced.color + 3 * SAMPLES * tile, s.semivariance + SAMPLES * tile);
    for (int start = SAMPLES * first; start < SAMPLES * last; start += 8) {
        d8 x, y;
        l8 seen = l8() == 0;
        if (b.moment.reprojected) {
            const l8 instance = __builtin_convertvector(load<i8>(b.traced.instance + start), l8);
            const float* p = b.traced.point + 3ll * start;
            const auto component = [p](int k) {
                return d8{p[k], p[3 + k], p[6 + k], p[9 + k], p[12 + k], p[15 + k], p[18 + k], p[21 + k]};
            };
            const d8 px = component(0), py = component(1), pz = component(2);
            const surfels::Eight e = surfels::project8(plan, b.now, instance, px, py, pz);
            x = e.x, y = e.y, seen = e.seen;
            const f8 at_x = __builtin_convertvector(x, f8), at_y = __builtin_convertvector(y, f8);
            f8 step_x = 0.0f, step_y = 0.0f;
            if (b.earlier.rows) {
                const surfels::Eight was = surfels::project8(plan, b.earlier, instance, px, py, pz);
                step_x = at_x - __builtin_convertvector(was.inside ? was.x : (d8)0.0, f8);
                step_y = at_y - __builtin_convertvector(was.inside ? was.y : (d8)0.0, f8);
            }
            store(s.x + start, at_x), store(s.y + start, at_y);
            store(s.step_x + start, step_x), store(s.step_y + start, step_y);
        } else {
            const float* p = b.traced.position + 2 * start;
            x = d8{p[0], p[2], p[4], p[6], p[8], p[10], p[12], p[14]};
            y = d8{p[1], p[3], p[5], p[7], p[9], p[11], p[13], p[15]};
        }
        seen &= (x >= 0.0) & (y >= 0.0) & (x < (double)plan.width) & (y < (double)plan.height);
        const i8 column = __builtin_convertvector(seen ? x : (d8)0.0, i8),
                 row = __builtin_convertvector(seen ? y : (d8)0.0, i8);
        store(s.at + start, __builtin_convertvector(seen, i8) ? row * plan.side + column : (i8)-1);
    }
}

// Sums the samples by the pixels of some rows, and returns the number of pixels. `slot` is the index of each pixel's
// sums, -1 for none; it is -1 everywhere before and after the update.
template <class Plan> inline long long gather(const Plan& plan, const Batch& b, int first, int last) {
    const int start = first * plan.side, end = last * plan.side;
    int* const slot = (int*)plan.slot;
    Pixel* const pixel = (Pixel*)plan.pixel;
    int next = start;
    for (int tile = 0; tile < b.traced.tiles; ++tile) {
        const float wide = larger(b.traced.spacing[tile], 1.0f), ratio = b.traced.spacing[tile] / wide;
        const float root = __builtin_sqrtf(wide);
        for (int i = SAMPLES * tile; i < SAMPLES * (tile + 1); ++i) {
            const int at = b.samples.at[i];
            if (at < start || at >= end) continue;
            if (slot[at] < 0) {
                slot[at] = next;
                pixel[next++] = Pixel{0.0, at, 0, 0.0f, {0.0f, 0.0f, 0.0f}, 0.0f, 0.0f, 0.0f};
            }
            Pixel& p = pixel[slot[at]];
            const float v = b.samples.semivariance[i] / ratio;
            p.count += 1.0f, p.newest = i, p.time_s += b.traced.time_s[i] - b.moment.now_s;
            for (int k = 0; k < 3; ++k) p.color[k] += b.traced.color[3 * i + k];
            p.least += v / root, p.most += v;
        }
    }
    for (int i = start; i < next; ++i) {
        Pixel& p = pixel[i];
        for (int k = 0; k < 3; ++k) p.color[k] = p.color[k] / p.count;
        p.time_s = p.time_s / (double)p.count + b.moment.now_s;
        p.roughness = b.planes.roughness[p.at];
    }
    return next - start;
}

// Rows of the image that one thread updates, in whole elements; `pixels` counts the pixels with samples.
struct Part {
    long long first, last, pixels;
    float* sums;  // room for nine rows
};

// Counts, and lower and upper bounds of the roughness, of a row of pixels with one more pixel at both ends.
struct Row {
    float* sums[3];
};

// Counts and bounds of the samples in a row, 0 without samples; returns whether there are any. The border is repeated.
template <class Plan> inline bool spread_row(const Plan& plan, int row, const Row& to) {
    const int side = plan.side, *slot = (const int*)plan.slot + row * side;
    const Pixel* const pixel = (const Pixel*)plan.pixel;
    bool any = false;
    for (float* sums : to.sums)
        for (int i = 0; i < side + 2; ++i) sums[i] = 0.0f;
    for (int i = 0; i < side; i += 8)
        for (unsigned left = packets::bits(load<i8>(slot + i) >= 0); left; left &= left - 1) {
            const int column = i + packets::first_bit(left);
            const Pixel& p = pixel[slot[column]];
            to.sums[0][1 + column] = p.count, to.sums[1][1 + column] = p.least, to.sums[2][1 + column] = p.most;
            any = true;
        }
    for (float* sums : to.sums) sums[0] = sums[1], sums[side + 1] = sums[side];
    return any;
}

// Roughness of some rows around the pixels with samples, from sums over 3 x 3 pixels.
template <class Plan> inline void roughen(const Plan& plan, const Part& own, float* roughness) {
    const int side = plan.side, wide = side + 16;
    Row rows[3];
    bool any[3];
    for (int k = 0; k < 9; ++k) rows[k / 3].sums[k % 3] = own.sums + k * wide;
    const auto spread = [&](int row) {
        const int k = (row + 3) % 3;
        any[k] = spread_row(plan, row < 0 ? 0 : row < side ? row : side - 1, rows[k]);
    };
    spread((int)own.first - 1), spread((int)own.first);
    for (int row = (int)own.first; row < own.last; ++row) {
        spread(row + 1);
        if (!any[0] && !any[1] && !any[2]) continue;
        for (int i = 0; i < side; i += 8) {
            f8 count = 0.0f, least = 0.0f, most = 0.0f;
            for (int k = 0; k < 9; ++k) {
                const Row& from = rows[(row + 2 + k / 3) % 3];
                count = count + load<f8>(from.sums[0] + i + k % 3);
                least = least + load<f8>(from.sums[1] + i + k % 3), most = most + load<f8>(from.sums[2] + i + k % 3);
            }
            if (!packets::bits(count > 0.0f)) continue;
            const f8 near = packets::vmax(count / 9.0f, (f8)given::COUNT_LEAST),
                     was = load<f8>(roughness + row * side + i);
            const f8 bounded = packets::vmin(packets::vmax(was, (least / 9.0f) / near), (most / 9.0f) / near);
            const f8 mixed = packets::vmax(0.5f * (was + bounded), (f8)given::ROUGHNESS_MIN);
            store(roughness + row * side + i, count > 0.0f ? mixed : was);
        }
    }
}

inline float most_of(float x, float y) { return larger(__builtin_fabsf(x), __builtin_fabsf(y)); }

// Updates the estimate and the surfel of a pixel by its samples.
template <class Plan> inline void update(const Plan& plan, const Batch& b, const Pixel& p, float rate) {
    const Planes& planes = b.planes;
    const Samples& s = b.samples;
    const int at = p.at, count = plan.side * plan.side;
    bool replaced = false, same = true;
    float least_share = 0.0f, aged = planes.aged[at];
    if (b.moment.reprojected) {
        const float was_x = planes.step[at], was_y = planes.step[count + at];
        same = planes.instance[at] == b.traced.instance[p.newest];
        replaced = !same && most_of(s.step_x[p.newest] - was_x, s.step_y[p.newest] - was_y) > given::MOVES_PX;
        least_share = most_of(was_x, was_y) > given::MOVES_PX ? given::SHARE_MOVING : 0.0f;
        const float away = most_of(planes.position[at] - (at % plan.side + 0.5f),
                                   planes.position[count + at] - (at / plan.side + 0.5f));
        aged = aged + p.roughness * larger(away - 0.5f, 0.0f);
    }
    const float elapsed_s = (float)(p.time_s - b.moment.now_s), g = planes.roughness[at], inverse = planes.inverse[at];
    aged = aged + rate * elapsed_s;
    const float variance = smaller(aged + 0.5f * g * inverse, given::VARIANCE_MAX);
    float share = larger(variance / (variance + 0.5f * g / p.count), least_share);
    if (!b.moment.accumulates || replaced || !(planes.time_s[at] > -surfels::INF)) share = 1.0f;
    const float kept = (1.0f - share) * (1.0f - share);
    for (int k = 0; k < 3; ++k) {
        float& color = planes.color[k * count + at];
        color = color + share * (p.color[k] - color);
    }
    planes.aged[at] = smaller(kept * aged, given::VARIANCE_MAX);
    planes.inverse[at] = kept * inverse + share * share / p.count;
    planes.time_s[at] = p.time_s;
    if (!b.moment.reprojected) return;
    const float weight = same ? share : 1.0f;
    for (int k = 0; k < 3; ++k) {
        float& point = planes.point[k * count + at];
        point = point + weight * (b.traced.point[3ll * p.newest + k] - point);
    }
    float &x = planes.position[at], &y = planes.position[count + at];
    x = x + weight * (s.x[p.newest] - x), y = y + weight * (s.y[p.newest] - y);
    if (same) return;
    planes.step[at] = s.step_x[p.newest], planes.step[count + at] = s.step_y[p.newest];
    planes.instance[at] = b.traced.instance[p.newest];
}

// Updates roughness and change in the rows of a part.
template <class Plan> inline void learn(const Plan& plan, const Batch& b, const Part& own) {
    roughen(plan, own, b.planes.roughness);
    const Pixel* const pixel = (const Pixel*)plan.pixel + own.first * plan.side;
    observe_rows(plan.side, b.moment, (const int*)plan.slot, (const Pixel*)plan.pixel, pixel, own.pixels, b.planes,
                 b.change, own.first, own.last);
}

// Updates the pixels of a part by their samples, and resets `slot`.
template <class Plan> inline void take_in(const Plan& plan, const Batch& b, const Part& own) {
    const int side = plan.side;
    const Pixel* const pixel = (const Pixel*)plan.pixel + own.first * side;
    rate_rows(side, b.moment, b.change, own.first, own.last);
    for (int i = 0; i < own.pixels; ++i) {
        const int at = pixel[i].at;
        update(plan, b, pixel[i], b.change.rate[at / side / EDGE * (side / EDGE) + at % side / EDGE]);
        ((int*)plan.slot)[at] = -1;
    }
}

}  // namespace batches
