// A tree of boxes with eight children per node, and its construction.
//
// Source: Wald, Benthin and Boulos 2008, "Getting Rid of Packets" (wide nodes); Wald 2007, "On fast Construction of
// SAH-based Bounding Volume Hierarchies" (binned splits).
#pragma once
#include "lanes.h"

namespace packets {

constexpr int LEAF = 8;  // maximum number of triangles of a leaf
constexpr int EMPTY_CHILD = -2147483647 - 1;
constexpr float NOTHING = __builtin_inff();  // an empty box reaches from here to its negative, so no ray hits it

// A leaf as a child of a node: its first block and its number of triangles, one to eight.
inline int leaf_child(int block, int triangles) { return ~(block * 8 + triangles - 1); }
inline int leaf_block(int child) { return ~child >> 3; }
inline int leaf_triangles(int child) { return (~child & 7) + 1; }

// Boxes of the eight children, lane by lane. A child is a node (>= 0), a leaf (< 0, see above) or EMPTY_CHILD, whose
// box is inverted.
struct Node {
    float lower[3][WIDTH];
    float upper[3][WIDTH];
    int child[WIDTH];
    int unused[WIDTH];  // padding to whole cache lines
};

// One to four triangles: corner by corner, axis by axis, lane by lane. Unused lanes have face -1 and no extent. Blocks
// are small, because the traversal of a mesh of a million triangles is limited by the caches.
struct Block {
    float corner[3][3][BLOCK_WIDTH];
    int face[BLOCK_WIDTH];
};

static_assert(sizeof(Node) == NODE_FLOATS * sizeof(float) && sizeof(Block) == BLOCK_FLOATS * sizeof(float));

struct Bounds {
    float lower[3], upper[3];
    void clear() {
        for (int axis = 0; axis < 3; ++axis) lower[axis] = NOTHING, upper[axis] = -NOTHING;
    }
    void add(const float* low, const float* high) {
        for (int axis = 0; axis < 3; ++axis) {
            lower[axis] = low[axis] < lower[axis] ? low[axis] : lower[axis];
            upper[axis] = high[axis] > upper[axis] ? high[axis] : upper[axis];
        }
    }
    float half_surface() const {
        float x = upper[0] - lower[0], y = upper[1] - lower[1], z = upper[2] - lower[2];
        return x * y + y * z + z * x;
    }
};

// A range of the sorted triangles.
struct Range {
    int first, end, depth;
    Bounds box;
    int count() const { return end - first; }
};

class TreeBuilder {
  public:
    TreeBuilder(const float* vertices, const int* faces, int count, Bounds* boxes, int* order, Node* nodes,
                Block* blocks)
        : vertices(vertices), faces(faces), count(count), boxes(boxes), order(order), nodes(nodes), blocks(blocks) {}

    // Builds the tree; node 0 is its root. Stores the numbers of nodes and blocks.
    void build(int* node_count, int* block_count) {
        Range whole;
        whole.first = 0, whole.end = count, whole.depth = 0;
        whole.box.clear();
        for (int i = 0; i < count; ++i) {
            boxes[i].clear();
            for (int corner = 0; corner < 3; ++corner) {
                const float* at = vertices + 3 * faces[3 * i + corner];
                boxes[i].add(at, at);
            }
            order[i] = i;
            whole.box.add(boxes[i].lower, boxes[i].upper);
        }
        used_nodes = 1, used_blocks = 0;
        fill(0, whole);
        *node_count = used_nodes, *block_count = used_blocks;
    }

  private:
    static constexpr int BINS = 16;
    // If a node has unused children, leaves with more triangles than this are split: a packet tests triangles one by
    // one.
    static constexpr int SMALL = 4;
    // Below this depth ranges are halved, so that the stack of a traversal cannot overflow for any mesh.
    static constexpr int DEPTH_OF_HALVES = 48;

    const float* vertices;
    const int* faces;
    int count;
    Bounds* boxes;
    int* order;
    Node* nodes;
    Block* blocks;
    int used_nodes, used_blocks;

    float center(int triangle, int axis) const { return boxes[triangle].lower[axis] + boxes[triangle].upper[axis]; }

    Bounds bounds_of(int first, int end) const {
        Bounds box;
        box.clear();
        for (int i = first; i < end; ++i) box.add(boxes[order[i]].lower, boxes[order[i]].upper);
        return box;
    }

    // Splits a range into at most eight, fills the node with them, and recurses into those too long for a leaf.
    void fill(int index, const Range& range) {
        Range runs[WIDTH];
        int run_count = 1;
        runs[0] = range;
        run_count = open_runs(runs, run_count, LEAF);
        run_count = open_runs(runs, run_count, SMALL);
        int first_node = used_nodes;
        for (int i = 0; i < run_count; ++i) used_nodes += runs[i].count() > LEAF;
        for (int i = 0, next = first_node; i < WIDTH; ++i) {
            Node& node = nodes[index];
            bool used = i < run_count;
            for (int axis = 0; axis < 3; ++axis) {
                node.lower[axis][i] = used ? runs[i].box.lower[axis] : NOTHING;
                node.upper[axis][i] = used ? runs[i].box.upper[axis] : -NOTHING;
            }
            node.child[i] = !used ? EMPTY_CHILD : runs[i].count() > LEAF ? next++ : leaf(runs[i]);
        }
        for (int i = 0, next = first_node; i < run_count; ++i)
            if (runs[i].count() > LEAF) fill(next++, runs[i]);
    }

