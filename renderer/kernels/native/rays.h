// Rays against one mesh: sixteen rays that keep together walk the tree as one packet, others walk it alone.
//
// Whether a ray meets a triangle, and where, is computed by the same operations either way, and of equally near faces
// the one with the lower number counts. So a ray's hit does not depend on its company, nor on the order of traversal,
// save where it runs so exactly within a triangle's plane that the distance of that triangle is nothing but rounding.
#pragma once
#include "lanes.h"
#include "tree.h"

namespace packets {

constexpr int STACK = 640;
constexpr float TINY = 1.0e-20f;
// How far a box test may be out after rounding, from above: Ize 2013, "Robust BVH Ray Traversal".
constexpr float ROUNDING_UP = 1.0000005f;
// A triangle's corners are rounded when they are moved to the ray's origin. Boxes are wider by as much, so that a ray
// that the test of a triangle would let pass is not lost at its box, however far away it starts.
constexpr float PADDING = 4.0e-7f;
// In paddings, by how much the rectangle of a triangle is wider: three roundings more than at a box.
constexpr float CORNER_SLACK = 5.0f;
// Packets whose directions differ by more than this along an axis are walked ray by ray.
constexpr float SPREAD_MAX = 0.25f;
// Rays whose directions differ by more than this share of the longest part of one have no way in common.
constexpr float SCATTERED = 1.0f;
// A tree of more triangles is larger, at about 100 bytes each, than most second-level caches.
constexpr int LARGE = 40000;
// Rays that are on their way at a time through a tree like that.
constexpr int TURNS = 2;
// So few rays of a packet meet a leaf one by one.
constexpr int FEW = 3;

template <class F> inline F reciprocal(F x) { return 1.0f / (vabs(x) > TINY ? x : (F)TINY); }
inline float reciprocal(float x) { return 1.0f / (x > TINY || x < -TINY ? x : TINY); }

struct Tree {
    const Node* nodes;
    const Block* blocks;
    bool large;  // for a second-level cache

    Tree(const void* first_node, const void* first_block, int triangles)
        : nodes((const Node*)first_node), blocks((const Block*)first_block), large(triangles > LARGE) {}
};

// Ray against triangle after Woop, Benthin and Wald 2013, "Watertight Ray/Triangle Intersection": in a frame whose z
// axis is the ray, the triangle is hit where the origin lies on the same side of all its edges. The two triangles at an
// edge see the same two products with opposite signs, so one of them is hit; contraction to fused operations would
// break that, hence the pragma.
//
// Corners are relative to the ray's origin, their axes turned so that z is the one along which the ray is fastest.
// `t`, `u`, `v` are valid where the result is true; u and v weigh corners a and b.
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

// The axis along which a direction is longest.
inline int fastest_axis(float x, float y, float z) {
    x = __builtin_fabsf(x), y = __builtin_fabsf(y), z = __builtin_fabsf(z);
    return x >= y && x >= z ? 0 : y >= z ? 1 : 2;
}

// One ray, ready to be walked.
struct Single {
    float origin[3], inverse[3];
    float inverse_far[3];  // for sides that are left, rounded up
    float near_origin[3], far_origin[3];  // moved by the padding, outwards
    float shear[3];
    int kx, ky, kz;
    int near_side[3], far_side[3];  // where a node holds the sides that are met first and last

