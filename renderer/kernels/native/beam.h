// Up to sixteen packets of rays through the tree of one mesh at once.
//
// The rays of a framelet, and those from a surface to one light, lie in a thin beam. A node is tested once for the
// whole beam, the box of a leaf for all packets at once, and its triangles by the packets that may meet it. A ray and a
// triangle are tested by the same operations as elsewhere, so the hits are the same.
//
// Source: Reshetov, Soupikov and Hurley 2005, "Multi-Level Ray Tracing Algorithm"; Overbeck, Ramamoorthi and Mark 2008,
// "Large Ray Packets for Real-time Whitted Ray Tracing".
#pragma once
#include "rays.h"

namespace packets {

constexpr int BEAM = LANES;  // maximum number of packets of a beam
// Padding of a beam's sides, in units of the padding of a box: they have more roundings.
constexpr float SIDE_SLACK = 10.0f;
// The width of a beam is that of its section half way through the mesh. A packet joins while the square of the beam's
// width is at most this many times the number of packets times the square of the narrowest packet's width.
constexpr float GROWTH = 5.0f;
// Packets wider than this share of the mesh are not part of a beam.
constexpr float WIDEST = 0.1f;
// Number of leaves of a large tree that wait for their triangles to come into the cache.
constexpr unsigned WAITING = 8;

struct Beam {
    int kx, ky, kz;
    bool backwards;           // along `kz`; depth is the coordinate along `kz`, negative if backwards
    int held = 0, count = 0;  // number of packets, and of those at the front that are traced together
    PacketRays rays[BEAM];
    PacketHit hit[BEAM];
    f16 speed[BEAM];  // depth that a ray gains in a unit of distance
    float start, slack;
    // Sides as functions of the coordinate along `kz`: low along `kx` and `ky`, high along both. For the whole beam, and
    // for each packet.
    float at_zero[4], slope[4];
    alignas(64) float at_zero_of[4][BEAM], slope_of[4][BEAM];
    alignas(64) float first[BEAM], reach[BEAM];  // depths at which a packet begins and ends

    f16 depth_of(const f16& z) const { return backwards ? -z : z; }
    float end_of(int packet) const {
        return greatest(depth_of(rays[packet].origin.z) + hit[packet].t * speed[packet]) + slack;
    }

    // Adds a packet, unless its rays differ in their fastest axis or its sign from each other or from those of the beam.
    bool add(const Vec16& from, const Vec16& along, const PacketHit& none) {
        int axis;
        if (!agree(along, axis)) return false;
        const f16& fast = along[axis];
        const unsigned back = bits(fast < 0.0f);
        const f16 sum = from.x + from.y + from.z + along.x + along.y + along.z;
        if ((back && back != ALL) || bits((sum - sum == 0.0f) & (vabs(fast) > 2.0f * TINY)) != ALL) return false;
        if (!held)
            kz = axis, kx = (kz + 1) % 3, ky = (kz + 2) % 3, backwards = back != 0;
        else if (axis != kz || backwards != (back != 0))
            return false;
        rays[held].set(from, along, kz);
        speed[held] = vabs(fast);
        hit[held++] = none;
        return true;
    }

    // Removes packets from the front.
    void drop(int number) {
        held -= number;
        for (int i = 0; i < held; ++i) {
            rays[i] = rays[number + i], speed[i] = speed[number + i], hit[i] = hit[number + i];
        }
    }

