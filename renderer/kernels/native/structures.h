// One ray through a mesh by a choice of structures, with counts of the work: for incoherent rays, and to compare
// structures. All hold blocks of the same triangles and test them by the same operations, so all find the same hits.
//
// A visit is a node whose boxes or plane are tested; a test is a triangle of a block. With eight boxes per node and
// four triangles per block, a visit or a test costs less here than a single one would.
#pragma once
#include "rays.h"

namespace packets {

struct Counted {
    long long visits = 0, tests = 0;
    void visit() { ++visits; }
    void test(int triangles) { tests += triangles; }
};

// A node of a kd-tree: a plane and its two children, or the blocks of a leaf.
struct KdNode {
    float split;
    int axis;   // or `KD_LEAF`
    int first;  // lower child, which the upper one follows; or first block of a leaf
    int count;  // number of triangles of a leaf
};

static_assert(sizeof(KdNode) == KD_FLOATS * sizeof(float));

struct KdTree {
    const KdNode* nodes;
    const Block* blocks;
};

// Visits the sides of each plane in the order in which the ray meets them. A plane is as thick as the padding: within
// it both sides are visited, as boxes of a BVH overlap by the same amount.
template <bool any, class Count> inline bool walk(const KdTree& tree, const Single& ray, RayHit& hit, Count& count) {
    struct Entry {
        int node;
        float near, far;
    } stack[KD_DEPTH_MAX];
    const Vec<f4> from = {(f4)ray.origin[ray.kx], (f4)ray.origin[ray.ky], (f4)ray.origin[ray.kz]};
    const Vec<f4> shear = {(f4)ray.shear[0], (f4)ray.shear[1], (f4)ray.shear[2]};
    Entry at = {0, 0.0f, hit.t};
    int size = 0;
    bool found = false;
    while (true) {
        const KdNode& node = tree.nodes[at.node];
        count.visit();
        if (node.axis != KD_LEAF) {
            const int axis = node.axis;
            // Distances at which the ray enters and leaves the thick plane. A ray along the plane may have either sign.
            const float a = (node.split - ray.near_origin[axis]) * ray.inverse[axis];
            const float b = (node.split - ray.far_origin[axis]) * ray.inverse[axis];
            const float enter = a < b ? a : b, leave = a < b ? b : a;
            const bool upwards = ray.inverse[axis] > 0.0f;
            const int near_side = upwards ? node.first : node.first + 1,
                      far_side = upwards ? node.first + 1 : node.first;
            if (at.near * (1.0f / ROUNDING_UP) > leave) {
                at.node = far_side;
            } else if (enter > at.far * ROUNDING_UP) {
                at.node = near_side;
            } else {
                stack[size++] = {far_side, enter > at.near ? enter : at.near, at.far};
                at.node = near_side, at.far = leave < at.far ? leave : at.far;
            }
            continue;
        }
        if (node.count) {
            count.test(node.count);
            found |= meet_leaf(tree.blocks + node.first, node.count, from, shear, ray.kx, ray.ky, ray.kz, hit);
            if (any && found) return true;
        }
        do {
            if (!size) return found;
            at = stack[--size];
        } while (at.near > hit.t * ROUNDING_UP);
    }
}

// Tests every triangle.
template <class Count>
inline bool meet_all(const Block* blocks, int triangles, const Single& ray, RayHit& hit, Count& count) {
    const Vec<f4> from = {(f4)ray.origin[ray.kx], (f4)ray.origin[ray.ky], (f4)ray.origin[ray.kz]};
    const Vec<f4> shear = {(f4)ray.shear[0], (f4)ray.shear[1], (f4)ray.shear[2]};
    count.test(triangles);
    return meet_leaf(blocks, triangles, from, shear, ray.kx, ray.ky, ray.kz, hit);
}

template <bool any, class Scene, class Record, class Count>
inline bool meet_mesh(const Scene& scene, const Record& mesh, const Single& ray, RayHit& hit, Count& count) {
    const Block* blocks = (const Block*)scene.tree_blocks.data + mesh.first_block;
    if (scene.structure == STRUCTURE_BVH) {
        const Tree tree((const Node*)scene.tree_nodes.data + mesh.first_node, blocks, mesh.face_count);
        return walk<any>(tree, ray, hit, count);
    }
    if (scene.structure == STRUCTURE_KDTREE) {
        const KdTree tree = {(const KdNode*)scene.kd_nodes.data + mesh.first_node, blocks};
        return walk<any>(tree, ray, hit, count);
    }
    return meet_all(blocks, mesh.face_count, ray, hit, count);
}

// Traces a ray up to `reach` through a mesh in its unit space. Stores distance, weights of the first two corners and
// face; the face is -1 for a miss. The numbers of visits and tests are added to `totals`, unless it is null.
template <bool any, class Scene, class V>
inline bool single_ray(const Scene& scene, int mesh, const V& start, const V& towards, float reach, long long* totals,
                       RayHit& hit) {
    const float from[3] = {start[0], start[1], start[2]}, along[3] = {towards[0], towards[1], towards[2]};
    const Single ray(from, along);
    const auto& record = scene.meshes.data[mesh];
    hit = {reach, 0.0f, 0.0f, -1};
    if (!totals) {
        Uncounted none;
        return meet_mesh<any>(scene, record, ray, hit, none);
    }
    Counted counted;
    const bool found = meet_mesh<any>(scene, record, ray, hit, counted);
    __atomic_fetch_add(totals, counted.visits, __ATOMIC_RELAXED);
    __atomic_fetch_add(totals + 1, counted.tests, __ATOMIC_RELAXED);
    return found;
}

// The same for Python: distance (negative for a miss), weights of the first two corners, and the bits of the face.
template <bool any, class Scene>
inline wp::vec4 meet_mesh_alone(const Scene& scene, int mesh, const wp::vec3& start, const wp::vec3& towards,
                                float reach, long long* totals) {
    RayHit hit;
    const bool found = single_ray<any>(scene, mesh, start, towards, reach, totals, hit);
    return wp::vec4(found ? hit.t : -1.0f, hit.u, hit.v, __builtin_bit_cast(float, hit.face));
}

}  // namespace packets