    // Repeatedly splits the range of greatest surface area among those longer than `longest`, until there are eight.
    // Returns their number.
    int open_runs(Range* runs, int run_count, int longest) {
        while (run_count < WIDTH) {
            int best = -1;
            float greatest_surface = -1.0f;
            for (int i = 0; i < run_count; ++i) {
                float surface = runs[i].box.half_surface();
                if (runs[i].count() > longest && surface > greatest_surface) best = i, greatest_surface = surface;
            }
            if (best < 0) break;
            Range from = runs[best];
            split(from, runs[best], runs[run_count++]);
        }
        return run_count;
    }

    int leaf(const Range& run) {
        const int first_block = used_blocks;
        for (int first = 0; first < run.count(); first += BLOCK_WIDTH) {
            Block& block = blocks[used_blocks++];
            for (int lane = 0; lane < BLOCK_WIDTH; ++lane) {
                const int triangle = first + lane < run.count() ? order[run.first + first + lane] : -1;
                block.face[lane] = triangle;
                for (int corner = 0; corner < 3; ++corner)
                    for (int axis = 0; axis < 3; ++axis)
                        block.corner[corner][axis][lane] =
                            triangle < 0 ? 0.0f : vertices[3 * faces[3 * triangle + corner] + axis];
            }
        }
        return leaf_child(first_block, run.count());
    }

    struct Cut {
        float cost, origin, scale;
        int axis, bin;
    };

    // The bin of a centre; the same expression determines costs and sides.
    static int bin_of(float center, float origin, float scale) {
        int bin = (int)((center - origin) * scale);
        return bin < 0 ? 0 : bin >= BINS ? BINS - 1 : bin;
    }

    void try_axis(const Range& range, int axis, float low, float high, Cut& best) const {
        float scale = (float)BINS / (high - low);
        if (!(high > low) || !(scale < FAR)) return;
        Bounds bin[BINS];
        int filled[BINS] = {};
        for (int i = 0; i < BINS; ++i) bin[i].clear();
        for (int i = range.first; i < range.end; ++i) {
            int at = bin_of(center(order[i], axis), low, scale);
            ++filled[at];
            bin[at].add(boxes[order[i]].lower, boxes[order[i]].upper);
        }
        float right_cost[BINS];
        Bounds box;
        box.clear();
        for (int i = BINS - 1, sum = 0; i > 0; --i) {
            box.add(bin[i].lower, bin[i].upper), sum += filled[i];
            right_cost[i] = sum ? box.half_surface() * (float)sum : -1.0f;
        }
        box.clear();
        for (int i = 0, sum = 0; i < BINS - 1; ++i) {
            box.add(bin[i].lower, bin[i].upper), sum += filled[i];
            if (!sum || right_cost[i + 1] < 0.0f) continue;
            float cost = box.half_surface() * (float)sum + right_cost[i + 1];
            if (cost < best.cost) best = {cost, low, scale, axis, i + 1};
        }
    }

    void split(const Range& from, Range& left, Range& right) {
        Bounds centers;
        centers.clear();
        for (int i = from.first; i < from.end; ++i) {
            float at[3] = {center(order[i], 0), center(order[i], 1), center(order[i], 2)};
            centers.add(at, at);
        }
        Cut best = {FAR, 0.0f, 0.0f, -1, 0};
        if (from.depth < DEPTH_OF_HALVES)
            for (int axis = 0; axis < 3; ++axis) try_axis(from, axis, centers.lower[axis], centers.upper[axis], best);
        int middle = from.first + from.count() / 2;
        if (best.axis >= 0) {
            int low = from.first, high = from.end - 1;
            while (low <= high) {
                if (bin_of(center(order[low], best.axis), best.origin, best.scale) < best.bin) {
                    ++low;
                } else {
                    int swapped = order[low];
                    order[low] = order[high], order[high--] = swapped;
                }
            }
            middle = low;
        }
        int depth = from.depth + 1, first = from.first, end = from.end;
        left = {first, middle, depth, bounds_of(first, middle)};
        right = {middle, end, depth, bounds_of(middle, end)};
    }
};

template <class Vertices, class Faces, class Floats, class Ints>
inline void build_tree(const Vertices& vertices, const Faces& faces, const Floats& boxes, const Ints& order,
                       const Floats& nodes, const Floats& blocks, const Ints& counts) {
    TreeBuilder builder((const float*)vertices.data, (const int*)faces.data, faces.shape[0], (Bounds*)boxes.data,
                        order.data, (Node*)nodes.data, (Block*)blocks.data);
    builder.build(counts.data, counts.data + 1);
}

}  // namespace packets
