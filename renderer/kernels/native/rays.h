// Rays against one mesh: sixteen coherent rays traverse the tree as one packet, others traverse it alone.
//
// The intersection of a ray with a triangle is computed by the same operations either way, and of equally near faces
// the one with the lower number counts. So the hit of a ray depends neither on the other rays nor on the order of
// traversal, except for a ray so exactly in the plane of a triangle that its distance is pure rounding error.
#pragma once
#include "packet.h"

namespace packets {

// Number of rays that are traversed in turns through a large tree.
constexpr int TURNS = 6;
// Up to this many rays of a packet are tested against a leaf one by one.
constexpr int FEW = 3;

// Stores the hit of one lane; with `any` the lane becomes idle.
template <bool any> inline void take(PacketHit& hit, int lane, const RayHit& met) {
    hit.t[lane] = any ? -1.0f : met.t, hit.u[lane] = met.u, hit.v[lane] = met.v, hit.face[lane] = met.face;
}
// The current hit of a lane.
inline RayHit hit_of(const PacketHit& hit, int lane) { return {hit.t[lane], 0.0f, 0.0f, hit.face[lane]}; }

// Tests a few lanes of a packet against a leaf, each with four triangles at once. Returns those with a new hit; with
// `any` they become idle.
template <bool any>
inline unsigned meet_leaf_alone(const Block* leaf, int triangles, const PacketRays& rays, unsigned lanes,
                                PacketHit& hit) {
    unsigned changed = 0;
    for (; lanes; lanes &= lanes - 1) {
        const int lane = first_bit(lanes);
        RayHit one = hit_of(hit, lane);
        const Vec<f4> origin = {(f4)rays.origin.x[lane], (f4)rays.origin.y[lane], (f4)rays.origin.z[lane]};
        const Vec<f4> shear = {(f4)rays.shear_x[lane], (f4)rays.shear_y[lane], (f4)rays.inverse.z[lane]};
        if (!meet_leaf(leaf, triangles, origin, shear, rays.kx, rays.ky, rays.kz, one)) continue;
        changed |= 1u << lane;
        take<any>(hit, lane, one);
    }
    return changed;
}

// Constants of sixteen single rays, computed together and kept in memory for access ray by ray: a lane of a vector is
// written, and often read, through a copy of the whole vector.
struct LaneRays {
    alignas(64) float origin[3][LANES], inverse[3][LANES], inverse_far[3][LANES];
    alignas(64) float near_origin[3][LANES], far_origin[3][LANES], shear[3][LANES];
    alignas(64) int fastest[LANES], near_side[3][LANES], far_side[3][LANES];

    LaneRays(const Vec16& from, const Vec16& along) {
        const f16 x = vabs(along.x), y = vabs(along.y), z = vabs(along.z);
        const i16 by_x = (x >= y) & (x >= z), by_y = y >= z;
        store(fastest, by_x ? (i16)0 : by_y ? (i16)1 : (i16)2);
        const Vec16 turned = pick(by_x, {along.y, along.z, along.x}, pick(by_y, {along.z, along.x, along.y}, along));
        const f16 fast = 1.0f / turned.z;
        store(shear[0], turned.x * fast), store(shear[1], turned.y * fast), store(shear[2], fast);
        const f16 pad = PADDING * vmax(vmax(vmax(vabs(from.x), vabs(from.y)), vabs(from.z)), (f16)1.0f);
        for (int axis = 0; axis < 3; ++axis) {
            const f16 slowness = reciprocal(along[axis]);
            const i16 back = slowness < 0.0f;
            const f16 below = from[axis] - pad, above = from[axis] + pad;
            store(origin[axis], from[axis]);
            store(inverse[axis], slowness), store(inverse_far[axis], slowness * ROUNDING_UP);
            store(near_origin[axis], back ? below : above), store(far_origin[axis], back ? above : below);
            const i16 low = axis * WIDTH, high = (3 + axis) * WIDTH;
            store(near_side[axis], back ? high : low), store(far_side[axis], back ? low : high);
        }
    }
    Single single(int lane) const {
        Single one;
        one.kz = fastest[lane], one.kx = one.kz == 2 ? 0 : one.kz + 1, one.ky = one.kx == 2 ? 0 : one.kx + 1;
        for (int axis = 0; axis < 3; ++axis) {
            one.origin[axis] = origin[axis][lane], one.shear[axis] = shear[axis][lane];
            one.inverse[axis] = inverse[axis][lane], one.inverse_far[axis] = inverse_far[axis][lane];
            one.near_origin[axis] = near_origin[axis][lane], one.far_origin[axis] = far_origin[axis][lane];
            one.near_side[axis] = near_side[axis][lane], one.far_side[axis] = far_side[axis][lane];
        }
        return one;
    }
};

// Hits of sixteen rays in memory, likewise.
struct LaneHits {
    alignas(64) float t[LANES], u[LANES], v[LANES];
    alignas(64) int face[LANES];

