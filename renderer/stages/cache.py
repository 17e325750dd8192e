"""The bookkeeping of the cache in C: which slots a batch takes, and what was in them. Definition: ``tsar/cache.py``."""

from __future__ import annotations

import warp as wp

from renderer.compute.launching import Address
from renderer.stages.ranking import count_above, kth_greatest, rank_keys


@wp.struct
class CacheView:
    """Addresses of a framelet cache's tensors."""

    slots: wp.int32
    samples: wp.int32
    state: wp.int32
    level: wp.uint64
    index: wp.uint64
    time_s: wp.uint64
    dead: wp.uint64
    color: wp.uint64
    coefficients: wp.uint64
    slot_of_node: wp.uint64


@wp.struct
class ClaimMemory:
    """Addresses of what a batch got in the cache, and of working memory."""

    slot: wp.uint64
    """Where each framelet goes."""
    past: wp.uint64
    """Address of the wavelet state of each tile's last framelet, 0 where there is none."""
    spare: wp.uint64
    """Room for the wavelet states of a batch: those whose slots are taken are saved there."""
    marks: wp.uint64
    """uint8, one a slot, all 0 between calls."""


@wp.func_native("""
    const double* t = (const double*)cache.time_s;
    const unsigned char* gone = (const unsigned char*)cache.dead;
    double* v = (double*)age;
    int all_dead = 0;
    for (int i = 0; i < cache.slots; ++i) all_dead += gone[i] != 0;
    const bool among_dead = all_dead >= wanted;
    // What is not ranked is newer than everything.
    for (int i = 0; i < cache.slots; ++i) v[i] = (gone[i] != 0) == among_dead ? -t[i] : -INFINITY;
    return among_dead ? 0 : all_dead;
""")
def rank_slots(cache: CacheView, wanted: wp.int32, age: Address) -> wp.int32:
    """Ages to choose victims by: of the dead slots where they are enough, else of the live ones.

    Returns:
        How many dead slots go beside those chosen by age: all, or none.
    """
    ...


@wp.func_native("""
    const unsigned long long* k = (const unsigned long long*)key;
    const unsigned char* gone = (const unsigned char*)cache.dead;
    long long* out = (long long*)slot;
    for (int i = 0, found = 0; i < cache.slots; ++i) {
        const bool old = k[i] > threshold || (k[i] == threshold && ties-- > 0);
        if (old || (with_dead && gone[i])) out[found++] = i;
    }
""")
def list_victims(
    cache: CacheView, key: Address, threshold: wp.uint64, ties: wp.int32, with_dead: wp.int32, slot: Address
):
    """Slots to be overwritten, ascending."""
    ...


@wp.func_native("""
    const long long *slots = (const long long*)memory.slot, *l = (const long long*)level, *at = (const long long*)index;
    long long *cached_level = (long long*)cache.level, *cached_index = (long long*)cache.index;
    long long* newest = (long long*)cache.slot_of_node;
    const long long bytes = 4ll * cache.state;
    unsigned char* taken = (unsigned char*)memory.marks;
    for (int row = 0; row < count; ++row) taken[slots[row]] = 1;
    for (int row = 0; row < count; ++row) {
        const long long last = newest[((1ll << (2 * l[row])) - 1) / 3 + at[row]];
        char* state = last < 0 ? nullptr : (char*)cache.coefficients + bytes * last;
        if (state && taken[last]) {  // another framelet's state is about to be written there
            char* aside = (char*)memory.spare + bytes * row;
            memcpy(aside, state, bytes);
            state = aside;
        }
        ((char**)memory.past)[row] = state;
    }
    for (int row = 0; row < count; ++row) {
        taken[slots[row]] = 0;
        if (cached_level[slots[row]] < 0) continue;
        const long long node = ((1ll << (2 * cached_level[slots[row]])) - 1) / 3 + cached_index[slots[row]];
        if (newest[node] == slots[row]) newest[node] = -1;  // else a newer framelet of the tile has taken it
    }
    for (int row = 0; row < count; ++row) {
        cached_level[slots[row]] = l[row];
        cached_index[slots[row]] = at[row];
        ((double*)cache.time_s)[slots[row]] = ((const double*)time_s)[row];
        ((unsigned char*)cache.dead)[slots[row]] = 0;
        newest[((1ll << (2 * l[row])) - 1) / 3 + at[row]] = slots[row];
    }
""")
def sign_over(
    cache: CacheView,
    memory: ClaimMemory,
    count: wp.int32,
    level: Address,
    index: Address,
    time_s: Address,
):
    """Hands slots over to the tiles of a batch, and finds the wavelet state of each tile's last framelet."""
    ...


@wp.func
def choose_victims(cache: CacheView, age: Address, key: Address, count: wp.int32, slot: Address):
    """The slots that are worth least: dead ones, oldest first, then the oldest of the others."""
    all_dead = rank_slots(cache, count, age)
    rank_keys(age, cache.slots, key)
    by_age = count - all_dead
    threshold = kth_greatest(key, cache.slots, by_age)
    ties = by_age - count_above(key, cache.slots, threshold)
    list_victims(cache, key, threshold, ties, all_dead, slot)
