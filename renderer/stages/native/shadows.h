// The motion of the shadows that samples hit, with the same bits as tsar/filtering/shadows.py.
#pragma once
#include "surfels.h"

#pragma clang fp contract(off)

namespace shadows {

struct Vec {
    double x, y, z;
};

// Inputs of a batch; speeds are by elements, of which `across` lie along a side.
struct Batch {
    const float* before;
    float* after;
    long long across;
    const float* position;
    const int* instance;
    const float* point;
    const int* occluder;
    long long samples;
    const long long* track;  // track of each instance
    surfels::Poses now, earlier;
    long long perspective;
    double cycle_s;
};

inline Vec operator-(const Vec& a, const Vec& b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
inline Vec cross(const Vec& a, const Vec& b) {
    return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
inline Vec offset_of(const double* m) { return {m[9], m[10], m[11]}; }
inline Vec turned(const double* m, const Vec& p, const Vec& offset) {
    return {m[0] * p.x + m[1] * p.y + m[2] * p.z + offset.x, m[3] * p.x + m[4] * p.y + m[5] * p.z + offset.y,
            m[6] * p.x + m[7] * p.y + m[8] * p.z + offset.z};
}

// Inverse of a 3 x 3 matrix from cofactors.
inline void invert(const double* m, double* inverse) {
    const Vec rows[3] = {{m[0], m[1], m[2]}, {m[3], m[4], m[5]}, {m[6], m[7], m[8]}};
    const Vec columns[3] = {cross(rows[1], rows[2]), cross(rows[2], rows[0]), cross(rows[0], rows[1])};
    const double determinant = (rows[0].x * columns[0].x + rows[0].y * columns[0].y) + rows[0].z * columns[0].z;
    for (int k = 0; k < 3; ++k) {
        inverse[k] = columns[k].x / determinant;
        inverse[3 + k] = columns[k].y / determinant;
        inverse[6 + k] = columns[k].z / determinant;
    }
}

// The greater distance along both axes of the image, as a share of its side; 0 if either lies behind the camera or the
// distance is not finite.
inline double apart(const Batch& b, const Vec& first, const Vec& second) {
    const double one = b.perspective ? -first.z : 1.0, other = b.perspective ? -second.z : 1.0;
    if (!(one > 0.0 && other > 0.0)) return 0.0;
    const double tan_x = 2.0 * b.earlier.tan_x, tan_y = 2.0 * b.earlier.tan_y;
    const double x = __builtin_fabs(first.x / (tan_x * one) - second.x / (tan_x * other));
    const double y = __builtin_fabs(first.y / (tan_y * one) - second.y / (tan_y * other));
    const double most = x > y ? x : y;
    return x == x && y == y && most < surfels::INF ? most : 0.0;
}

inline double drift(const Batch& b, long long sample) {
    const int surface = b.instance[sample], body = b.occluder[sample];
    if (surface < 0 || body < 0 || b.track[surface] == b.track[body]) return 0.0;
    const float* const p = b.point + 3 * sample;
    const Vec point{p[0], p[1], p[2]};
    const double *now = b.now.rows, *earlier = b.earlier.rows;
    const double* const at = now + surfels::ROW * surface;
    const double* const of = now + surfels::ROW * body;
    double inverse[9];
    invert(of, inverse);
    const Vec within = turned(inverse, turned(at, point, offset_of(at)) - offset_of(of), Vec{0.0, 0.0, 0.0});
    const double *was_at = earlier + surfels::ROW * surface, *was_of = earlier + surfels::ROW * body;
    return apart(b, turned(was_of, within, offset_of(was_of)), turned(was_at, point, offset_of(was_at)));
}

inline void drifted(const Batch& b) {
    const long long across = b.across;
    for (long long i = 0; i < across * across; ++i) b.after[i] = -1.0f;
    for (long long i = 0; i < b.samples; ++i) {
        const int column = (int)(b.position[2 * i] * (float)across), row = (int)(b.position[2 * i + 1] * (float)across);
        const float speed = (float)(drift(b, i) / b.cycle_s);
        float& fastest = b.after[row * across + column];
        fastest = speed > fastest ? speed : fastest;
    }
    for (long long i = 0; i < across * across; ++i) b.after[i] = b.after[i] >= 0.0f ? b.after[i] : b.before[i];
}

}  // namespace shadows
