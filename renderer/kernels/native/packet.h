// Sixteen coherent rays against the boxes and the triangles of one mesh.
#pragma once
#include "single.h"

namespace packets {

// Padding of a triangle's rectangle, in units of the padding of a box: it has three more roundings.
constexpr float CORNER_SLACK = 5.0f;
// Packets whose directions differ by more than this along an axis are traversed ray by ray.
constexpr float SPREAD_MAX = 0.9f;
// Rays whose directions differ by more than this share of the longest component are incoherent.
constexpr float SCATTERED = 1.0f;

// Whether sixteen directions have the same fastest axis; stores that of the first.
inline bool agree(const Vec16& along, int& axis) {
    const f16 x = vabs(along.x), y = vabs(along.y), z = vabs(along.z);
    const unsigned by_x = bits((x >= y) & (x >= z)), by_y = bits(y >= z) & ~by_x;
    axis = by_x & 1u ? 0 : by_y & 1u ? 1 : 2;
    return (axis == 0 ? by_x : axis == 1 ? by_y : ALL & ~(by_x | by_y)) == ALL;
}

// Sixteen rays of the same fastest axis, as boxes of leaves and triangles need them. Axes are turned: z is `kz`, the
// fastest axis, and x and y follow it.
struct PacketRays {
    Vec16 origin, inverse;
    f16 shear_x, shear_y, pad;
    int kx, ky, kz;

    void set(const Vec16& from, const Vec16& along, int fastest) {
        kz = fastest, kx = (kz + 1) % 3, ky = (kz + 2) % 3;
        origin = turned(from);
        const Vec16 way = turned(along);
        inverse = {reciprocal(way.x), reciprocal(way.y), reciprocal(way.z)};
        shear_x = way.x * inverse.z, shear_y = way.y * inverse.z;
        pad = PADDING * vmax(vmax(vmax(vabs(from.x), vabs(from.y)), vabs(from.z)), (f16)1.0f);
    }
    Vec16 turned(const Vec16& v) const { return kz == 0 ? Vec16{v.y, v.z, v.x} : kz == 1 ? Vec16{v.z, v.x, v.y} : v; }

    // Lanes that pass a child's box before their `reach`.
    unsigned passing(const Node& node, int child, const f16& reach) const {
        f16 near = 0.0f, far = reach;
        const int axes[3] = {kx, ky, kz};
        for (int i = 0; i < 3; ++i) {
            const f16 a = (node.lower[axes[i]][child] - (origin[i] + pad)) * inverse[i];
            const f16 b = (node.upper[axes[i]][child] - (origin[i] - pad)) * inverse[i];
            near = vmax(near, vmin(a, b));
            far = vmin(far, vmax(a, b));
        }
        return bits(near <= far * ROUNDING_UP);
    }
};

// Sixteen rays. A lane with a negative `t` in its hit is idle; unless it has a copy of a busy lane's ray, it may
// prevent the traversal as one packet.
struct Packet : PacketRays {
    bool backwards[3];
    float near_origin[3], far_origin[3], inverse_least[3], inverse_most[3];
    // Intersections of the rays with a plane across their fastest axis, and their slopes: mean and half width.
    float plane, low[2], high[2], lean[2], lean_half[2];
    bool together, scattered;  // coherent enough for traversal as one, and incoherent
    bool same_signs;

    Packet(const Vec16& from, const Vec16& along) {
        int axis;
        const bool same_axis = agree(along, axis);
        kz = axis;
        const f16 directions[8] = {along.x, along.y, along.z, -along.x, -along.y, -along.z};
        const f8 bound = least_of_each(directions);
        float spread = 0.0f;
        for (int axis = 0; axis < 3; ++axis) spread = vmax(spread, -bound[3 + axis] - bound[axis]);
        const float longest = vmax(-bound[kz], -bound[3 + kz]);
        // A non-finite ray would spoil the bounds of the others.
        const f16 sum = from.x + from.y + from.z + along.x + along.y + along.z;
        scattered = !(spread <= SCATTERED * longest);
        together =
            same_axis && bits(sum - sum == 0.0f) == ALL && spread <= SPREAD_MAX * longest && longest > 2.0f * TINY;
        if (!together) return;
        set(from, along, kz);
        const Vec16 above = {from.x + pad, from.y + pad, from.z + pad};
        const Vec16 below = {from.x - pad, from.y - pad, from.z - pad};
        const f16 origins[8] = {-above.x, -above.y, -above.z, below.x, below.y, below.z, -pad};
        const f8 outermost = least_of_each(origins);
        same_signs = true;
        for (int axis = 0; axis < 3; ++axis) {
            const float slowest = bound[axis], fastest = -bound[3 + axis];
            backwards[axis] = fastest < -TINY;
            same_signs = same_signs && (backwards[axis] || slowest >= -TINY);
            const float low = -outermost[axis], high = outermost[3 + axis];
            near_origin[axis] = backwards[axis] ? high : low, far_origin[axis] = backwards[axis] ? low : high;
            inverse_least[axis] = reciprocal(fastest), inverse_most[axis] = reciprocal(slowest);
        }
        plane = origin.z[0];
        const f16 behind = origin.z - plane;
        const f16 at_x = origin.x - shear_x * behind, at_y = origin.y - shear_y * behind;
        const f16 leaning[8] = {shear_x, shear_y, -shear_x, -shear_y, at_x, at_y, -at_x, -at_y};
        const f8 edge = least_of_each(leaning);
        const float slack = -CORNER_SLACK * outermost[6];
        for (int i = 0; i < 2; ++i) {
            low[i] = edge[4 + i] - slack, high[i] = -edge[6 + i] + slack;
            lean[i] = 0.5f * (edge[i] - edge[2 + i]), lean_half[i] = -0.5f * (edge[2 + i] + edge[i]);
        }
    }

