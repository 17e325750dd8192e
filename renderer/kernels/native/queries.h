// Queries of rays in a list on one mesh.
#pragma once
#include "structures.h"

namespace packets {

// Traces the rays `first` to `first + 15` of a list, or up to its end.
template <bool any, class Queries> inline void trace_packet(const Queries& list, int first) {
    const int blocks = list.blocks.shape[0] / (int)(sizeof(Block) / sizeof(float));
    const Tree tree(list.nodes.data, list.blocks.data, blocks * BLOCK_WIDTH);
    const int count = list.origin.shape[0], used = count - first < LANES ? count - first : LANES;
    Vec16 from, along;
    PacketHit hit;
    for (int lane = 0; lane < LANES; ++lane) {
        const int i = first + (lane < used ? lane : used - 1);
        const auto &origin = list.origin.data[i], &direction = list.direction.data[i];
        from.x[lane] = origin[0], from.y[lane] = origin[1], from.z[lane] = origin[2];
        along.x[lane] = direction[0], along.y[lane] = direction[1], along.z[lane] = direction[2];
        const float reach = list.reach.data[i];
        hit.t[lane] = lane < used && reach >= 0.0f ? reach : -1.0f;  // a ray with NaN is idle
    }
    hit.u = hit.v = 0.0f;
    hit.face = -1;
    const unsigned found = trace<any>(tree, from, along, hit);
    for (int lane = 0; lane < used; ++lane) {
        const int i = first + lane;
        const bool met = found >> lane & 1u;
        list.face.data[i] = any ? (int)met : met ? hit.face[lane] : -1;
        if (!any) list.t.data[i] = hit.t[lane], list.u.data[i] = hit.u[lane], list.v.data[i] = hit.v[lane];
    }
}

// Traces one ray of a list through the first mesh of a scene, and adds its counts to `work`.
template <class Scene, class Queries>
inline void trace_single(const Scene& scene, const Queries& list, int i, bool nearest, long long* work) {
    RayHit hit;
    const float reach = list.reach.data[i];
    const auto &origin = list.origin.data[i], &direction = list.direction.data[i];
    const bool found = nearest ? single_ray<false>(scene, 0, origin, direction, reach, work, hit)
                               : single_ray<true>(scene, 0, origin, direction, reach, work, hit);
    list.face.data[i] = nearest ? found ? hit.face : -1 : (int)found;
    if (nearest) list.t.data[i] = hit.t, list.u.data[i] = hit.u, list.v.data[i] = hit.v;
}

template <class Queries> inline void trace_queries(const Queries& list, int first, bool nearest) {
    nearest ? trace_packet<false>(list, first) : trace_packet<true>(list, first);
}

}  // namespace packets
