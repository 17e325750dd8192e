"""Tiling and the record's sums in C; definitions in ``tsar/tiling.py`` and ``tsar/accounting.py``.

Nodes of the quadtree lie one level after the other, coarse first: level ``L`` begins at ``(4^L - 1) / 3``.
"""

from __future__ import annotations

import warp as wp

from renderer.compute.launching import Address


@wp.func_native("return selection::all_densities((const double*)field, elements);")
def are_densities(elements: wp.int32, field: Address) -> wp.bool:
    """Whether no value of a field is negative, infinite or NaN."""
    ...


@wp.func_native("""
    double* node = (double*)sums;
    const double* below = (const double*)density;
    for (int level = field_level - 1; level >= level_low; --level) {
        double* here = node + ((1ll << (2 * level)) - 1) / 3;
        selection::sum_children(below, here, 1 << (2 * level));
        below = here;
    }
""")
def sum_nodes(field_level: wp.int32, level_low: wp.int32, density: Address, sums: Address):
    """Integrals over all nodes above the elements."""
    ...


@wp.func_native("""
    const double* v = (const double*)value;
    int above = 0;
    for (int i = 0; i < count; ++i) above += v[i] > bound;
    return above;
""")
def count_exceeding(value: Address, count: wp.int32, bound: wp.float64) -> wp.int32:
    """How many values exceed the bound."""
    ...


@wp.func_native("""
    const unsigned long long* k = (const unsigned long long*)key;
    const long long* rank = (const long long*)order;
    unsigned char* out = (unsigned char*)split;
    for (int i = 0; i < count; ++i) out[i] = k[i] > threshold;
    for (int i = 0; i < count && ties > 0; ++i)
        if (k[rank[i]] == threshold) { out[rank[i]] = 1; --ties; }
""")
def mark_splits(count: wp.int32, key: Address, order: Address, threshold: wp.uint64, ties: wp.int32, split: Address):
    """Nodes above the threshold, and the ``ties`` first of those at it in the order for equals."""
    ...


@wp.func_native("""
    const unsigned char* divided = (const unsigned char*)split;
    long long *l = (long long*)level, *at = (long long*)index;
    const int base = ((1 << (2 * level_low)) - 1) / 3;
    int tiles = 0;
    // Along the curve: from each place the coarsest node that begins there, one level down while it is split.
    for (long long place = 0; place < 1ll << (2 * level_high);) {
        const int up = place ? __builtin_ctzll(place) / 2 : level_high;
        int here = wp::max(level_low, level_high - up);
        long long node = place >> (2 * (level_high - here));
        while (here < level_high && divided[((1ll << (2 * here)) - 1) / 3 + node - base]) {
            ++here;
            node = place >> (2 * (level_high - here));
        }
        l[tiles] = here;
        at[tiles++] = node;
        place += 1ll << (2 * (level_high - here));
    }
    return tiles;
""")
def emit_tiles(level_low: wp.int32, level_high: wp.int32, split: Address, level: Address, index: Address) -> wp.int32:
    """The undivided nodes in Morton order. Returns how many."""
    ...


@wp.func_native("""
    const double *s = (const double*)spatial, *t = (const double*)temporal, *time_s = (const double*)newest_s;
    const int* part = (const int*)part_of_element;
    double lane[8] = {0, 0, 0, 0, 0, 0, 0, 0};  // eight sums side by side fill a vector; their order is fixed
    double oldest = INFINITY, newest = -INFINITY;
    for (int i = 0; i < elements; i += 8)
        for (int k = 0; k < 8; ++k) lane[k] += s[i + k] * t[i + k];
    const float *e_s = (const float*)error_spatial, *e_t = (const float*)error_temporal;
    int infinite = 0;  // x - x is 0 for finite numbers only
    for (int i = 0; i < elements; ++i)
        infinite += (s[i] - s[i] != 0.0) + (t[i] - t[i] != 0.0) + (e_s[i] - e_s[i] != 0.0f) + (e_t[i] - e_t[i] != 0.0f);
    for (int i = 0; i < elements; ++i) {
        if (t[i] < fast) continue;
        const double shown = time_s[part[i]];
        if (shown == -INFINITY) continue;
        oldest = wp::min(oldest, shown);
        newest = wp::max(newest, shown);
    }
    double* out = (double*)result;
    out[0] = ((lane[0] + lane[1]) + (lane[2] + lane[3])) + ((lane[4] + lane[5]) + (lane[6] + lane[7]));
    out[1] = newest >= oldest ? newest - oldest : 0.0;
    out[2] = infinite;
""")
def sum_account(
    elements: wp.int32,
    fast: wp.float64,
    spatial: Address,
    temporal: Address,
    error_spatial: Address,
    error_temporal: Address,
    newest_s: Address,
    part_of_element: Address,
    result: Address,
):
    """Combined density over the field, the spread of ages among elements of fast refresh, and how many values of the
    four fields are not finite."""
    ...