    // Triangles of one or two blocks that some ray may hit. The projections of the corners onto the plane along all
    // rays of the packet span a rectangle; if it does not overlap the rays' range there, no ray hits the triangle.
    template <class F> unsigned near_to(const Block* block) const {
        F left[2] = {(F)FAR, (F)FAR}, right[2] = {(F)-FAR, (F)-FAR};
        for (int k = 0; k < 3; ++k) {
            const F depth = corners_of<F>(block, k, kz) - plane, size = vabs(depth);
            for (int i = 0; i < 2; ++i) {
                const F at = corners_of<F>(block, k, i ? ky : kx) - lean[i] * depth, half = lean_half[i] * size;
                left[i] = vmin(left[i], at - half), right[i] = vmax(right[i], at + half);
            }
        }
        return bits((left[0] <= high[0]) & (right[0] >= low[0]) & (left[1] <= high[1]) & (right[1] >= low[1]));
    }
};

struct PacketHit {
    f16 t, u, v;
    i16 face;
};

// Children that some ray of the packet may pass, and lower bounds of the distances. Interval arithmetic over the packet
// tests all eight boxes at once: Boulos, Wald and Shirley 2006, "Geometric and Arithmetic Culling Methods for Entire
// Ray Packets".
inline unsigned children_met(const Node& node, const Packet& rays, const PacketHit& hit, float reach, f8& near) {
    near = 0.0f;
    if (rays.same_signs) {
        f8 far = reach;
        for (int axis = 0; axis < 3; ++axis) {
            const bool back = rays.backwards[axis];
            f8 close = load<f8>(back ? node.upper[axis] : node.lower[axis]) - rays.near_origin[axis];
            f8 away = load<f8>(back ? node.lower[axis] : node.upper[axis]) - rays.far_origin[axis];
            near = vmax(near, vmin(close * rays.inverse_least[axis], close * rays.inverse_most[axis]));
            far = vmin(far, vmax(away * rays.inverse_least[axis], away * rays.inverse_most[axis]));
        }
        return bits(near <= far * ROUNDING_UP);
    }
    unsigned met = 0;
    for (int child = 0; child < WIDTH; ++child)
        if (node.child[child] != EMPTY_CHILD && rays.passing(node, child, hit.t)) met |= 1u << child;
    return met;
}

// Lanes of a packet against a leaf, triangle by triangle. Returns the lanes with a new hit; `any` idles them.
template <bool any>
inline unsigned meet_leaf(const Block* leaf, unsigned triangles, const PacketRays& rays, unsigned lanes,
                          PacketHit& hit) {
    unsigned changed = 0;
    const Vec16 shear = {rays.shear_x, rays.shear_y, rays.inverse.z};
    const i16 passing = lanes_of(lanes);  // other lanes must not hit triangles that they would not have reached alone
    for (; triangles; triangles &= triangles - 1) {
        const int number = first_bit(triangles);
        const Block& block = leaf[number / BLOCK_WIDTH];
        const int lane = number % BLOCK_WIDTH;
        Vec16 corner[3];
        for (int k = 0; k < 3; ++k) {
            corner[k].x = block.corner[k][rays.kx][lane] - rays.origin.x;
            corner[k].y = block.corner[k][rays.ky][lane] - rays.origin.y;
            corner[k].z = block.corner[k][rays.kz][lane] - rays.origin.z;
        }
        f16 t, u, v;
        i16 inside = meets_triangle(corner[0], corner[1], corner[2], shear, t, u, v);
        if (!bits(inside)) continue;
        const int face = block.face[lane];
        inside = inside & passing & ((t < hit.t) | ((t == hit.t) & (face < hit.face)));
        changed |= bits(inside);
        hit.t = inside ? any ? (f16)-1.0f : t : hit.t;
        if (any) continue;
        hit.u = inside ? u : hit.u, hit.v = inside ? v : hit.v;
        hit.face = inside ? (i16)face : hit.face;
    }
    return changed;
}

}  // namespace packets