    Single() = default;
    Single(const float* from, const float* along) {
        kz = fastest_axis(along[0], along[1], along[2]), kx = (kz + 1) % 3, ky = (kz + 2) % 3;
        float fast = 1.0f / along[kz];
        shear[0] = along[kx] * fast, shear[1] = along[ky] * fast, shear[2] = fast;
        float pad = 1.0f;
        for (int axis = 0; axis < 3; ++axis) {
            float size = __builtin_fabsf(from[axis]);
            pad = size > pad ? size : pad;
        }
        pad *= PADDING;
        for (int axis = 0; axis < 3; ++axis) {
            origin[axis] = from[axis], inverse[axis] = reciprocal(along[axis]);
            inverse_far[axis] = inverse[axis] * ROUNDING_UP;
            const bool backwards = inverse[axis] < 0.0f;
            near_origin[axis] = backwards ? from[axis] - pad : from[axis] + pad;
            far_origin[axis] = backwards ? from[axis] + pad : from[axis] - pad;
            near_side[axis] = (backwards ? 3 + axis : axis) * WIDTH, far_side[axis] = (backwards ? axis : 3 + axis) * WIDTH;
        }
    }
};

struct RayHit {
    float t, u, v;
    int face;
};

// Asks the caches for what is walked into later.
inline void prefetch(const Tree& tree, int child) {
    const bool inner = child >= 0;
    const char* at = inner ? (const char*)(tree.nodes + child) : (const char*)(tree.blocks + leaf_block(child));
    const int lines = inner ? 4 : leaf_triangles(child) <= BLOCK_WIDTH ? 3 : 6;
    for (int line = 0; line < lines; ++line) __builtin_prefetch(at + 64 * line);
}

// A coordinate of the corners of four triangles, or of the eight of two blocks.
template <class F> inline F corners_of(const Block* block, int corner, int axis);
template <> inline f4 corners_of<f4>(const Block* block, int corner, int axis) {
    return load<f4>(block->corner[corner][axis]);
}
template <> inline f8 corners_of<f8>(const Block* block, int corner, int axis) {
    return __builtin_shufflevector(corners_of<f4>(block, corner, axis), corners_of<f4>(block + 1, corner, axis), 0, 1,
                                   2, 3, 4, 5, 6, 7);
}

// One ray against one or two blocks at once. Keeps the nearest hit, of equally near ones the face with the lower number;
// whether there is a new one.
template <class F>
inline bool meet_blocks(const Block* block, const Vec<f4>& from, const Vec<f4>& along, int kx, int ky, int kz,
                        RayHit& hit) {
    const Vec<F> origin = {(F)from.x[0], (F)from.y[0], (F)from.z[0]}, shear = {(F)along.x[0], (F)along.y[0], (F)along.z[0]};
    Vec<F> corner[3];
    for (int i = 0; i < 3; ++i)
        corner[i] = Vec<F>{corners_of<F>(block, i, kx), corners_of<F>(block, i, ky), corners_of<F>(block, i, kz)} - origin;
    F t, u, v;
    const auto inside = meets_triangle(corner[0], corner[1], corner[2], shear, t, u, v);
    if (!bits(inside)) return false;
    bool found = false;
    for (unsigned in = bits(inside & (t <= hit.t)); in; in &= in - 1) {
        const int lane = first_bit(in), face = block[lane / BLOCK_WIDTH].face[lane % BLOCK_WIDTH];
        if (t[lane] < hit.t || (t[lane] == hit.t && face < hit.face)) {
            hit = {t[lane], u[lane], v[lane], face};
            found = true;
        }
    }
    return found;
}

// One ray against a leaf, or any number of triangles that follow one another.
inline bool meet_leaf(const Block* block, int triangles, const Vec<f4>& origin, const Vec<f4>& shear, int kx, int ky,
                      int kz, RayHit& hit) {
    bool found = false;
    for (; triangles > BLOCK_WIDTH; triangles -= 2 * BLOCK_WIDTH, block += 2)
        found |= meet_blocks<f8>(block, origin, shear, kx, ky, kz, hit);
    if (triangles > 0) found |= meet_blocks<f4>(block, origin, shear, kx, ky, kz, hit);
    return found;
}

// Takes no notice of what a walk does; see structures.h for one that does.
struct Uncounted {
    void visit() {}
    void test(int) {}
};

// Where a ray is on its way through a tree.
struct Way {
    RayHit hit;  // `t` holds how far to look
    float reach;
    int size, current;  // of the stack; the node or leaf that is next
    bool found;

