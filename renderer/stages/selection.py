"""Selection in C: the passes over the field and over the tiles. The recipe is in ``control_kernels.py``, the definition
in ``tsar/selection.py``."""

from __future__ import annotations

import warp as wp

from renderer.compute.launching import Address


@wp.struct
class SelectionPlan:
    """What of the configuration the selection depends on."""

    batch: wp.int32
    field_level: wp.int32
    samples: wp.int32
    centre: wp.uint64
    """Address of the offsets of a tile's samples, in tile widths."""


@wp.struct
class Due:
    """Addresses of a request's tensors."""

    selected: wp.uint64
    history: wp.uint64
    level: wp.uint64
    index: wp.uint64
    position: wp.uint64


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
    long long* chosen = (long long*)due.selected;
    double* now = (double*)due.history;
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
    due: Due,
):
    """Tiles above the threshold, and the ``ties`` first of those at it; a refresh is taken off their credit."""
    ...


@wp.func_native("""
    const long long *l = (const long long*)level, *at = (const long long*)index;
    const long long* chosen = (const long long*)due.selected;
    long long *due_level = (long long*)due.level, *due_index = (long long*)due.index;
    for (int row = 0; row < plan.batch; ++row) {
        due_level[row] = l[chosen[row]];
        due_index[row] = at[chosen[row]];
        framelets::place(due_level[row], due_index[row], plan.samples, (const float*)plan.centre,
                         (float*)due.position + 2ll * plan.samples * row);
    }
""")
def place_framelets(plan: SelectionPlan, level: Address, index: Address, due: Due):
    """The tiles of a batch, and the positions of its samples."""
    ...