    explicit LaneHits(const PacketHit& hit) {
        store(t, hit.t), store(u, hit.u), store(v, hit.v), store(face, hit.face);
    }
    PacketHit joined() const { return {load<f16>(t), load<f16>(u), load<f16>(v), load<i16>(face)}; }
    RayHit of(int lane) const { return {t[lane], 0.0f, 0.0f, face[lane]}; }
    // Stores the hit of one lane; with `any` the lane becomes idle.
    template <bool any> void take(int lane, const RayHit& met) {
        t[lane] = any ? -1.0f : met.t, u[lane] = met.u, v[lane] = met.v, face[lane] = met.face;
    }
};

// Traverses single lanes in turns: while one waits for memory the others continue. Returns those that found a hit; with
// `any` they become idle.
template <bool any>
inline unsigned walk_by_turns(const Tree& tree, const LaneRays& rays, unsigned lanes, LaneHits& hits) {
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
        one.ray = rays.single(lane), one.way = Way(hits.of(lane)), one.lane = lane;
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
                hits.take<any>(one.lane, one.way.hit);
            }
            start(number);
        }
    return changed;
}

// Traverses lanes one by one from the root. Returns those that found a hit; with `any` they become idle.
template <bool any> inline unsigned walk_alone(const Tree& tree, const LaneRays& rays, unsigned lanes, LaneHits& hits) {
    unsigned changed = 0;
    for (; lanes; lanes &= lanes - 1) {
        const int lane = first_bit(lanes);
        RayHit one = hits.of(lane);
        Uncounted none;
        if (!walk<any>(tree, rays.single(lane), one, none)) continue;
        changed |= 1u << lane;
        hits.take<any>(lane, one);
    }
    return changed;
}

// Tests a packet against a leaf: by the triangles near to it, or by single rays where few reach the leaf.
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

// Traverses a packet from the root to the nearest hits. Returns the lanes that found one.
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
        // A leaf is tested by each ray, up to its own hit; a ray that passes its box passes all boxes around it.
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

// Traverses a packet from the root to any hits, which make their lanes idle by a negative `hit.t`. Returns the lanes
// that found one.
//
// Children are not ordered, because the first hit ends a ray, and most of these rays have none. As hits do not come
// nearer, every ray tests a box as soon as it is found.
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

// Traces the busy lanes of sixteen rays, together or one by one. Returns those that found a hit.
template <bool any> inline unsigned trace(const Tree& tree, const Vec16& from, const Vec16& along, PacketHit& hit) {
    Packet rays(from, along);
    if (rays.together) return any ? walk_any(tree, rays, hit) : walk_nearest(tree, rays, hit);
    const unsigned busy = bits(hit.t >= 0.0f);
    // Coherent single rays find the data of the previous ray in the cache; incoherent ones do not.
    const LaneRays alone(from, along);
    LaneHits hits(hit);
    const unsigned found = tree.large && rays.scattered ? walk_by_turns<any>(tree, alone, busy, hits)
                                                        : walk_alone<any>(tree, alone, busy, hits);
    hit = hits.joined();
    return found;
}

}  // namespace packets
