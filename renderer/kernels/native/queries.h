// Queries of rays in a list on one mesh.
#pragma once
#include "beam.h"
#include "structures.h"

namespace packets {

// Rays of a list through one mesh, and arrays for their hits. `reach` is null if the rays have no end. A hit's face is -1
// for a miss, or a flag where any hit suffices; then only faces are stored.
struct Queries {
    const Node* nodes;
    const Block* blocks;
    long long triangles, count;
    const float *origin, *direction, *reach;
    int* face;
    float *t, *u, *v;
};

// Sixteen rays of a list from `first` on, or up to its end: then its last ray fills the other lanes.
struct Listed {
    Vec16 origin, direction;
    PacketHit hit;
    int used;

    Listed(const Queries& list, int first) {
        const int left = (int)list.count - first;
        used = left < LANES ? left : LANES;
        const float *from = list.origin + 3ll * first, *along = list.direction + 3ll * first;
        float copied_from[3 * LANES], copied_along[3 * LANES];
        f16 reach = FAR;
        if (used == LANES) {
            if (list.reach) reach = load<f16>(list.reach + first);
        } else {
            for (int lane = 0; lane < LANES; ++lane) {
                const int copied = lane < used ? lane : used - 1;
                __builtin_memcpy(copied_from + 3 * lane, from + 3 * copied, 3 * sizeof(float));
                __builtin_memcpy(copied_along + 3 * lane, along + 3 * copied, 3 * sizeof(float));
                if (list.reach) reach[lane] = list.reach[first + copied];
            }
            from = copied_from, along = copied_along;
        }
        origin = separated(from), direction = separated(along);
        const i16 asked = lanes_of(ALL >> (LANES - used)) & (reach >= 0.0f);  // a ray with NaN is idle
        hit.t = asked ? reach : (f16)-1.0f;
        hit.u = hit.v = 0.0f;
        hit.face = -1;
    }
};

// Stores the hits of rays from `first` on; `found` are the lanes with one.
template <bool any> inline void put_hits(const Queries& list, int first, unsigned found, const PacketHit& hit) {
    const int left = (int)list.count - first, used = left < LANES ? left : LANES;
    const i16 met = lanes_of(found);
    put_first(list.face + first, any ? -met : met ? hit.face : (i16)-1, used);
    if (any) return;
    put_first(list.t + first, hit.t, used);
    put_first(list.u + first, hit.u, used), put_first(list.v + first, hit.v, used);
}

// Prefetches the rays of a packet of a later beam, and the places for the hits of the packet from `first` on.
template <bool any> inline void prefetch(const Queries& list, int first) {
    const long long later = 3ll * (first + BEAM * LANES);
    for (int line = 0; line < 3; ++line) {
        __builtin_prefetch(list.origin + later + LANES * line);
        __builtin_prefetch(list.direction + later + LANES * line);
    }
    __builtin_prefetch(list.face + first, 1);
    if (any) return;
    __builtin_prefetch(list.t + first, 1);
    __builtin_prefetch(list.u + first, 1), __builtin_prefetch(list.v + first, 1);
}

// Traces the rays from `first` up to `end`: consecutive packets as a beam where they form one, others alone.
//
// Shadow rays through a large tree are always traced by packets: most of their work is at leaves smaller than the gaps
// between rays, which the box of a beam's packet does not miss.
template <bool any> inline void trace_list(const Queries& list, int first, int end) {
    const Tree tree(list.nodes, list.blocks, (int)list.triangles);
    Beam beam;
    // Rays that form no beams are not collected for many.
    int most = any && tree.large ? 0 : BEAM, next = first;
    for (int at = first; at < end;) {
        if (!beam.held) next = at;
        for (; next < end && beam.held < most; next += LANES) {
            const Listed rays(list, next);
            prefetch<any>(list, next);
            if (!beam.add(rays.origin, rays.direction, rays.hit)) break;
        }
        beam.count = 0;
        if (beam.held > 1) beam.bound(tree);
        if (beam.count > 1) {
            BeamWalk<any> walk(tree, beam);
            walk.run();
            for (int i = 0; i < beam.count; ++i, at += LANES) put_hits<any>(list, at, walk.found(i), beam.hit[i]);
            beam.drop(beam.count);
            most = BEAM;
        } else {
            Listed rays(list, at);
            put_hits<any>(list, at, trace<any>(tree, rays.origin, rays.direction, rays.hit), rays.hit);
            at += LANES;
            if (beam.held) beam.drop(1);
            most = most ? 2 : 0;
        }
    }
}

// Traces one ray of a list through the first mesh of a scene, and adds its counts to `work`.
template <class Scene, class List>
inline void trace_single(const Scene& scene, const List& list, int i, bool nearest, long long* work) {
    RayHit hit;
    const float reach = list.reach.data[i];
    const auto &origin = list.origin.data[i], &direction = list.direction.data[i];
    const bool found = nearest ? single_ray<false>(scene, 0, origin, direction, reach, work, hit)
                               : single_ray<true>(scene, 0, origin, direction, reach, work, hit);
    list.face.data[i] = nearest ? found ? hit.face : -1 : (int)found;
    if (nearest) list.t.data[i] = hit.t, list.u.data[i] = hit.u, list.v.data[i] = hit.v;
}

// Traces the rays from `first` up to `end`.
inline void trace_queries(const Queries& list, int first, int end, bool nearest) {
    nearest ? trace_list<false>(list, first, end) : trace_list<true>(list, first, end);
}

}  // namespace packets
