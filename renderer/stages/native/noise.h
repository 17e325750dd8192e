// The roughness that neighbouring estimates confirm, with the same bits as tsar/filtering/noise.py. Threads share rows.
#pragma once
#include "lanes.h"

#pragma clang fp contract(off)

namespace noise {

// Planes of `side` pixels a side; the picture is their upper left part, and nothing else is read or written.
struct Planes {
    const float *color, *roughness, *inverse;
    float* detailed;
    long long side, width, height;
};

// Rows that a thread keeps: three of the encoded picture with three colours each, and three each of the sums along rows
// of differences, roughness, noise and inverse; the last is for what is computed. A row has its place by its number.
constexpr int ENCODED = 9, SUMS = 12, ROWS = given::NOISE_ROWS;
static_assert(ROWS == ENCODED + SUMS + 1, "rows of memory");

struct Kept {
    float* rows;
    int width;
    float* encoded(int row, int color) const { return rows + (row % 3 * 3 + color) * width; }
    float* sum(int which, int row) const { return rows + (ENCODED + which * 3 + row % 3) * width; }
    float* spare() const { return rows + (ENCODED + SUMS) * width; }
};

inline float clipped(float value, float least, float most) {
    return value < least ? least : value > most ? most : value;
}

inline void encode(const Planes& of, const Kept& kept, int row) {
    for (int color = 0; color < 3; ++color) {
        const float* from = of.color + (color * of.side + row) * of.side;
        float* __restrict to = kept.encoded(row, color);
        for (int i = 0; i < kept.width; ++i) to[i] = __builtin_sqrtf(clipped(from[i], 0.0f, 1.0f));
    }
}

inline float apart(float red, float green, float blue) { return (red * red + green * green + blue * blue) / 24.0f; }

// Half the mean squared difference of the pixels of a row from their four neighbours.
inline void differ(const Kept& kept, int row, int height, float* __restrict to) {
    const float *red = kept.encoded(row, 0), *green = kept.encoded(row, 1), *blue = kept.encoded(row, 2);
    for (int i = 0; i < kept.width; ++i) to[i] = 0.0f;
    for (int other = row + 1; other >= row - 1; other -= 2) {
        if (other < 0 || other == height) continue;
        const float *r = kept.encoded(other, 0), *g = kept.encoded(other, 1), *b = kept.encoded(other, 2);
        for (int i = 0; i < kept.width; ++i) to[i] += apart(red[i] - r[i], green[i] - g[i], blue[i] - b[i]);
    }
    for (int i = 0; i + 1 < kept.width; ++i)
        to[i] += apart(red[i] - red[i + 1], green[i] - green[i + 1], blue[i] - blue[i + 1]);
    for (int i = 1; i < kept.width; ++i)
        to[i] += apart(red[i - 1] - red[i], green[i - 1] - green[i], blue[i - 1] - blue[i]);
}

// Sums of three pixels of a row; those at its ends are repeated beyond it.
inline void along(const float* __restrict row, int width, float* __restrict to) {
    const int last = width - 1;
    to[0] = row[0] + row[0] + row[last > 0];
    for (int i = 1; i < last; ++i) to[i] = row[i - 1] + row[i] + row[i + 1];
    if (last > 0) to[last] = row[last - 1] + row[last] + row[last];
}

inline void sum(const Planes& of, const Kept& kept, int row) {
    const float *roughness = of.roughness + row * of.side, *inverse = of.inverse + row * of.side;
    float* __restrict spare = kept.spare();
    differ(kept, row, (int)of.height, spare);
    along(spare, kept.width, kept.sum(0, row));
    along(roughness, kept.width, kept.sum(1, row));
    for (int i = 0; i < kept.width; ++i) spare[i] = roughness[i] * inverse[i];
    along(spare, kept.width, kept.sum(2, row));
    along(inverse, kept.width, kept.sum(3, row));
}

inline void tell(const Planes& of, const Kept& kept, int row) {
    const int above = row > 0 ? row - 1 : 0, below = row + 1 < of.height ? row + 1 : row;
    const auto near = [&](int which, int i) {
        return (kept.sum(which, above)[i] + kept.sum(which, row)[i] + kept.sum(which, below)[i]) / 9.0f;
    };
    const float* roughness = of.roughness + row * of.side;
    float* __restrict to = of.detailed + row * of.side;
    for (int i = 0; i < kept.width; ++i) {
        const float noise = near(2, i), most = near(1, i) - noise;
        const float detail =
            clipped((near(0, i) - noise) / (most < given::ROUGHNESS_MIN ? given::ROUGHNESS_MIN : most), 0.0f, 1.0f);
        const float mean = near(3, i), inverse = mean > 1.0f ? 1.0f : mean;
        to[i] = roughness[i] * (inverse + (1.0f - inverse) * detail);
    }
}

// The rows from `first` to before `last`; `spare` has room for ROWS of them.
inline void detailed(const Planes& of, int first, int last, float* spare) {
    const Kept kept{spare, (int)of.width};
    const int height = (int)of.height, begin = first > 0 ? first - 1 : 0;
    for (int row = begin > 0 ? begin - 1 : 0; row <= begin && row < height; ++row) encode(of, kept, row);
    for (int row = begin; row <= last && row < height; ++row) {
        if (row + 1 < height) encode(of, kept, row + 1);
        sum(of, kept, row);
        if (row - 1 >= first) tell(of, kept, row - 1);
    }
    if (last == height) tell(of, kept, height - 1);
}

}  // namespace noise