    // Counts the packets at the front that form a beam, and finds its sides. Between two planes, before which no ray
    // begins and behind which there is no triangle, positions along a ray are means of those on the planes. So bounds of
    // these give lines that no ray crosses.
    void bound(const Tree& tree) {
        const Node& root = tree.nodes[0];
        f16 least_depth = FAR, most_depth = -FAR, pad = 0.0f;
        for (int i = 0; i < held; ++i) {
            const f16 depth = depth_of(rays[i].origin.z);
            least_depth = vmin(least_depth, depth), most_depth = vmax(most_depth, depth + hit[i].t * speed[i]);
            pad = vmax(pad, rays[i].pad);
        }
        start = least(least_depth);
        const f8 sides = backwards ? -load<f8>(root.lower[kz]) : load<f8>(root.upper[kz]);
        float end = vmin(greatest(most_depth), greatest(sides));
        if (!(end > start + 1.0e-3f)) end = start + 1.0f;
        slack = vmax(greatest(pad), PADDING * vmax(__builtin_fabsf(start), __builtin_fabsf(end))) * SIDE_SLACK;
        const float from = backwards ? -start : start, to = backwards ? -end : end, share = 1.0f / (to - from);
        float across = 0.0f, narrowest = FAR;
        for (int i = 0; i < 2; ++i) {
            const int axis = i ? ky : kx;
            across += greatest(load<f8>(root.upper[axis])) - least(load<f8>(root.lower[axis]));
        }
        f8 edge = 0.0f;
        for (count = 0; count < held; ++count) {
            const PacketRays& one = rays[count];
            const f16 before = from - one.origin.z, after = to - one.origin.z;
            const f16 ends[8] = {one.origin.x + one.shear_x * before,    one.origin.y + one.shear_y * before,
                                 -(one.origin.x + one.shear_x * before), -(one.origin.y + one.shear_y * before),
                                 one.origin.x + one.shear_x * after,     one.origin.y + one.shear_y * after,
                                 -(one.origin.x + one.shear_x * after),  -(one.origin.y + one.shear_y * after)};
            const f8 own = least_of_each(ends), joined = count ? vmin(edge, own) : own;
            const float width = width_of(own), of_all = width_of(joined);
            narrowest = vmin(narrowest, width);
            if (width > WIDEST * across || of_all * of_all > GROWTH * (float)(count + 1) * narrowest * narrowest) break;
            edge = joined;
            for (int side = 0; side < 4; ++side)
                line(own, side, from, share, at_zero_of[side][count], slope_of[side][count]);
            first[count] = least(depth_of(one.origin.z)) - slack, reach[count] = end_of(count);
        }
        for (int side = 0; side < 4; ++side) line(edge, side, from, share, at_zero[side], slope[side]);
    }

    // Children that the beam may meet up to the depth `end`, and their least depths.
    unsigned children_met(const Node& node, float end, f8& near) const {
        const f8 low = load<f8>(node.lower[kz]), high = load<f8>(node.upper[kz]);
        near = backwards ? -high : low;
        i8 met = (near <= end) & ((backwards ? -low : high) >= start - slack);
        for (int i = 0; i < 2; ++i) {
            const int axis = i ? ky : kx, above = 2 + i;
            met &= load<f8>(node.upper[axis]) >= at_zero[i] + slope[i] * (slope[i] > 0.0f ? low : high);
            met &= load<f8>(node.lower[axis]) <= at_zero[above] + slope[above] * (slope[above] > 0.0f ? high : low);
        }
        return bits(met);
    }

    // Packets that may meet a child.
    unsigned packets_met(const Node& node, int child) const {
        const float low = node.lower[kz][child], high = node.upper[kz][child];
        i16 met = (load<f16>(reach) >= (backwards ? -high : low)) & (load<f16>(first) <= (backwards ? -low : high));
        for (int i = 0; i < 2; ++i) {
            const int axis = i ? ky : kx, above = 2 + i;
            const f16 left = load<f16>(slope_of[i]), right = load<f16>(slope_of[above]);
            met &= node.upper[axis][child] >= load<f16>(at_zero_of[i]) + vmin(left * low, left * high);
            met &= node.lower[axis][child] <= load<f16>(at_zero_of[above]) + vmax(right * low, right * high);
        }
        return bits(met);
    }

    // Triangles of one or two blocks that a packet may hit: their corners are not all beyond the same side.
    template <class F> unsigned near_to(const Block* block, int packet) const {
        F most[2] = {(F)-FAR, (F)-FAR}, least[2] = {(F)FAR, (F)FAR};
        for (int k = 0; k < 3; ++k) {
            const F z = corners_of<F>(block, k, kz);
            for (int i = 0; i < 2; ++i) {
                const F at = corners_of<F>(block, k, i ? ky : kx);
                most[i] = vmax(most[i], at - slope_of[i][packet] * z);
                least[i] = vmin(least[i], at - slope_of[2 + i][packet] * z);
            }
        }
        return bits((most[0] >= at_zero_of[0][packet]) & (most[1] >= at_zero_of[1][packet]) &
                    (least[0] <= at_zero_of[2][packet]) & (least[1] <= at_zero_of[3][packet]));
    }

