// The bookkeeping of the cache: slots that a batch takes, and the states that they held. Definition: `tsar/cache.py`.
#pragma once
#include "quadtree.h"
#include "ranking.h"

namespace claims {

using quadtree::first_node;

// Ages by which slots are chosen for replacement: those of the dead slots if they suffice, else of the live ones.
// Returns the number of dead slots that are replaced in addition to those chosen by age: all, or none.
template <class Cache> inline int rank_slots(const Cache& cache, int wanted, double* age) {
    const double* time_s = (const double*)cache.time_s;
    const unsigned char* dead = (const unsigned char*)cache.dead;
    int all_dead = 0;
    for (int i = 0; i < cache.slots; ++i) all_dead += dead[i] != 0;
    const bool among_dead = all_dead >= wanted;
    // Slots that are not ranked count as the newest.
    for (int i = 0; i < cache.slots; ++i) age[i] = (dead[i] != 0) == among_dead ? -time_s[i] : -__builtin_inf();
    return among_dead ? 0 : all_dead;
}

// Lists the slots to overwrite, in ascending order.
template <class Cache>
inline void list_victims(const Cache& cache, const ranking::Key* key, ranking::Key threshold, int ties, bool with_dead,
                         long long* slot) {
    const unsigned char* dead = (const unsigned char*)cache.dead;
    for (int i = 0, found = 0; i < cache.slots; ++i) {
        const bool old = ranking::is_taken(key[i], threshold, ties);
        if (old || (with_dead && dead[i])) slot[found++] = i;
    }
}

// Assigns slots to the tiles of a batch, and finds the wavelet state of each tile's last framelet.
template <class Cache, class Memory>
inline void sign_over(const Cache& cache, const Memory& memory, int count, const long long* level,
                      const long long* index, const double* time_s) {
    const long long* slots = (const long long*)memory.slot;
    long long *cached_level = (long long*)cache.level, *cached_index = (long long*)cache.index;
    long long* newest = (long long*)cache.slot_of_node;
    const long long bytes = 4ll * cache.state;
    unsigned char* taken = (unsigned char*)memory.marks;
    for (int row = 0; row < count; ++row) taken[slots[row]] = 1;
    for (int row = 0; row < count; ++row) {
        const long long last = newest[first_node(level[row]) + index[row]];
        char* state = last < 0 ? nullptr : (char*)cache.coefficients + bytes * last;
        if (state && taken[last]) {  // another framelet's state is about to be written there
            char* aside = (char*)memory.spare + bytes * row;
            __builtin_memcpy(aside, state, bytes);
            state = aside;
        }
        ((char**)memory.past)[row] = state;
    }
    for (int row = 0; row < count; ++row) {
        taken[slots[row]] = 0;
        if (cached_level[slots[row]] < 0) continue;
        const long long node = first_node(cached_level[slots[row]]) + cached_index[slots[row]];
        if (newest[node] == slots[row]) newest[node] = -1;  // else a newer framelet of the tile has replaced it
    }
    for (int row = 0; row < count; ++row) {
        cached_level[slots[row]] = level[row];
        cached_index[slots[row]] = index[row];
        ((double*)cache.time_s)[slots[row]] = time_s[row];
        ((unsigned char*)cache.dead)[slots[row]] = 0;
        newest[first_node(level[row]) + index[row]] = slots[row];
    }
}

}  // namespace claims
