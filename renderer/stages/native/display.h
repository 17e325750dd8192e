// Expansion of a cached framelet to pixels of a band of rows, sixteen at a time. Definitions are in
// `tsar/reconstruction.py`.
#pragma once
#include "lanes.h"

namespace display {

using namespace packets;

// Tables for the pixels of a level's tiles along an axis, including the margin: see `DisplayPlan`.
struct Axis {
    const int *left, *right;
    const float *share_left, *share_right, *weight;
    int margin, width, reach;

    template <class Plan> Axis(const Plan& plan, int level) {
        const int place = level - plan.level_low, begin = ((const int*)plan.first)[place];
        left = (const int*)plan.left + begin, right = (const int*)plan.right + begin;
        share_left = (const float*)plan.share_left + begin, share_right = (const float*)plan.share_right + begin;
        weight = (const float*)plan.weight + begin;
        margin = ((const int*)plan.margin)[place], width = plan.resolution >> level, reach = width + 2 * margin;
    }
};

// Stores one channel of sixteen samples on the Morton curve, a square of 4 x 4, by the rows of that square.
inline void put_square(f16 morton, float* to, int stride) {
    const f16 rows = __builtin_shufflevector(morton, morton, 0, 1, 4, 5, 2, 3, 6, 7, 8, 9, 12, 13, 10, 11, 14, 15);
    store<f4>(to, rows.lo.lo), store<f4>(to + stride, rows.lo.hi);
    store<f4>(to + 2 * stride, rows.hi.lo), store<f4>(to + 3 * stride, rows.hi.hi);
}

// Converts samples on the Morton curve with interleaved colours to rows of red, green and blue, for the squares of 4 x
// 4 that contain the requested rows.
inline void unpack_squares(const float* color, const int* order, int side, int first, int last, float* rows) {
    for (int y = first & ~3; y <= last; y += 4)
        for (int x = 0; x < side; x += 4) {
            const Vec16 square = separated(color + 3ll * order[y * side + x]);
            float* to = rows + 3ll * y * side + x;
            put_square(square.x, to, 3 * side), put_square(square.y, to + side, 3 * side);
            put_square(square.z, to + 2 * side, 3 * side);
        }
}

// The same sample by sample, for tiles of any size. A pixel of a finer tile is the mean of a square of samples, which
// are consecutive on the Morton curve.
inline void unpack_samples(const float* color, const int* order, int side, int samples, int first, int last,
                           float* rows) {
    const int stride = side / samples, each = stride * stride;
    for (int j = first; j <= last; ++j) {
        float* to = rows + 3ll * j * samples;
        for (int i = 0; i < samples; ++i) {
            const float* from = color + 3 * order[(j * side + i) * stride];
            float sum[3] = {};
            for (int k = 0; k < each; ++k)
                for (int channel = 0; channel < 3; ++channel) sum[channel] += from[3 * k + channel];
            for (int channel = 0; channel < 3; ++channel) to[channel * samples + i] = sum[channel] / each;
        }
    }
}

// Interpolates a row of samples to a row of pixels. Pixels beyond the outermost samples take those alone. The distance
// between samples is `spacing` pixels, a power of two, and pixels of one phase have the same weights of their two
// neighbours.
inline void interpolate(const float* from, int samples, int spacing, const Axis& axis, float* to) {
    const int edge = axis.margin + spacing / 2;
    const float *p = axis.share_left + edge, *q = axis.share_right + edge;
    for (int i = 0; i < edge; ++i) to[i] = from[0], to[axis.reach - 1 - i] = from[samples - 1];
    to += edge;
    if (spacing == 2) {
        for (int i = 0; i < samples - 1; ++i)
            to[2 * i] = p[0] * from[i] + q[0] * from[i + 1], to[2 * i + 1] = p[1] * from[i] + q[1] * from[i + 1];
        return;
    }
    for (int i = 0; i < samples - 1; ++i, to += spacing)
        for (int phase = 0; phase < spacing; phase += 4)
            store<f4>(to + phase, load<f4>(p + phase) * from[i] + load<f4>(q + phase) * from[i + 1]);
}

// Interpolates the rows of a framelet's samples that the band from `top` to before `bottom` needs to pixels; per row
// red, green, blue. `y` is the tile's first row of pixels; `samples` is working memory.
template <class Plan>
inline void expand_rows(const Plan& plan, int slot, int level, int y, int top, int bottom, const float* color,
                        float* samples, float* rows) {
    const Axis axis(plan, level);
    const int side = plan.side, begin = y - axis.margin,
              last_pixel = bottom - begin < axis.reach ? bottom - begin : axis.reach;
    const int first = axis.left[top > begin ? top - begin : 0], last = axis.right[last_pixel - 1];
    const int count = axis.width < side ? axis.width : side, spacing = axis.width / count;
    const int* order = (const int*)plan.order;
    float* unpacked = spacing == 1 ? rows : samples;  // a row of samples is a row of pixels if the spacing is one pixel
    color += 3ll * side * side * slot;
    if (count == side && side % 4 == 0)
        unpack_squares(color, order, side, first, last, unpacked);
    else
        unpack_samples(color, order, side, count, first, last, unpacked);
    if (spacing == 1) return;
    for (int line = 3 * first; line < 3 * last + 3; ++line)
        interpolate(samples + (long long)line * side, side, spacing, axis, rows + (long long)line * axis.reach);
}

// Adds a framelet to the band's sums, weighted by the cycles by which it is newer than the threshold, plus
// `SHIFT_CYCLES`.
//
// Processes sixteen pixels at a time. Those beyond the tile or the image get no weight, but they are read and written:
// all arrays need padding for them, with finite numbers in the rows.
template <class Plan>
inline void blend_rows(const Plan& plan, int level, int x, int y, float age, int top, int bottom, const float* rows,
                       float* planes) {
    const Axis axis(plan, level);
    const int n = plan.resolution, begin_x = x - axis.margin, begin_y = y - axis.margin;
    const int left = begin_x > 0 ? begin_x : 0, right = begin_x + axis.reach < n ? begin_x + axis.reach : n;
    const int count = right - left, skipped = left - begin_x;
    const int first = begin_y > top ? begin_y : top,
              end = begin_y + axis.reach < bottom ? begin_y + axis.reach : bottom;
    const long long plane = (long long)plan.band * n, next = axis.reach;
    i16 number;
    for (int lane = 0; lane < LANES; ++lane) number[lane] = lane;
    for (int row = first; row < end; ++row) {
        const int v = row - begin_y;
        const float p = axis.share_left[v], q = axis.share_right[v], down = axis.weight[v];
        const float* upper = rows + 3ll * next * axis.left[v] + skipped;
        const float* lower = rows + 3ll * next * axis.right[v] + skipped;
        float* at = planes + (long long)(row - top) * n + left;
        for (int i = 0; i < count; i += LANES, at += LANES, upper += LANES, lower += LANES) {
            const f16 newer = age - load<f16>(at);
            const i16 counts = (newer >= 0.0f) & (number < count - i);
            const f16 w = counts ? (newer + SHIFT_CYCLES) * (down * load<f16>(axis.weight + skipped + i)) : (f16)0.0f;
            float* to = at + plane;
            store(to, load<f16>(to) + w);
            for (int channel = 0; channel < 3; ++channel) {
                to += plane;
                f16 color = load<f16>(upper + channel * next);
                if (q != 0.0f) color = p * color + q * load<f16>(lower + channel * next);
                store(to, load<f16>(to) + w * color);
            }
        }
    }
}

}  // namespace display
