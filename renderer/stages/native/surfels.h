// Surfels: projection of earlier hits at the poses of a time, and the choice of a surfel for each pixel, with the same
// bits as tsar/filtering/motion.py.
#pragma once
#include "lanes.h"

// The reference rounds every product.
#pragma clang fp contract(off)

namespace surfels {

using packets::d8;
using packets::f16;
using packets::f4;
using packets::f8;
using packets::i8;
using packets::l8;
using packets::load;
using packets::store;
using packets::vabs;
using packets::vfloor;
using packets::vmax;
using packets::vmin;
typedef long long Key;

constexpr double INF = __builtin_inf();
constexpr Key NONE = 0x7fffffffffffffffll;
constexpr int ROW = given::POSE_NUMBERS;  // of an instance

// Matrices and offsets from each instance to the camera; the last is for directions.
struct Poses {
    const double* rows;
    int count;
    double tan_x, tan_y;
};

// Eight adjacent surfels on the image; positions of those that are not visible are undefined.
struct Eight {
    d8 x, y, depth;
    l8 inside, seen;  // whether there is a position, and whether it lies on the image
};

template <class Plan> inline Eight project8(const Plan& plan, const Poses& poses, l8 number, d8 x, d8 y, d8 z) {
    const l8 infinite = number < 0, row = (infinite | (number >= poses.count)) ? (l8)(poses.count - 1) : number;
    d8 right = 0.0, up = 0.0, depth = 0.0;
    // mostly all belong to one instance
    for (unsigned left = 255u; left;) {
        const long long chosen = row[packets::first_bit(left)];
        const double* m = poses.rows + ROW * chosen;
        const l8 here = row == chosen;
        right = here ? m[0] * x + m[1] * y + m[2] * z + m[9] : right;
        up = here ? m[3] * x + m[4] * y + m[5] * z + m[10] : up;
        depth = here ? -(m[6] * x + m[7] * y + m[8] * z + m[11]) : depth;
        left &= ~packets::bits(here);
    }
    const d8 away = infinite ? (d8)0.0 : (d8)1.0, unit = plan.perspective ? depth : away;
    Eight e;
    e.x = (0.5 + right / (2.0 * poses.tan_x * unit)) * plan.side;
    e.y = (0.5 - up / (2.0 * poses.tan_y * unit)) * plan.side;
    e.depth = infinite ? (d8)INF : depth;
    e.inside = unit > 0.0;
    e.seen = (number > given::UNSEEN) & e.inside & (depth > 0.0) & (e.x > -1.0) & (e.x < plan.side + 1.0) &
             (e.y > -1.0) & (e.y < plan.side + 1.0);
    return e;
}

// Surfels of the image.
template <class Plan>
inline Eight project8(const Plan& plan, const Poses& poses, const long long* instance, const float* point, int start) {
    const int count = plan.side * plan.side;
    const auto component = [&](int k) { return __builtin_convertvector(load<f8>(point + k * count + start), d8); };
    return project8(plan, poses, load<l8>(instance + start), component(0), component(1), component(2));
}

// Eight surfels that reach pixels of the rows `low` to `high`, some of them in other bands.
struct Crossing {
    int start, low, high;
};

// Rows of the image that one thread works on.
struct Band {
    long long first, last;
    Key* least;          // best rank of each pixel, with two more on every side
    Crossing* crossing;  // room for one per eight of its pixels
    long long crossings;
};

// Variance of estimates from change, and rates of change of the elements.
struct Ageing {
    const float *aged, *rate;
    float seconds;
};

// Variance from change of eight adjacent pixels at the new time.
inline f8 later8(const Ageing& by, int side, int start) {
    const int edge = given::ELEMENT_PX;
    const float* q = by.rate + start / side / edge * (side / edge) + start % side / edge;
    const f8 rate = {q[0], q[0], q[0], q[0], q[1], q[1], q[1], q[1]};
    static_assert(given::ELEMENT_PX == 4);
    return vmin(load<f8>(by.aged + start) + rate * by.seconds, (f8)given::VARIANCE_MAX);
}

struct Uncertain {
    const float *aged, *inverse, *roughness;
};

// The rank of surfels in pixels whose centres are at the distance `away`; the index breaks ties. It fits into 32 bits.
static_assert(2ll * given::DEPTHS * given::SCORES < 1ll << 31);
inline i8 rank(i8 near, f8 variance, f8 beside_cost, f8 away) {
    const f8 cost = (variance + beside_cost * away) * given::SCORE_SCALE;
    const i8 score = __builtin_convertvector(vmax(vmin(cost, (f8)(given::SCORES - 1.0f)), (f8)0.0f), i8);
    return (away > 0.5f ? 2 * given::DEPTHS - 1 - near : near) * given::SCORES + score;
}

// Offers eight surfels to those of the four pixels around each that belong to the band.
template <class Plan>
inline void offer8(const Plan& plan, const Eight& e, const Uncertain& of, int start, const Band& band) {
    const int stride = plan.side + 4, rows = (int)(band.last - band.first);
    const d8 left = e.seen ? vfloor(e.x - 0.5) : (d8)-2.0, top = e.seen ? vfloor(e.y - 0.5) : (d8)-2.0;
    const i8 column = __builtin_convertvector(left, i8) + 2,
             row = __builtin_convertvector(top, i8) - (int)band.first + 2;
    // offers outside the band go into the margin
    const i8 within = row < 0 ? (i8)0 : row > rows + 2 ? (i8)(rows + 2) : row;
    const i8 first = __builtin_convertvector(e.seen, i8) ? within * stride + column : (i8)0;
    const i8 near = __builtin_bit_cast(i8, __builtin_convertvector(e.depth, f8)) >> given::DEPTH_SHIFT;
    const f8 roughness = load<f8>(of.roughness + start), beside_cost = given::BESIDE * roughness;
    const f8 known = load<f8>(of.aged + start) + 0.5f * roughness * load<f8>(of.inverse + start);
    const f8 variance = vmin(known, (f8)given::VARIANCE_MAX);
    f8 away_x[2], away_y[2];
    for (int k = 0; k < 2; ++k) {
        away_x[k] = __builtin_convertvector(vabs(left + k + 0.5 - e.x), f8);
        away_y[k] = __builtin_convertvector(vabs(top + k + 0.5 - e.y), f8);
    }
    const l8 number = l8{0, 1, 2, 3, 4, 5, 6, 7} + start;
    int at[8];
    Key key[4][8];
    store(at, first);
    for (int k = 0; k < 4; ++k) {
        const i8 ranked = rank(near, variance, beside_cost, vmax(away_x[k % 2], away_y[k / 2]));
        store(key[k], __builtin_convertvector(ranked, l8) << 32 | number);
    }
    for (int i = 0; i < 8; ++i)
        for (int k = 0; k < 4; ++k) {
            Key& best = band.least[at[i] + k / 2 * stride + k % 2];
            best = key[k][i] < best ? key[k][i] : best;
        }
}

// Stores eight positions and displacements, one surfel after the other.
inline void store_motion(float* to, f8 x, f8 y, f8 step_x, f8 step_y) {
    const f16 place = __builtin_shufflevector(x, y, 0, 8, 1, 9, 2, 10, 3, 11, 4, 12, 5, 13, 6, 14, 7, 15);
    const f16 step = __builtin_shufflevector(step_x, step_y, 0, 8, 1, 9, 2, 10, 3, 11, 4, 12, 5, 13, 6, 14, 7, 15);
    store(to, __builtin_shufflevector(place, step, 0, 1, 16, 17, 2, 3, 18, 19, 4, 5, 20, 21, 6, 7, 22, 23));
    store(to + 16, __builtin_shufflevector(place, step, 8, 9, 24, 25, 10, 11, 26, 27, 12, 13, 28, 29, 14, 15, 30, 31));
}

// Projects the surfels that lie in a band and offers them to its pixels.
template <class Plan>
inline void offer_own(const Plan& plan, const Poses& poses, const long long* instance, const float* point,
                      const float* position, const Uncertain& of, const Ageing& ageing, Band& band) {
    const int side = plan.side, count = side * side;
    double* depth = (double*)plan.depth;
    for (long long i = 0; i < (band.last - band.first + 4) * (side + 4); ++i) band.least[i] = NONE;
    band.crossings = 0;
    for (int start = (int)band.first * side; start < band.last * side; start += 8) {
        const Eight e = project8(plan, poses, instance, point, start);
        const f8 x = __builtin_convertvector(e.x, f8), y = __builtin_convertvector(e.y, f8);
        store_motion((float*)plan.motion + 4 * start, x, y, x - load<f8>(position + start),
                     y - load<f8>(position + count + start));
        store(depth + start, e.depth);
        store((float*)plan.aged + start, later8(ageing, side, start));
        if (!packets::bits(e.seen)) continue;
        offer8(plan, e, of, start, band);
        const d8 top = vfloor(e.y - 0.5);
        const unsigned crosses =
            packets::bits(e.seen & ((top < (double)band.first) | (top + 1.0 >= (double)band.last)));
        if (!crosses) continue;
        Crossing& crossing = band.crossing[band.crossings++];
        crossing = {start, side, -1};
        for (unsigned left = crosses; left; left &= left - 1) {
            const int row = (int)top[packets::first_bit(left)];
            crossing.low = row < crossing.low ? row : crossing.low;
            crossing.high = row + 1 > crossing.high ? row + 1 : crossing.high;
        }
    }
}

// Offers the surfels of other bands that reach into a band to it; then the best of all surfels are known.
template <class Plan>
inline void choose(const Plan& plan, const Poses& poses, const long long* instance, const float* point,
                   const Uncertain& of, const Band* bands, int count, int number) {
    const Band& band = bands[number];
    const int side = plan.side, stride = side + 4, wide = side + 2 * given::FRAME;
    for (int other = 0; other < count; ++other)
        for (int i = 0; other != number && i < bands[other].crossings; ++i) {
            const Crossing& crossing = bands[other].crossing[i];
            if (crossing.high < band.first || crossing.low >= band.last) continue;
            offer8(plan, project8(plan, poses, instance, point, crossing.start), of, crossing.start, band);
        }
    const double* depth = (const double*)plan.depth;
    for (int row = (int)band.first; row < band.last; ++row) {
        const Key* least = band.least + (row - band.first + 2) * stride + 2;
        int* source = (int*)plan.source + row * side;
        double* front = (double*)plan.front + (row + 1) * wide + given::FRAME;
        const int kept = row < plan.height ? plan.width : 0;
        for (int column = 0; column < side; ++column) {
            source[column] = column >= kept || least[column] == NONE ? -1 : (int)least[column];
            front[column] = source[column] < 0 ? INF : depth[source[column]];
        }
    }
}

}  // namespace surfels
