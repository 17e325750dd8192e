"""The greatest of many, without sorting: what selection, cache and tiling have in common.

Each ranks by a float64 and takes the ``k`` first. A float64 becomes an unsigned key of the same order, and the key of
the ``k``-th is found bit by bit from the top: passes that count, each a handful of vector instructions for the some
hundred values there are, until as many lie above as are wanted. All above it are taken, and of those equal to it as
many as are missing, in a stated order.

Addresses are passed as numbers: a launch then costs less, for no array has to be described.
"""

from __future__ import annotations

import warp as wp

from renderer.compute.launching import Address


@wp.func_native("""
    const double* v = (const double*)value;
    unsigned long long* k = (unsigned long long*)key;
    for (int i = 0; i < count; ++i) {
        const double plain = v[i] + 0.0;  // -0 counts as 0
        unsigned long long bits;
        memcpy(&bits, &plain, 8);
        // Negative numbers order by their bits the wrong way round, and belong below the positive ones.
        k[i] = bits ^ ((bits >> 63) ? ~0ull : 1ull << 63);
    }
""")
def rank_keys(value: Address, count: wp.int32, key: Address):
    """Unsigned keys that order as the float64 values do; no NaN among them."""
    ...


@wp.func_native("""
    const unsigned long long* k = (const unsigned long long*)key;
    if (count < wanted) return 0;
    unsigned long long all = ~0ull, any = 0;
    for (int i = 0; i < count; ++i) all &= k[i], any |= k[i];
    if (all == any) return all;
    const int top = 63 - __builtin_clzll(all ^ any);  // above it all keys are alike
    unsigned long long found = top == 63 ? 0 : all >> (top + 1) << (top + 1);
    for (int bit = top; bit >= 0; --bit) {
        const unsigned long long trial = found | (1ull << bit);
        long long at_least = 0;
        for (int i = 0; i < count; ++i) at_least += k[i] >= trial;
        if (at_least >= wanted) found = trial;
        if (at_least == wanted) break;
    }
    return found;
""")
def kth_greatest(key: Address, count: wp.int32, wanted: wp.int32) -> wp.uint64:
    """A bound that the ``wanted`` greatest keys reach, and of the others only those equal to the least of them: keys
    above the bound are all taken. 0 where there are not so many keys.
    """
    ...


@wp.func_native("""
    const unsigned long long* k = (const unsigned long long*)key;
    int above = 0;
    for (int i = 0; i < count; ++i) above += k[i] > threshold;
    return above;
""")
def count_above(key: Address, count: wp.int32, threshold: wp.uint64) -> wp.int32:
    """How many keys exceed the threshold."""
    ...
