// The quadtree: numbers of its nodes, level by level from the coarsest, and cells on the Morton curve.
#pragma once

namespace quadtree {

// Number of the nodes of all levels above `level`.
inline long long first_node(long long level) { return ((1ll << (2 * level)) - 1) / 3; }

// Bits 0, 2, 4 and so on as a number of at most 16 bits.
inline int every_second_bit(long long code) {
    unsigned bits = (unsigned)code & 0x55555555u;
    bits = (bits | bits >> 1) & 0x33333333u;
    bits = (bits | bits >> 2) & 0x0f0f0f0fu;
    bits = (bits | bits >> 4) & 0x00ff00ffu;
    return (int)((bits | bits >> 8) & 0x0000ffffu);
}

// The cell of a Morton index.
inline int column_of(long long index) { return every_second_bit(index); }
inline int row_of(long long index) { return every_second_bit(index >> 1); }

}  // namespace quadtree
