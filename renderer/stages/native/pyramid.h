// Estimates as a picture, over a pyramid of means (tsar/filtering/display.py, whose bits these are).
//
// A level holds five planes: red, green, blue, variance, roughness. The picture and what variance remains replace
// colours and variance on the way down.
#pragma once
#include "lanes.h"

#pragma clang fp contract(off)

namespace pyramid {

constexpr int PLANES_OF_LEVEL = 5;

inline float mean4(const float* a, const float* b, int column) {
    return (((a[2 * column] + a[2 * column + 1]) + b[2 * column]) + b[2 * column + 1]) / 4.0f;
}

// `between` is half the distance of the level's pixels, by which roughness becomes variance.
inline void up(const float* fine, int side, float between, float* weight, float* coarse) {
    const int count = side * side, half = side / 2, quarter = half * half;
    const float *variance = fine + 3 * count, *roughness = fine + 4 * count;
    float* weighted = weight + count;
    for (int i = 0; i < count; ++i) weight[i] = 1.0f / (variance[i] + between * roughness[i]);
    for (int row = 0; row < half; ++row)
        for (int column = 0; column < half; ++column) {
            const float* a = weight + 2 * row * side;
            const float* g = roughness + 2 * row * side;
            const int i = row * half + column;
            coarse[3 * quarter + i] = 4.0f * mean4(a, a + side, column);
            coarse[4 * quarter + i] = mean4(g, g + side, column);
        }
    for (int plane = 0; plane < 3; ++plane) {
        for (int i = 0; i < count; ++i) weighted[i] = fine[plane * count + i] * weight[i];
        for (int row = 0; row < half; ++row)
            for (int column = 0; column < half; ++column) {
                const float* a = weighted + 2 * row * side;
                const int i = row * half + column;
                coarse[plane * quarter + i] = 4.0f * mean4(a, a + side, column) / coarse[3 * quarter + i];
            }
    }
    for (int i = 0; i < quarter; ++i) coarse[3 * quarter + i] = 1.0f / coarse[3 * quarter + i];
}

// A plane of twice the side, bilinear, the border repeated: along rows, then along columns.
inline void enlarge(const float* coarse, int half, float* rows, float* fine) {
    const int side = 2 * half;
    for (int row = 0; row < half; ++row) {
        const float* from = coarse + row * half;
        float* to = rows + row * side;
        for (int column = 0; column < half; ++column) {
            const float left = from[column > 0 ? column - 1 : 0], right = from[column + 1 < half ? column + 1 : column];
            to[2 * column] = 0.75f * from[column] + 0.25f * left;
            to[2 * column + 1] = 0.75f * from[column] + 0.25f * right;
        }
    }
    for (int row = 0; row < half; ++row) {
        const float *from = rows + row * side, *above = rows + (row > 0 ? row - 1 : 0) * side,
                    *below = rows + (row + 1 < half ? row + 1 : row) * side;
        float *first = fine + 2 * row * side, *second = first + side;
        for (int i = 0; i < side; ++i) first[i] = 0.75f * from[i] + 0.25f * above[i];
        for (int i = 0; i < side; ++i) second[i] = 0.75f * from[i] + 0.25f * below[i];
    }
}

// `spare` has room for two fine planes.
inline void down(const float* coarse, int side, float between, float* spare, float* fine) {
    const int half = side / 2, count = side * side, quarter = half * half;
    float *rows = spare, *wide = spare + count;
    float *variance = fine + 3 * count, *roughness = fine + 4 * count;
    for (int plane = 0; plane < 4; ++plane) {
        enlarge(coarse + plane * quarter, half, rows, wide);
        float* own = fine + plane * count;
        if (plane < 3) {
            for (int i = 0; i < count; ++i) {
                const float share = variance[i] / (variance[i] + between * roughness[i]);
                own[i] = own[i] + share * (wide[i] - own[i]);
            }
        } else {
            for (int i = 0; i < count; ++i) {
                const float s = between * roughness[i], share = own[i] / (own[i] + s);
                own[i] = own[i] + share * share * ((wide[i] - own[i]) - s);
            }
        }
    }
}

// `levels` holds all levels one after the other, the finest, whose planes are given, first.
inline void smooth(float* levels, int side, float* spare) {
    float* level = levels;
    int number = 0;
    for (int wide = side; wide > 1; wide /= 2, ++number) {
        float* const next = level + PLANES_OF_LEVEL * wide * wide;
        up(level, wide, 0.5f * (float)(1 << number), spare, next);
        level = next;
    }
    for (int wide = 2; wide <= side; wide *= 2) {
        --number;
        float* const finer = level - PLANES_OF_LEVEL * wide * wide;
        down(level, wide, 0.5f * (float)(1 << number), spare, finer);
        level = finer;
    }
}

}  // namespace pyramid
