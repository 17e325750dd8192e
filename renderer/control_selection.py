"""Selection in C: the passes over the field and over the tiles. The recipe is in ``control_kernels.py``, the definition
in ``tsar/selection.py``."""

from __future__ import annotations

import warp as wp

from renderer.launching import Address


@wp.func_native("""
    const long long *l = (const long long*)level, *at = (const long long*)index;
    for (int tile = 0; tile < tiles; ++tile) {
        const int shift = 2 * (field_level - (int)l[tile]);
        const long long first = at[tile] << shift;
        ((double*)overdue)[tile] = selection::gather_tile(1 << shift, (const double*)history + first,
                                                          (const double*)temporal + first, (double*)credit + first);
    }
""")
def gather_credit(
    tiles: wp.int32,
    field_level: wp.int32,
    level: Address,
    index: Address,
    temporal: Address,
    history: Address,
    overdue: Address,
    credit: Address,
):
    """Credit of every element, and its mean over every tile."""
    ...


@wp.func_native("""
    const long long *l = (const long long*)level, *at = (const long long*)index;
    const unsigned long long* k = (const unsigned long long*)key;
    const double* mean = (const double*)overdue;
    long long* chosen = (long long*)selected;
    double* now = (double*)credit;
    for (int tile = 0, out = 0; tile < tiles; ++tile) {
        if (k[tile] < threshold || (k[tile] == threshold && ties-- <= 0)) continue;
        chosen[out++] = tile;
        const double left = wp::min(wp::max(mean[tile] - 1.0, -1.0), 1.0);
        const int shift = 2 * (field_level - (int)l[tile]);
        for (long long i = at[tile] << shift; i < (at[tile] + 1) << shift; ++i) now[i] = left;
    }
""")
def refresh_due(
    tiles: wp.int32,
    field_level: wp.int32,
    level: Address,
    index: Address,
    overdue: Address,
    key: Address,
    threshold: wp.uint64,
    ties: wp.int32,
    selected: Address,
    credit: Address,
):
    """Tiles above the threshold, and the ``ties`` first of those at it; a refresh is taken off their credit."""
    ...


@wp.func_native("""
    const long long *chosen = (const long long*)selected, *l = (const long long*)level, *at = (const long long*)index;
    long long *batch_level = (long long*)level_out, *batch_index = (long long*)index_out;
    for (int row = 0; row < count; ++row) {
        batch_level[row] = l[chosen[row]];
        batch_index[row] = at[chosen[row]];
        framelets::place(batch_level[row], batch_index[row], samples, (const float*)centre,
                         (float*)position + 2ll * samples * row);
    }
""")
def place_framelets(
    count: wp.int32,
    samples: wp.int32,
    centre: Address,
    level: Address,
    index: Address,
    selected: Address,
    level_out: Address,
    index_out: Address,
    position: Address,
):
    """The tiles of a batch, and the positions of its samples."""
    ...