    // Tests a packet against a leaf. Returns the lanes with a new hit; `any` idles them. Where triangles are small or
    // most rays miss, few rays pass the box, so it is tested first.
    template <bool any> unsigned visit_leaf(const Tree& tree, const Node& node, int slot, int packet) {
        const int child = node.child[slot], triangles = leaf_triangles(child);
        const Block* leaf = tree.blocks + leaf_block(child);
        const PacketRays& one = rays[packet];
        PacketHit& own = hit[packet];
        const bool box_first = any || tree.large;
        unsigned lanes = ALL;
        if (box_first && !(lanes = one.passing(node, slot, own.t))) return 0;
        if (__builtin_popcount(lanes) <= FEW) return meet_leaf_alone<any>(leaf, triangles, one, lanes, own);
        const unsigned near = triangles > BLOCK_WIDTH ? near_to<f8>(leaf, packet) : near_to<f4>(leaf, packet);
        const unsigned some = near & ((1u << triangles) - 1);
        if (!some || (!box_first && !(lanes = one.passing(node, slot, own.t)))) return 0;
        const int left = __builtin_popcount(lanes);
        return left <= FEW || left < __builtin_popcount(some) ? meet_leaf_alone<any>(leaf, triangles, one, lanes, own)
                                                              : meet_leaf<any>(leaf, some, one, lanes, own);
    }

  private:
    // Twice the width along both axes of a section half way between the planes.
    static float width_of(const f8& edge) {
        const f4 both = edge.lo + edge.hi;
        return -(both.x + both.y + both.z + both.w);
    }

    // A side as a line through its places on both planes.
    void line(const f8& edge, int side, float from, float share, float& zero, float& tilt) const {
        const float sign = side < 2 ? 1.0f : -1.0f;
        tilt = sign * (edge[4 + side] - edge[side]) * share;
        zero = sign * (edge[side] - slack) - tilt * from;
    }
};

// The traversal of a tree by a beam, nearest children first. With `any` hits idle their lanes.
template <bool any> class BeamWalk {
  public:
    BeamWalk(const Tree& tree, Beam& beam) : tree(tree), beam(beam), waiting(tree.large ? WAITING : 0u) {
        for (int i = 0; i < beam.count; ++i) {
            asked[i] = open[i] = bits(beam.hit[i].t >= 0.0f);
            if (open[i]) alive |= 1u << i;
        }
        for (int i = 0; i < BEAM; ++i)
            if (!(alive >> i & 1u)) beam.reach[i] = -FAR;
        reach = greatest(load<f16>(beam.reach));
    }

    // Lanes of a packet that found a hit.
    unsigned found(int packet) const { return asked[packet] & ~open[packet]; }

    void run() {
        Entry stack[STACK], leaves[2 * WAITING];
        int size = 0;
        unsigned taken = 0, put = 0;
        stack[size++] = {-FAR, 0, nullptr, 0};
        while (alive && (size || taken < put)) {
            if (size) {
                const Entry entry = stack[--size];
                if (entry.near > reach) continue;
                if (entry.child >= 0) {
                    size = push_children(tree.nodes[entry.child], stack, size);
                    if (taken == put) continue;
                } else {
                    leaves[put++ % (2 * WAITING)] = entry;
                    if (put - taken <= waiting) continue;
                }
            }
            visit(leaves[taken++ % (2 * WAITING)]);
        }
    }

  private:
    struct Entry {
        float near;
        int child;
        const Node* parent;
        int slot;
    };

    const Tree& tree;
    Beam& beam;
    const unsigned waiting;
    float reach;                       // greatest depth at which the beam may find a hit
    unsigned asked[BEAM], open[BEAM];  // lanes with a ray, and those of them without a hit
    unsigned alive = 0;                // packets that may find a hit

    int push_children(const Node& node, Entry* stack, int size) const {
        const int base = size;
        f8 near;
        for (unsigned met = beam.children_met(node, reach, near); met; met &= met - 1) {
            const int lane = first_bit(met);
            prefetch(tree, node.child[lane]);
            const float at = near[lane];
            int slot = size++;
            for (; !any && slot > base && stack[slot - 1].near < at; --slot) stack[slot] = stack[slot - 1];
            stack[slot] = {at, node.child[lane], &node, lane};
        }
        return size;
    }

    void visit(const Entry& leaf) {
        if (leaf.near > reach) return;
        bool nearer = false;
        for (unsigned met = beam.packets_met(*leaf.parent, leaf.slot) & alive; met; met &= met - 1) {
            const int packet = first_bit(met);
            const unsigned hits = beam.visit_leaf<any>(tree, *leaf.parent, leaf.slot, packet);
            if (!hits) continue;
            open[packet] &= ~hits;
            if (open[packet]) continue;  // its reach is that of a ray without a hit
            if (any)
                alive &= ~(1u << packet);
            else
                beam.reach[packet] = beam.end_of(packet), nearer = true;
        }
        if (nearer) reach = greatest(load<f16>(beam.reach));
    }
};

}  // namespace packets
