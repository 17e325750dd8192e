// Estimates as a picture, over a pyramid of means (tsar/filtering/display.py, whose bits these are).
//
// A level holds five planes: red, green, blue, variance, roughness. The picture and what variance remains replace
// colours and variance on the way down. Of the finest level only the variance is made; the rest is read and written
// where it belongs. Threads take rows of it.
#pragma once
#include "lanes.h"

#pragma clang fp contract(off)

namespace pyramid {

constexpr int PLANES_OF_LEVEL = 5;

struct Fine {
    const float *color, *roughness;
    float* variance;
};

// Of the picture: colours pixel by pixel, and what variance remains.
struct Shown {
    float *color, *remaining;
};

// What variance is made of; `position` is null where nothing is reprojected.
struct Estimated {
    const float *aged, *inverse, *roughness, *rate, *position;
};

// What a picture is made from and of; `levels` begin with the second finest.
struct Picture {
    Fine fine;
    Estimated estimated;
    float* levels;
    Shown shown;
};

inline float larger(float a, float b) { return a > b ? a : b; }
inline float smaller(float a, float b) { return a < b ? a : b; }

// Variance of the pixels of a row, some seconds later, with what lies beside its pixel.
inline void vary(const Estimated& of, float seconds, int side, int row, float* variance) {
    const int start = row * side, count = side * side;
    const float *aged = of.aged + start, *inverse = of.inverse + start, *roughness = of.roughness + start;
    const float* rate = of.rate + row / given::ELEMENT_PX * (side / given::ELEMENT_PX);
    for (int i = 0; i < side; ++i) {
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

inline float mean4(const float* a, const float* b, int column) {
    return (((a[2 * column] + a[2 * column + 1]) + b[2 * column]) + b[2 * column + 1]) / 4.0f;
}

// A row of the coarser level. `between` is half the distance of the finer level's pixels, by which roughness becomes
// variance; `spare` has room for four rows of it.
inline void up(const Fine& fine, int side, float between, int row, float* spare, float* coarse) {
    const int half = side / 2, quarter = half * half, count = side * side, start = 2 * row * side;
    const float *variance = fine.variance + start, *roughness = fine.roughness + start;
    float* __restrict weight = spare, * __restrict weighted = spare + 2 * side;
    float* __restrict to = coarse + row * half;
    for (int i = 0; i < 2 * side; ++i) weight[i] = 1.0f / (variance[i] + between * roughness[i]);
    for (int i = 0; i < half; ++i) {
        to[3 * quarter + i] = 4.0f * mean4(weight, weight + side, i);
        to[4 * quarter + i] = mean4(roughness, roughness + side, i);
    }
    for (int plane = 0; plane < 3; ++plane) {
        const float* color = fine.color + plane * count + start;
        for (int i = 0; i < 2 * side; ++i) weighted[i] = color[i] * weight[i];
        for (int i = 0; i < half; ++i)
            to[plane * quarter + i] = 4.0f * mean4(weighted, weighted + side, i) / to[3 * quarter + i];
    }
    for (int i = 0; i < half; ++i) to[3 * quarter + i] = 1.0f / to[3 * quarter + i];
}

// A row of twice the length, linear, the ends repeated.
inline void enlarge(const float* __restrict from, int half, float* __restrict to) {
    to[0] = 0.75f * from[0] + 0.25f * from[0];
    for (int i = 1; i < half; ++i) {
        to[2 * i] = 0.75f * from[i] + 0.25f * from[i - 1];
        to[2 * i - 1] = 0.75f * from[i - 1] + 0.25f * from[i];
    }
    to[2 * half - 1] = 0.75f * from[half - 1] + 0.25f * from[half - 1];
}

// Two rows of the finer level, from one of the coarser and its neighbours. `spare` has room for sixteen of them. Without
// `shown` what is found replaces the finer level.
inline void down(const float* coarse, int side, float between, int row, float* spare, const Fine& fine,
                 const Shown* shown) {
    const int half = side / 2, count = side * side, quarter = half * half;
    const int near[3] = {row > 0 ? row - 1 : 0, row, row + 1 < half ? row + 1 : row};
    for (int plane = 0; plane < 4; ++plane)
        for (int k = 0; k < 3; ++k)
            enlarge(coarse + plane * quarter + near[k] * half, half, spare + (3 * plane + k) * side);
    for (int second = 0; second < 2; ++second) {
        const int start = (2 * row + second) * side;
        const float *variance = fine.variance + start, *roughness = fine.roughness + start;
        float* __restrict share = spare + 12 * side, * __restrict found = share + side;
        for (int i = 0; i < side; ++i) share[i] = variance[i] / (variance[i] + between * roughness[i]);
        for (int plane = 0; plane < 3; ++plane) {
            const float *mid = spare + (3 * plane + 1) * side, *beside = second ? mid + side : mid - side;
            const float* own = fine.color + plane * count + start;
            float* const to = shown ? found + plane * side : (float*)own;
            for (int i = 0; i < side; ++i) to[i] = own[i] + share[i] * ((0.75f * mid[i] + 0.25f * beside[i]) - own[i]);
        }
        const float *mid = spare + 10 * side, *beside = second ? mid + side : mid - side;
        float* const remaining = shown ? shown->remaining + start : fine.variance + start;
        for (int i = 0; i < side; ++i) {
            const float wide = 0.75f * mid[i] + 0.25f * beside[i];
            remaining[i] = variance[i] + share[i] * share[i] * ((wide - variance[i]) - between * roughness[i]);
        }
        for (int i = 0; shown && i < side; i += 16)
            packets::store_joined(shown->color + 3 * (start + i), {packets::load<packets::f16>(found + i),
                                                                   packets::load<packets::f16>(found + side + i),
                                                                   packets::load<packets::f16>(found + 2 * side + i)});
    }
}

inline void shrink(const Picture& picture, int side, float seconds, int first, int last, float* spare) {
    for (int row = first; row < last; ++row) {
        for (int k = 2 * row; k < 2 * row + 2; ++k)
            vary(picture.estimated, seconds, side, k, picture.fine.variance + k * side);
        up(picture.fine, side, 0.5f, row, spare, picture.levels);
    }
}

inline void show(const Picture& picture, int side, int first, int last, float* spare) {
    for (int row = first; row < last; ++row) down(picture.levels, side, 0.5f, row, spare, picture.fine, &picture.shown);
}

// The coarser levels, from the second finest on, whose planes are given.
inline void smooth(float* levels, int side, float* spare) {
    const auto planes = [](float* level, int wide) {
        return Fine{level, level + 4 * wide * wide, level + 3 * wide * wide};
    };
    float* level = levels;
    int number = 1;
    for (int wide = side; wide > 1; wide /= 2, ++number) {
        float* const next = level + PLANES_OF_LEVEL * wide * wide;
        for (int row = 0; row < wide / 2; ++row)
            up(planes(level, wide), wide, 0.5f * (float)(1 << number), row, spare, next);
        level = next;
    }
    for (int wide = 2; wide <= side; wide *= 2) {
        --number;
        float* const finer = level - PLANES_OF_LEVEL * wide * wide;
        for (int row = 0; row < wide / 2; ++row)
            down(level, wide, 0.5f * (float)(1 << number), row, spare, planes(finer, wide), nullptr);
        level = finer;
    }
}

}  // namespace pyramid
