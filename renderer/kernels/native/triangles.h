// Rays against triangles. A ray and a triangle are always tested by the same operations, so a hit does not depend on
// the other rays.
#pragma once
#include "tree.h"

namespace packets {

// Upper bound of the relative rounding error of a box test: Ize 2013, "Robust BVH Ray Traversal".
constexpr float ROUNDING_UP = 1.0000005f;
// The corners of a triangle are rounded when they are translated to the ray's origin. Boxes are padded by as much, so
// that a ray that hits the triangle is not lost at its box, however distant its origin.
constexpr float PADDING = 4.0e-7f;

template <class F> inline F reciprocal(F x) { return 1.0f / (vabs(x) > TINY ? x : (F)TINY); }
inline float reciprocal(float x) { return 1.0f / (x > TINY || x < -TINY ? x : TINY); }

// Ray against triangle after Woop, Benthin and Wald 2013, "Watertight Ray/Triangle Intersection": in a frame whose z
// axis is the ray, the triangle is hit where the origin lies on the same side of all its edges. The two triangles at an
// edge compute the same two products with opposite signs, so one of them is hit. Contraction to fused operations would
// break that, hence the pragma.
//
// Corners are relative to the ray's origin, with their axes permuted so that z is the greatest component of the
// direction. `t`, `u`, `v` are valid where the result is true; u and v are the weights of corners a and b.
template <class F>
inline typename IntOf<F>::type meets_triangle(const Vec<F>& a, const Vec<F>& b, const Vec<F>& c, const Vec<F>& shear,
                                              F& t, F& u, F& v) {
#pragma clang fp contract(off)
    F ax = vfma(-shear.x, a.z, a.x), ay = vfma(-shear.y, a.z, a.y);
    F bx = vfma(-shear.x, b.z, b.x), by = vfma(-shear.y, b.z, b.y);
    F cx = vfma(-shear.x, c.z, c.x), cy = vfma(-shear.y, c.z, c.y);
    F at_a = cx * by - cy * bx, at_b = ax * cy - ay * cx, at_c = bx * ay - by * ax;
    F lowest = vmin(vmin(at_a, at_b), at_c), highest = vmax(vmax(at_a, at_b), at_c);
    F area = at_a + at_b + at_c;
    auto inside = ((lowest >= 0.0f) | (highest <= 0.0f)) & (area != 0.0f);
    if (!bits(inside)) return inside;
    F share = 1.0f / area;
    t = vfma(at_a, a.z, vfma(at_b, b.z, at_c * c.z)) * shear.z * share;
    u = at_a * share;
    v = at_b * share;
    return inside & (t >= 0.0f);
}

// The axis of a direction's greatest component.
inline int fastest_axis(float x, float y, float z) {
    x = __builtin_fabsf(x), y = __builtin_fabsf(y), z = __builtin_fabsf(z);
    return x >= y && x >= z ? 0 : y >= z ? 1 : 2;
}

// A coordinate of a corner of four triangles, or of the eight of two blocks.
template <class F> inline F corners_of(const Block* block, int corner, int axis);
template <> inline f4 corners_of<f4>(const Block* block, int corner, int axis) {
    return load<f4>(block->corner[corner][axis]);
}
template <> inline f8 corners_of<f8>(const Block* block, int corner, int axis) {
    return __builtin_shufflevector(corners_of<f4>(block, corner, axis), corners_of<f4>(block + 1, corner, axis), 0, 1,
                                   2, 3, 4, 5, 6, 7);
}

}  // namespace packets