    explicit Way(const RayHit& none) : hit(none), reach(none.t * ROUNDING_UP), size(0), current(0), found(false) {}
    Way() = default;
};
struct Entry {
    float near;
    int child;
};

// One node or leaf on. `any` ends at the first hit. Returns whether there is more.
template <bool any, class Count>
inline bool step(const Tree& tree, const Single& ray, Entry* stack, Way& way, Count& count) {
    if (way.current >= 0) {
        const Node& node = tree.nodes[way.current];
        count.visit();
        f8 near = 0.0f, far = way.reach;
        for (int axis = 0; axis < 3; ++axis) {
            const f8 close = load<f8>(node.lower[0] + ray.near_side[axis]);
            const f8 away = load<f8>(node.lower[0] + ray.far_side[axis]);
            near = vmax(near, (close - ray.near_origin[axis]) * ray.inverse[axis]);
            far = vmin(far, (away - ray.far_origin[axis]) * ray.inverse_far[axis]);
        }
        unsigned met = bits(near <= far);
        if (met) {
            int lane = first_bit(met);
            met &= met - 1;
            if (!met) {
                way.current = node.child[lane];
                return true;
            }
            // The nearest is next, the others in any order.
            float least = near[lane];
            int next = node.child[lane];
            for (; met; met &= met - 1) {
                lane = first_bit(met);
                const float at = near[lane];
                const int child = node.child[lane];
                const bool nearer = at < least;
                stack[way.size++] = {nearer ? least : at, nearer ? next : child};
                prefetch(tree, stack[way.size - 1].child);
                least = nearer ? at : least, next = nearer ? child : next;
            }
            way.current = next;
            return true;
        }
    } else {
        const Vec<f4> from = {(f4)ray.origin[ray.kx], (f4)ray.origin[ray.ky], (f4)ray.origin[ray.kz]};
        const Vec<f4> shear = {(f4)ray.shear[0], (f4)ray.shear[1], (f4)ray.shear[2]};
        count.test(leaf_triangles(way.current));
        way.found |= meet_leaf(tree.blocks + leaf_block(way.current), leaf_triangles(way.current), from, shear, ray.kx,
                               ray.ky, ray.kz, way.hit);
        if (any && way.found) return false;
        way.reach = way.hit.t * ROUNDING_UP;
    }
    do {
        if (!way.size) return false;
        --way.size;
    } while (stack[way.size].near > way.hit.t);
    way.current = stack[way.size].child;
    return true;
}

// One ray from the root.
template <bool any, class Count> inline bool walk(const Tree& tree, const Single& ray, RayHit& hit, Count& count) {
    Entry stack[STACK];
    Way way(hit);
    while (step<any>(tree, ray, stack, way, count)) {}
    hit = way.hit;
    return way.found;
}

// Sixteen rays. A lane with a negative `t` in its hit is idle; unless it holds the ray of a busy one it may keep the
// packet from being walked as one.
struct Packet {
    Vec16 origin, inverse;
    Vec16 low_origin, high_origin;  // moved by the padding, for lower and upper sides of boxes
    Vec16 shear;
    int kx, ky, kz;
    bool backwards[3];
    float near_origin[3], far_origin[3], inverse_least[3], inverse_most[3];
    // Where the rays pass a plane across their fastest axis, and how far they lean: a middle and half the difference.
    float plane, low[2], high[2], lean[2], lean_half[2];
    bool together, scattered;  // worth walking as one, or without a way in common
    bool same_signs;

