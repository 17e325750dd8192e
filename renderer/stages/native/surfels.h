// Surfels: where the poses of a time show what was hit earlier, and which of them each pixel takes (tsar/filtering/
// motion.py, whose bits these are).
#pragma once
#include "lanes.h"

// The reference rounds every product.
#pragma clang fp contract(off)

namespace surfels {

using packets::d8;
using packets::l8;
typedef long long Key;

constexpr double INF = __builtin_inf(), NOT_A_NUMBER = __builtin_nan("");
constexpr Key NONE = 0x7fffffffffffffffll;
constexpr int ROW = 12;  // numbers of an instance: three rows of a matrix, and an offset

// What takes each instance to the camera, and last of all what takes directions there.
struct Poses {
    const double* rows;
    int count;
    double tan_x, tan_y;
};

inline int row_of(long long instance, int count) {
    return instance < 0 || instance >= count ? count - 1 : (int)instance;
}

// From the space of the camera to pixels.
template <class Plan>
inline void finish(const Plan& plan, long long instance, double right, double up, double depth, double tan_x,
                   double tan_y, double& x, double& y, double& out_depth) {
    const bool infinite = instance < 0;
    const double unit = plan.perspective ? depth : infinite ? 0.0 : 1.0;
    const bool inside = unit > 0.0;
    x = inside ? (0.5 + right / (2.0 * tan_x * unit)) * plan.side : NOT_A_NUMBER;
    y = inside ? (0.5 - up / (2.0 * tan_y * unit)) * plan.side : NOT_A_NUMBER;
    out_depth = instance <= given::UNSEEN ? -1.0 : !infinite ? depth : depth > 0.0 ? INF : -INF;
}

// Projects eight surfels that lie side by side.
template <class Plan>
inline void project8(const Plan& plan, const Poses& poses, const long long* instance, const float* x, const float* y,
                     const float* z, double* out_x, double* out_y, double* out_depth) {
    int row[8];
    bool same = true;
    for (int i = 0; i < 8; ++i) {
        row[i] = row_of(instance[i], poses.count);
        same &= row[i] == row[0];
    }
    d8 m[ROW];
    for (int k = 0; k < ROW; ++k) {
        if (same)
            m[k] = poses.rows[row[0] * ROW + k];
        else
            for (int i = 0; i < 8; ++i) m[k][i] = poses.rows[row[i] * ROW + k];
    }
    const d8 px = __builtin_convertvector(packets::load<packets::f8>(x), d8),
             py = __builtin_convertvector(packets::load<packets::f8>(y), d8),
             pz = __builtin_convertvector(packets::load<packets::f8>(z), d8);
    const d8 right = m[0] * px + m[1] * py + m[2] * pz + m[9], up = m[3] * px + m[4] * py + m[5] * pz + m[10];
    const d8 depth = -(m[6] * px + m[7] * py + m[8] * pz + m[11]);
    for (int i = 0; i < 8; ++i)
        finish(plan, instance[i], right[i], up[i], depth[i], poses.tan_x, poses.tan_y, out_x[i], out_y[i],
               out_depth[i]);
}

// One surfel.
template <class Plan>
inline void project(const Plan& plan, const Poses& poses, long long instance, const float* point, double& out_x,
                    double& out_y, double& out_depth) {
    const double* m = poses.rows + ROW * row_of(instance, poses.count);
    const double x = point[0], y = point[1], z = point[2];
    const double right = m[0] * x + m[1] * y + m[2] * z + m[9], up = m[3] * x + m[4] * y + m[5] * z + m[10];
    const double depth = -(m[6] * x + m[7] * y + m[8] * z + m[11]);
    finish(plan, instance, right, up, depth, poses.tan_x, poses.tan_y, out_x, out_y, out_depth);
}

template <class Plan>
inline void project_rows(const Plan& plan, const Poses& poses, const long long* instance, const float* point, int first,
                         int last) {
    const int count = plan.side * plan.side;
    double *x = (double*)plan.x, *y = (double*)plan.y, *depth = (double*)plan.depth;
    for (int i = first * plan.side; i < last * plan.side; i += 8)
        project8(plan, poses, instance + i, point + i, point + count + i, point + 2 * count + i, x + i, y + i,
                 depth + i);
}

// The rank of a surfel in one of the pixels around it: the least one takes it.
inline Key rank(int beside, int near, float cost, Key count, int number) {
    Key score = (Key)(cost * given::SCORE_SCALE);
    score = score < 0 ? 0 : score > given::SCORES - 1 ? given::SCORES - 1 : score;
    const Key order = beside ? given::DEPTHS - 1 - near : near;
    return (((Key)beside * given::DEPTHS + order) * given::SCORES + score) * count + number;
}

// For the pixels of some rows the best surfel of all.
template <class Plan>
inline void choose_rows(const Plan& plan, const float* aged, const float* inverse, const float* roughness, int first,
                        int last) {
    const int side = plan.side, count = side * side;
    const double *x = (const double*)plan.x, *y = (const double*)plan.y, *depth = (const double*)plan.depth;
    Key* least = (Key*)plan.least;
    for (int i = first * side; i < last * side; ++i) least[i] = NONE;
    for (int i = 0; i < count; ++i) {
        if (!(y[i] > first - 1.0 && y[i] < last + 1.0 && x[i] > -1.0 && x[i] < side + 1.0 && depth[i] > 0.0)) continue;
        const double left = __builtin_floor(x[i] - 0.5), top = __builtin_floor(y[i] - 0.5);
        const float near_depth = (float)depth[i];
        const int near = __builtin_bit_cast(int, near_depth) >> given::DEPTH_SHIFT;
        float variance = aged[i] + 0.5f * roughness[i] * inverse[i];
        variance = variance > given::VARIANCE_MAX ? given::VARIANCE_MAX : variance;
        const float beside_cost = given::BESIDE * roughness[i];
        for (int down = 0; down < 2; ++down) {
            const double row = top + down;
            if (row < first || row >= last) continue;
            const double away_y = __builtin_fabs(row + 0.5 - y[i]);
            for (int right = 0; right < 2; ++right) {
                const double column = left + right;
                if (column < 0.0 || column >= side) continue;
                const double away_x = __builtin_fabs(column + 0.5 - x[i]);
                const float away = (float)(away_x > away_y ? away_x : away_y);
                const Key key = rank(away > 0.5f, near, variance + beside_cost * away, count, i);
                Key& best = least[(int)row * side + (int)column];
                best = key < best ? key : best;
            }
        }
    }
    int* source = (int*)plan.source;
    double* front = (double*)plan.front;
    for (int i = first * side; i < last * side; ++i) {
        source[i] = least[i] == NONE ? -1 : (int)(least[i] % count);
        front[i] = source[i] < 0 ? INF : depth[source[i]];
    }
}

// Which pixels keep what they took: not where most of their neighbours took what is in front.
template <class Plan> inline void keep_rows(const Plan& plan, int first, int last) {
    const int side = plan.side;
    const double* front = (const double*)plan.front;
    int* source = (int*)plan.source;
    for (int row = first; row < last; ++row)
        for (int column = 0; column < side; ++column) {
            const int at = row * side + column;
            const double bound = front[at] / given::NEARER;
            int nearer = 0;
            for (int down = row > 0 ? -1 : 0; down < (row + 1 < side ? 2 : 1); ++down)
                for (int right = column > 0 ? -1 : 0; right < (column + 1 < side ? 2 : 1); ++right)
                    nearer += front[at + down * side + right] < bound;
            if (nearer >= given::NEARER_COUNT) source[at] = -1;
        }
}

// A plane of what every pixel took.
template <class T> inline void take(T* to, const T* from, const int* source, int first, int last, T otherwise) {
    for (int i = first; i < last; ++i) to[i] = source[i] >= 0 ? from[source[i]] : otherwise;
}

struct Before {
    const float *color, *aged, *inverse;
    const double* time_s;
    const float* roughness;
    const long long* instance;
    const float *point, *position;
};
// Of estimates and surfels, to be written.
struct Planes {
    float *color, *aged, *inverse;
    double* time_s;
    float* roughness;
    long long* instance;
    float *point, *position, *step;
};

// `planes` holds the addresses of Before, then those of Planes.
template <class Plan> inline void take_rows(const Plan& plan, const long long* planes, int first, int last) {
    Before b;
    Planes a;
    __builtin_memcpy(&b, planes, sizeof(b));
    __builtin_memcpy(&a, planes + sizeof(b) / sizeof(*planes), sizeof(a));
    const int side = plan.side, count = side * side, start = first * side, end = last * side;
    const int* source = (const int*)plan.source;
    const double *x = (const double*)plan.x, *y = (const double*)plan.y;
    for (int plane = 0; plane < 3; ++plane) {
        take(a.color + plane * count, b.color + plane * count, source, start, end, 0.0f);
        take(a.point + plane * count, b.point + plane * count, source, start, end, 0.0f);
    }
    take(a.aged, b.aged, source, start, end, given::VARIANCE_MAX);
    take(a.inverse, b.inverse, source, start, end, 1.0f);
    take(a.time_s, b.time_s, source, start, end, -INF);
    take(a.instance, b.instance, source, start, end, (long long)given::UNSEEN);
    for (int i = start; i < end; ++i) {
        const int from = source[i];
        a.roughness[i] = b.roughness[from >= 0 ? from : i];
        a.position[i] = from >= 0 ? (float)x[from] : i % side + 0.5f;
        a.position[count + i] = from >= 0 ? (float)y[from] : i / side + 0.5f;
        a.step[i] = from >= 0 ? a.position[i] - b.position[from] : 0.0f;
        a.step[count + i] = from >= 0 ? a.position[count + i] - b.position[count + from] : 0.0f;
    }
}

}  // namespace surfels
