// Queries of rays in a list on one mesh.
#pragma once
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

// Traces the rays `first` to `first + 15` of a list, or up to its end.
template <bool any> inline void trace_packet(const Queries& list, int first) {
    const Tree tree(list.nodes, list.blocks, (int)list.triangles);
    const int left = (int)list.count - first, used = left < LANES ? left : LANES;
    const float *origin = list.origin + 3ll * first, *direction = list.direction + 3ll * first;
    float from[3 * LANES], along[3 * LANES];
    f16 reach = FAR;
    if (used == LANES) {
        if (list.reach) reach = load<f16>(list.reach + first);
    } else {  // the last ray fills the other lanes
        for (int lane = 0; lane < LANES; ++lane) {
            const int copied = lane < used ? lane : used - 1;
            __builtin_memcpy(from + 3 * lane, origin + 3 * copied, 3 * sizeof(float));
            __builtin_memcpy(along + 3 * lane, direction + 3 * copied, 3 * sizeof(float));
            if (list.reach) reach[lane] = list.reach[first + copied];
        }
        origin = from, direction = along;
    }
    PacketHit hit;
    const i16 asked = lanes_of(ALL >> (LANES - used)) & (reach >= 0.0f);  // a ray with NaN is idle
    hit.t = asked ? reach : (f16)-1.0f;
    hit.u = hit.v = 0.0f;
    hit.face = -1;
    const i16 met = lanes_of(trace<any>(tree, separated(origin), separated(direction), hit));
    put_first(list.face + first, any ? -met : met ? hit.face : (i16)-1, used);
    if (any) return;
    put_first(list.t + first, hit.t, used);
    put_first(list.u + first, hit.u, used), put_first(list.v + first, hit.v, used);
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
    for (int at = first; at < end; at += LANES) nearest ? trace_packet<false>(list, at) : trace_packet<true>(list, at);
}

}  // namespace packets