    Packet(const Vec16& from, const Vec16& along) : origin(from) {
        const f16 x = vabs(along.x), y = vabs(along.y), z = vabs(along.z);
        const unsigned by_x = bits((x >= y) & (x >= z)), by_y = bits(y >= z) & ~by_x;
        kz = by_x & 1u ? 0 : by_y & 1u ? 1 : 2, kx = (kz + 1) % 3, ky = (kz + 2) % 3;
        const unsigned agree = kz == 0 ? by_x : kz == 1 ? by_y : ALL & ~(by_x | by_y);
        const f16 directions[8] = {along.x, along.y, along.z, -along.x, -along.y, -along.z};
        const f8 bound = least_of_each(directions);
        float spread = 0.0f;
        for (int axis = 0; axis < 3; ++axis) spread = vmax(spread, -bound[3 + axis] - bound[axis]);
        const float longest = vmax(-bound[kz], -bound[3 + kz]);
        // What is not finite would spoil the bounds of the others.
        const f16 sum = from.x + from.y + from.z + along.x + along.y + along.z;
        scattered = !(spread <= SCATTERED * longest);
        together = agree == ALL && bits(sum - sum == 0.0f) == ALL && spread <= SPREAD_MAX * longest &&
                   longest > 2.0f * TINY;
        if (!together) return;
        inverse = {reciprocal(along.x), reciprocal(along.y), reciprocal(along.z)};
        const f16& fast = inverse[kz];
        shear = {along[kx] * fast, along[ky] * fast, fast};
        const f16 pad = PADDING * vmax(vmax(vmax(vabs(from.x), vabs(from.y)), vabs(from.z)), (f16)1.0f);
        low_origin = {from.x + pad, from.y + pad, from.z + pad};
        high_origin = {from.x - pad, from.y - pad, from.z - pad};
        const f16 origins[8] = {-low_origin.x, -low_origin.y, -low_origin.z, high_origin.x,
                                high_origin.y, high_origin.z,  -pad};
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
        plane = from[kz][0];
        const f16 behind = from[kz] - plane;
        const f16 at_x = from[kx] - shear.x * behind, at_y = from[ky] - shear.y * behind;
        const f16 leaning[8] = {shear.x, shear.y, -shear.x, -shear.y, at_x, at_y, -at_x, -at_y};
        const f8 edge = least_of_each(leaning);
        const float slack = -CORNER_SLACK * outermost[6];
        for (int i = 0; i < 2; ++i) {
            low[i] = edge[4 + i] - slack, high[i] = -edge[6 + i] + slack;
            lean[i] = 0.5f * (edge[i] - edge[2 + i]), lean_half[i] = -0.5f * (edge[2 + i] + edge[i]);
        }
    }

    // Which triangles of one or two blocks some ray may meet. Moved to the plane along every ray of the packet, corners
    // span a rectangle; where it does not reach the rays there, none of them is within the triangle.
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

