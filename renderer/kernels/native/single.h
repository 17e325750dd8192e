// One ray against one mesh, one node of eight boxes at a time.
#pragma once
#include "triangles.h"

namespace packets {

constexpr int STACK = 640;
// A tree of more triangles, at about 100 bytes each, exceeds most second-level caches.
constexpr int LARGE = 40000;

struct Tree {
    const Node* nodes;
    const Block* blocks;
    bool large;  // larger than a second-level cache

    Tree(const void* first_node, const void* first_block, int triangles)
        : nodes((const Node*)first_node), blocks((const Block*)first_block), large(triangles > LARGE) {}
};

// One ray with the constants of its traversal.
struct Single {
    float origin[3], inverse[3];
    float inverse_far[3];                 // for the sides at which the ray leaves, rounded up
    float near_origin[3], far_origin[3];  // moved by the padding, outwards
    float shear[3];
    int kx, ky, kz;
    int near_side[3], far_side[3];  // offsets in a node of the sides that the ray enters and leaves

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
            near_side[axis] = (backwards ? 3 + axis : axis) * WIDTH,
            far_side[axis] = (backwards ? axis : 3 + axis) * WIDTH;
        }
    }
};

struct RayHit {
    float t, u, v;
    int face;
};

// Prefetches a child that is visited later.
inline void prefetch(const Tree& tree, int child) {
    const bool inner = child >= 0;
    const char* at = inner ? (const char*)(tree.nodes + child) : (const char*)(tree.blocks + leaf_block(child));
    const int lines = inner ? 4 : leaf_triangles(child) <= BLOCK_WIDTH ? 3 : 6;
    for (int line = 0; line < lines; ++line) __builtin_prefetch(at + 64 * line);
}

// Tests one ray against one or two blocks at once. Keeps the nearest hit, and of equally near ones the face with the
// lower number. Returns whether there is a new hit.
template <class F>
inline bool meet_blocks(const Block* block, const Vec<f4>& from, const Vec<f4>& along, int kx, int ky, int kz,
                        RayHit& hit) {
    const Vec<F> origin = {(F)from.x[0], (F)from.y[0], (F)from.z[0]},
                 shear = {(F)along.x[0], (F)along.y[0], (F)along.z[0]};
    Vec<F> corner[3];
    for (int i = 0; i < 3; ++i)
        corner[i] =
            Vec<F>{corners_of<F>(block, i, kx), corners_of<F>(block, i, ky), corners_of<F>(block, i, kz)} - origin;
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

// Tests one ray against a leaf, or any number of consecutive triangles.
inline bool meet_leaf(const Block* block, int triangles, const Vec<f4>& origin, const Vec<f4>& shear, int kx, int ky,
                      int kz, RayHit& hit) {
    bool found = false;
    for (; triangles > BLOCK_WIDTH; triangles -= 2 * BLOCK_WIDTH, block += 2)
        found |= meet_blocks<f8>(block, origin, shear, kx, ky, kz, hit);
    if (triangles > 0) found |= meet_blocks<f4>(block, origin, shear, kx, ky, kz, hit);
    return found;
}

// Counts nothing; structures.h has the counterpart that does.
struct Uncounted {
    void visit() {}
    void test(int) {}
};

// State of a ray's traversal of a tree.
struct Way {
    RayHit hit;  // `t` is the current reach
    float reach;
    int size, current;  // size of the stack; next node or leaf
    bool found;

    explicit Way(const RayHit& none) : hit(none), reach(none.t * ROUNDING_UP), size(0), current(0), found(false) {}
    Way() = default;
};
struct Entry {
    float near;
    int child;
};

// Visits one node or leaf. `any` ends at the first hit. Returns whether the traversal continues.
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
            // The nearest child is next; the others follow in any order.
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

// Traverses the tree by one ray from the root.
template <bool any, class Count> inline bool walk(const Tree& tree, const Single& ray, RayHit& hit, Count& count) {
    Entry stack[STACK];
    Way way(hit);
    while (step<any>(tree, ray, stack, way, count)) {}
    hit = way.hit;
    return way.found;
}

}  // namespace packets
