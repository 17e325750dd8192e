// The picture of the estimates, over a pyramid of means, with the same bits as tsar/filtering/display.py.
//
// A level has five planes: red, green, blue, variance, roughness; colours are square roots. On the way down, the picture
// and its remaining variance replace colours and variance. For the finest level only the variance is stored; the rest is
// read and written in place, and its colours are no roots. Threads share its rows.
#pragma once
#include "lanes.h"

#pragma clang fp contract(off)

namespace pyramid {

struct Fine {
    const float *color, *roughness;
    float* variance;
};

// Results: colours pixel by pixel, and the remaining variance.
struct Shown {
    float *color, *remaining;
};

// Inputs of the variance; `position` is null without reprojection.
struct Estimated {
    const float *aged, *inverse, *roughness, *rate, *position;
};

// Inputs and outputs of a picture; `levels` begin with the second finest. The picture is the upper left part of planes
// of `side` pixels; the other pixels are not touched.
struct Picture {
    Fine fine;
    Estimated estimated;
    float* levels;
    Shown shown;
    long long width, height;
};

inline float larger(float a, float b) { return a > b ? a : b; }
inline float smaller(float a, float b) { return a < b ? a : b; }

// Variance of the pixels of a row after `seconds`, including that of surfels beside their pixels.
inline void vary(const Estimated& of, float seconds, int side, int width, int row, float* variance) {
    const int start = row * side, count = side * side;
    const float *aged = of.aged + start, *inverse = of.inverse + start, *roughness = of.roughness + start;
    const float* rate = of.rate + row / given::ELEMENT_PX * (side / given::ELEMENT_PX);
    for (int i = 0; i < width; ++i) {
        float later = smaller(aged[i] + rate[i / given::ELEMENT_PX] * seconds, given::VARIANCE_MAX);
        if (of.position) {
            const float x = of.position[start + i] - (i + 0.5f), y = of.position[count + start + i] - (row + 0.5f);
            const float away = larger(__builtin_fabsf(x), __builtin_fabsf(y));
            later = later + roughness[i] * larger(away - 0.5f, 0.0f);
        }
        const float known = later + 0.5f * roughness[i] * inverse[i];
        variance[i] = known < given::VARIANCE_MAX ? known : given::NOTHING_KNOWN;
    }
}

// A colour of the level as it is averaged.
template <bool finest> inline float averaged(float color) { return finest ? __builtin_sqrtf(color) : color; }

inline float mean4(const float* a, const float* b, int column) {
    return (((a[2 * column] + a[2 * column + 1]) + b[2 * column]) + b[2 * column + 1]) / 4.0f;
}

// A row of the coarser level, from `rows` (one or two) finer rows of the picture. `between` is half the distance
// between pixels of the finer level, the factor from roughness to variance; `spare` has room for four rows. Beyond the
// picture the weight is 0 and the roughness is that of the border.
template <bool finest>
inline void up(const Fine& fine, int side, int width, int rows, float between, int row, float* spare, float* coarse) {
    const int half = side / 2, quarter = half * half, count = side * side, start = 2 * row * side;
    const int columns = (width + 1) / 2;
    const float *variance = fine.variance + start, *roughness = fine.roughness + start;
    float* __restrict weight = spare, * __restrict weighted = spare + 2 * side;
    float* __restrict to = coarse + row * half;
    for (int i = 0; i < 4 * side && (rows < 2 || width % 2); ++i) spare[i] = 0.0f;
    for (int k = 0; k < rows * side; k += side)
        for (int i = k; i < k + width; ++i) weight[i] = 1.0f / (variance[i] + between * roughness[i]);
    const float* below = rows < 2 ? roughness : roughness + side;
    for (int i = 0; i < columns; ++i) to[3 * quarter + i] = 4.0f * mean4(weight, weight + side, i);
    for (int i = 0; i < width / 2; ++i) to[4 * quarter + i] = mean4(roughness, below, i);
    if (width % 2) {
        const float a = roughness[width - 1], b = below[width - 1];
        to[4 * quarter + width / 2] = (((a + a) + b) + b) / 4.0f;
    }
    for (int plane = 0; plane < 3; ++plane) {
        const float* color = fine.color + plane * count + start;
        for (int k = 0; k < rows * side; k += side)
            for (int i = k; i < k + width; ++i) weighted[i] = averaged<finest>(color[i]) * weight[i];
        for (int i = 0; i < columns; ++i)
            to[plane * quarter + i] = 4.0f * mean4(weighted, weighted + side, i) / to[3 * quarter + i];
    }
    for (int i = 0; i < columns; ++i) to[3 * quarter + i] = 1.0f / to[3 * quarter + i];
}

// A row of twice the length by linear interpolation, with the ends repeated.
inline void enlarge(const float* __restrict from, int half, float* __restrict to) {
    to[0] = 0.75f * from[0] + 0.25f * from[0];
    for (int i = 1; i < half; ++i) {
        to[2 * i] = 0.75f * from[i] + 0.25f * from[i - 1];
        to[2 * i - 1] = 0.75f * from[i - 1] + 0.25f * from[i];
    }
    to[2 * half - 1] = 0.75f * from[half - 1] + 0.25f * from[half - 1];
}

// Two rows of the finer level, at which the picture has `width` and `height`, from one row of the coarser level and its
// neighbours. `spare` has room for sixteen rows. The result of the finest level is shown; others replace their level.
template <bool finest>
inline void down(const float* coarse, int side, int width, int height, float between, int row, float* spare,
                 const Fine& fine, const Shown& shown) {
    const int half = side / 2, count = side * side, quarter = half * half, rows = (height + 1) / 2;
    const int near[3] = {row > 0 ? row - 1 : 0, row, row + 1 < rows ? row + 1 : row};
    for (int plane = 0; plane < 4; ++plane)
        for (int k = 0; k < 3; ++k)
            enlarge(coarse + plane * quarter + near[k] * half, (width + 1) / 2, spare + (3 * plane + k) * side);
    for (int second = 0; second < 2 && 2 * row + second < height; ++second) {
        const int start = (2 * row + second) * side;
        const float *variance = fine.variance + start, *roughness = fine.roughness + start;
        float* __restrict share = spare + 12 * side, * __restrict found = share + side;
        for (int i = 0; i < width; ++i) share[i] = variance[i] / (variance[i] + between * roughness[i]);
        for (int plane = 0; plane < 3; ++plane) {
            const float *mid = spare + (3 * plane + 1) * side, *beside = second ? mid + side : mid - side;
            const float* own = fine.color + plane * count + start;
            float* const to = finest ? found + plane * side : (float*)own;
            for (int i = 0; i < width; ++i) {
                const float mine = averaged<finest>(own[i]);
                const float mixed = mine + share[i] * ((0.75f * mid[i] + 0.25f * beside[i]) - mine);
                to[i] = finest ? mixed * mixed : mixed;
            }
        }
        const float *mid = spare + 10 * side, *beside = second ? mid + side : mid - side;
        float* const remaining = finest ? shown.remaining + start : fine.variance + start;
        for (int i = 0; i < width; ++i) {
            const float wide = 0.75f * mid[i] + 0.25f * beside[i];
            remaining[i] = variance[i] + share[i] * share[i] * ((wide - variance[i]) - between * roughness[i]);
        }
        for (int i = 0; finest && i < width; i += 16)
            packets::store_joined(shown.color + 3 * (start + i), {packets::load<packets::f16>(found + i),
                                                                  packets::load<packets::f16>(found + side + i),
                                                                  packets::load<packets::f16>(found + 2 * side + i)});
    }
}

inline void shrink(const Picture& picture, int side, float seconds, int first, int last, float* spare) {
    const int width = (int)picture.width, height = (int)picture.height;
    for (int row = first; row < last; ++row) {
        const int end = 2 * row + 2 < height ? 2 * row + 2 : height;
        for (int k = 2 * row; k < end; ++k)
            vary(picture.estimated, seconds, side, width, k, picture.fine.variance + k * side);
        up<true>(picture.fine, side, width, end - 2 * row, 0.5f, row, spare, picture.levels);
    }
}

inline void show(const Picture& picture, int side, int first, int last, float* spare) {
    const int width = (int)picture.width, height = (int)picture.height;
    for (int row = first; row < last; ++row)
        down<true>(picture.levels, side, width, height, 0.5f, row, spare, picture.fine, picture.shown);
}

// Computes and smooths the levels from the second finest on, whose planes are given; the picture has `width` and
// `height` there.
inline void smooth(float* levels, int side, int width, int height, float* spare) {
    const auto planes = [](float* level, int wide) {
        return Fine{level, level + 4 * wide * wide, level + 3 * wide * wide};
    };
    float* level = levels;
    int number = 1;
    // size of a level whose pixels span `pixels` of the second finest
    const auto part = [](int length, int pixels) { return (length + pixels - 1) / pixels; };
    for (int wide = side, pixels = 1; wide > 1; wide /= 2, pixels *= 2, ++number) {
        float* const next = level + given::LEVEL_PLANES * wide * wide;
        const int columns = part(width, pixels), rows = part(height, pixels);
        for (int row = 0; row < (rows + 1) / 2; ++row)
            up<false>(planes(level, wide), wide, columns, rows - 2 * row < 2 ? 1 : 2, 0.5f * (float)(1 << number), row,
                      spare, next);
        level = next;
    }
    for (int wide = 2; wide <= side; wide *= 2) {
        --number;
        float* const finer = level - given::LEVEL_PLANES * wide * wide;
        const int columns = part(width, side / wide), rows = part(height, side / wide);
        for (int row = 0; row < (rows + 1) / 2; ++row)
            down<false>(level, wide, columns, rows, 0.5f * (float)(1 << number), row, spare, planes(finer, wide),
                        Shown{});
        level = finer;
    }
}

}  // namespace pyramid