    // Which lanes pass a child's box before their `reach`.
    unsigned passing(const Node& node, int child, const f16& reach) const {
        f16 near = 0.0f, far = reach;
        for (int axis = 0; axis < 3; ++axis) {
            f16 a = (node.lower[axis][child] - low_origin[axis]) * inverse[axis];
            f16 b = (node.upper[axis][child] - high_origin[axis]) * inverse[axis];
            near = vmax(near, vmin(a, b));
            far = vmin(far, vmax(a, b));
        }
        return bits(near <= far * ROUNDING_UP);
    }
};

struct PacketHit {
    f16 t, u, v;
    i16 face;
};

// Which children some ray of the packet may pass, and a lower bound of where. Interval arithmetic over the packet tests
// all eight boxes at once: Boulos, Wald and Shirley 2006, "Geometric and Arithmetic Culling Methods for Entire Ray
// Packets".
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
inline unsigned meet_leaf(const Block* leaf, unsigned triangles, const Packet& rays, unsigned lanes, PacketHit& hit) {
    unsigned changed = 0;
    const i16 passing = lanes_of(lanes);  // others must not hit what they would not have met alone
    for (; triangles; triangles &= triangles - 1) {
        const int number = first_bit(triangles);
        const Block& block = leaf[number / BLOCK_WIDTH];
        const int lane = number % BLOCK_WIDTH;
        Vec16 corner[3];
        for (int k = 0; k < 3; ++k) {
            corner[k].x = block.corner[k][rays.kx][lane] - rays.origin[rays.kx];
            corner[k].y = block.corner[k][rays.ky][lane] - rays.origin[rays.ky];
            corner[k].z = block.corner[k][rays.kz][lane] - rays.origin[rays.kz];
        }
        f16 t, u, v;
        i16 inside = meets_triangle(corner[0], corner[1], corner[2], rays.shear, t, u, v);
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

// Puts what one lane met into its place; `any` idles the lane.
template <bool any> inline void take(PacketHit& hit, int lane, const RayHit& met) {
    hit.t[lane] = any ? -1.0f : met.t, hit.u[lane] = met.u, hit.v[lane] = met.v, hit.face[lane] = met.face;
}
// What a lane met last.
inline RayHit hit_of(const PacketHit& hit, int lane) { return {hit.t[lane], 0.0f, 0.0f, hit.face[lane]}; }
inline Single single_of(const Vec16& from, const Vec16& along, int lane) {
    const float origin[3] = {from.x[lane], from.y[lane], from.z[lane]};
    const float direction[3] = {along.x[lane], along.y[lane], along.z[lane]};
    return Single(origin, direction);
}

// Few lanes of a packet against a leaf, each with four triangles at once. Returns those with a new hit; `any` idles them.
template <bool any>
inline unsigned meet_leaf_alone(const Block* leaf, int triangles, const Packet& rays, unsigned lanes, PacketHit& hit) {
    unsigned changed = 0;
    const Vec16 from = {rays.origin[rays.kx], rays.origin[rays.ky], rays.origin[rays.kz]};
    for (; lanes; lanes &= lanes - 1) {
        const int lane = first_bit(lanes);
        RayHit one = hit_of(hit, lane);
        const Vec<f4> origin = {(f4)from.x[lane], (f4)from.y[lane], (f4)from.z[lane]};
        const Vec<f4> shear = {(f4)rays.shear.x[lane], (f4)rays.shear.y[lane], (f4)rays.shear.z[lane]};
        if (!meet_leaf(leaf, triangles, origin, shear, rays.kx, rays.ky, rays.kz, one)) continue;
        changed |= 1u << lane;
        take<any>(hit, lane, one);
    }
    return changed;
}

// Lanes by themselves, in turns: while one waits for memory the others go on. Returns those that found a hit; `any`
// idles them.
template <bool any>
inline unsigned walk_by_turns(const Tree& tree, const Vec16& from, const Vec16& along, unsigned lanes, PacketHit& hit) {
    struct Walker {
        Single ray;
        Way way;
        int lane;
        Entry stack[STACK];
    } walkers[TURNS];
    unsigned changed = 0, busy = 0;
    Uncounted none;
    const auto start = [&](int number) {
        busy &= ~(1u << number);
        if (!lanes) return;
        const int lane = first_bit(lanes);
        Walker& one = walkers[number];
        one.ray = single_of(from, along, lane), one.way = Way(hit_of(hit, lane)), one.lane = lane;
        lanes &= lanes - 1, busy |= 1u << number;
    };
    for (int number = 0; number < TURNS; ++number) start(number);
    while (busy)
        for (int number = 0; number < TURNS; ++number) {
            Walker& one = walkers[number];
            if (!(busy >> number & 1u)) continue;
            if (step<any>(tree, one.ray, one.stack, one.way, none)) {
                prefetch(tree, one.way.current);
                continue;
            }
            if (one.way.found) {
                changed |= 1u << one.lane;
                take<any>(hit, one.lane, one.way.hit);
            }
            start(number);
        }
    return changed;
}

// Lanes one by one, from the root. Returns those that found a hit; `any` idles them.
template <bool any>
inline unsigned walk_alone(const Tree& tree, const Vec16& from, const Vec16& along, unsigned lanes, PacketHit& hit) {
    unsigned changed = 0;
    for (; lanes; lanes &= lanes - 1) {
        const int lane = first_bit(lanes);
        RayHit one = hit_of(hit, lane);
        Uncounted none;
        if (!walk<any>(tree, single_of(from, along, lane), one, none)) continue;
        changed |= 1u << lane;
        take<any>(hit, lane, one);
    }
    return changed;
}

// A packet against a leaf: by triangles that are near to it, or by rays where few of these come that far.
template <bool any>
inline unsigned visit_leaf(const Tree& tree, int child, const Packet& rays, unsigned lanes, PacketHit& hit) {
    const Block* leaf = tree.blocks + leaf_block(child);
    const int triangles = leaf_triangles(child);
    const int rays_left = __builtin_popcount(lanes);
    if (rays_left <= FEW) return meet_leaf_alone<any>(leaf, triangles, rays, lanes, hit);
    const unsigned near = triangles > BLOCK_WIDTH ? rays.near_to<f8>(leaf) : rays.near_to<f4>(leaf);
    const unsigned some = near & ((1u << triangles) - 1);
    if (!some) return 0;
    return rays_left < __builtin_popcount(some) ? meet_leaf_alone<any>(leaf, triangles, rays, lanes, hit)
                                                : meet_leaf<any>(leaf, some, rays, lanes, hit);
}

// A packet from the root to the nearest hits. Returns the lanes that found one.
inline unsigned walk_nearest(const Tree& tree, const Packet& rays, PacketHit& hit) {
    struct Entry {
        float near;
        int child;
        const Node* parent;
        int slot;
    } stack[STACK];
    int size = 0;
    unsigned found = 0;
    float reach = greatest(hit.t);
    stack[size++] = {0.0f, 0, nullptr, 0};
    while (size) {
        const Entry entry = stack[--size];
        if (entry.near > reach) continue;
        // A leaf by each ray, and only as far as its own hit; who passes its box passes all boxes around it.
        const unsigned active = entry.child < 0 ? rays.passing(*entry.parent, entry.slot, hit.t) : ALL;
        if (!active) continue;
        if (entry.child >= 0) {
            const Node& node = tree.nodes[entry.child];
            const int base = size;
            f8 near;
            for (unsigned met = children_met(node, rays, hit, reach, near); met; met &= met - 1) {
                const int lane = first_bit(met);
                prefetch(tree, node.child[lane]);
                const float at = near[lane];
                int slot = size++;
                for (; slot > base && stack[slot - 1].near < at; --slot) stack[slot] = stack[slot - 1];
                stack[slot] = {at, node.child[lane], &node, lane};
            }
            continue;
        }
        const unsigned changed = visit_leaf<false>(tree, entry.child, rays, active, hit);
        if (!changed) continue;
        found |= changed;
        reach = greatest(hit.t);
    }
    return found;
}

// A packet from the root to any hits, which idle their lanes by a negative `hit.t`. Returns the lanes that found one.
//
// No order is kept, for the first hit ends a ray, and most of the rays that are asked about have none. Without hits that
// come nearer, a box is tested by each ray as soon as it is found.
inline unsigned walk_any(const Tree& tree, const Packet& rays, PacketHit& hit) {
    struct Entry {
        int child;
        unsigned lanes;
    } stack[STACK];
    int size = 0;
    unsigned busy = bits(hit.t >= 0.0f), found = 0;
    const float reach = greatest(hit.t);
    stack[size++] = {0, ALL};
    while (size) {
        const Entry entry = stack[--size];
        const unsigned active = entry.lanes & busy;
        if (!active) continue;
        if (entry.child >= 0) {
            const Node& node = tree.nodes[entry.child];
            f8 near;
            for (unsigned met = children_met(node, rays, hit, reach, near); met; met &= met - 1) {
                const int lane = first_bit(met);
                const unsigned passing = rays.passing(node, lane, hit.t);
                stack[size] = {node.child[lane], passing};
                size += passing != 0;
                prefetch(tree, node.child[lane]);
            }
            continue;
        }
        const unsigned changed = visit_leaf<true>(tree, entry.child, rays, active, hit);
        found |= changed, busy &= ~changed;
    }
    return found;
}

// The busy lanes of sixteen rays, together or one by one. Returns those that found a hit.
template <bool any> inline unsigned trace(const Tree& tree, const Vec16& from, const Vec16& along, PacketHit& hit) {
    Packet rays(from, along);
    if (rays.together) return any ? walk_any(tree, rays, hit) : walk_nearest(tree, rays, hit);
    const unsigned busy = bits(hit.t >= 0.0f);
    // What one of several rays has read the next one finds in the cache, unless they go apart.
    return tree.large && rays.scattered ? walk_by_turns<any>(tree, from, along, busy, hit)
                                        : walk_alone<any>(tree, from, along, busy, hit);
}

}  // namespace packets
