"""Selection, batch, cache and tiling in C: the passes over the field and over the tiles. Their recipes are in
``control_kernels.py``, their definitions in ``tsar/selection.py``, ``tsar/cache.py`` and ``tsar/tiling.py``."""

from __future__ import annotations

import warp as wp

from renderer.launching import Address


@wp.func_native("""
    const long long *l = (const long long*)level, *at = (const long long*)index;
    const double *rate = (const double*)temporal, *past = (const double*)history;
    double *sum = (double*)overdue, *now = (double*)credit;
    double prefix = 0.0;
    for (int tile = 0; tile < tiles; ++tile) {
        const int shift = 2 * (field_level - (int)l[tile]);
        const long long first = at[tile] << shift, last = (at[tile] + 1) << shift;
        const double before = prefix;
        // One running sum over all tiles, as the reference has it: equal tiles then tie or differ as they do there.
        for (long long i = first; i < last; ++i) {
            now[i] = past[i] + rate[i];
            prefix += now[i];
        }
        sum[tile] = (prefix - before) / (double)(1ll << shift);
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
    """Credit of every element and its mean over every tile; the tiles cover the field in order."""
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
    const long long tile = ((const long long*)selected)[row];
    const long long l = ((const long long*)level)[tile], at = ((const long long*)index)[tile];
    ((long long*)level_out)[row] = l;
    ((long long*)index_out)[row] = at;
    long long x = 0, y = 0;
    for (int bit = 0; bit < l; ++bit) {
        x |= ((at >> (2 * bit)) & 1) << bit;
        y |= ((at >> (2 * bit + 1)) & 1) << bit;
    }
    const float width = 1.0f / (float)(1ll << l), left = (float)x, top = (float)y;
    const float* __restrict__ c = (const float*)centre;
    float* __restrict__ p = (float*)position + 2ll * samples * row;
    float* __restrict__ t = (float*)time_s + (long long)samples * row;
    for (int i = 0; i < samples; ++i) {
        p[2 * i] = (left + c[2 * i]) * width;
        p[2 * i + 1] = (top + c[2 * i + 1]) * width;
    }
    for (int i = 0; i < samples; ++i) t[i] = now_s;
""")
def place_samples(
    row: wp.int32,
    samples: wp.int32,
    now_s: wp.float32,
    centre: Address,
    level: Address,
    index: Address,
    selected: Address,
    level_out: Address,
    index_out: Address,
    position: Address,
    time_s: Address,
):
    """One framelet of a batch: its tile, the positions and the times of its samples."""
    ...


@wp.func_native("""
    const double* t = (const double*)time_s;
    const unsigned char* gone = (const unsigned char*)dead;
    double* v = (double*)age;
    int all_dead = 0;
    for (int i = 0; i < slots; ++i) all_dead += gone[i] != 0;
    const bool among_dead = all_dead >= wanted;
    // What is not ranked is newer than everything.
    for (int i = 0; i < slots; ++i) v[i] = (gone[i] != 0) == among_dead ? -t[i] : -INFINITY;
    return among_dead ? 0 : all_dead;
""")
def rank_slots(slots: wp.int32, wanted: wp.int32, time_s: Address, dead: Address, age: Address) -> wp.int32:
    """Ages to choose victims by: of the dead slots where they are enough, else of the live ones.

    Returns:
        How many dead slots go beside those chosen by age: all, or none.
    """
    ...


@wp.func_native("""
    const unsigned long long* k = (const unsigned long long*)key;
    const unsigned char* gone = (const unsigned char*)dead;
    long long* out = (long long*)slot;
    for (int i = 0, found = 0; i < slots; ++i) {
        const bool old = k[i] > threshold || (k[i] == threshold && ties-- > 0);
        if (old || (with_dead && gone[i])) out[found++] = i;
    }
""")
def list_victims(
    slots: wp.int32,
    key: Address,
    threshold: wp.uint64,
    ties: wp.int32,
    with_dead: wp.int32,
    dead: Address,
    slot: Address,
):
    """Slots to be overwritten, ascending."""
    ...


@wp.func_native("""
    const long long* out = (const long long*)slot;
    const long long *l = (const long long*)cached_level, *at = (const long long*)cached_index;
    long long* newest = (long long*)slot_of_node;
    for (int i = 0; i < count; ++i) {
        if (l[out[i]] < 0) continue;
        const long long node = ((1ll << (2 * l[out[i]])) - 1) / 3 + at[out[i]];
        if (newest[node] == out[i]) newest[node] = -1;  // else a newer framelet of the tile has taken it
    }
""")
def forget_slots(count: wp.int32, slot: Address, cached_level: Address, cached_index: Address, slot_of_node: Address):
    """Drops the look-up entries that still point at these slots."""
    ...


@wp.func_native("""
    const long long to = ((const long long*)slot)[row];
    const long long l = ((const long long*)level)[row], at = ((const long long*)index)[row];
    const long long color_bytes = 12ll * samples, state_bytes = 4ll * state;
    memcpy((char*)cached_color + color_bytes * to, (const char*)color + color_bytes * row, color_bytes);
    memcpy((char*)cached_state + state_bytes * to, (const char*)coefficients + state_bytes * row, state_bytes);
    ((long long*)cached_level)[to] = l;
    ((long long*)cached_index)[to] = at;
    ((double*)cached_time)[to] = (double)((const float*)time_s)[(long long)samples * row];
    ((unsigned char*)dead)[to] = 0;
    ((long long*)slot_of_node)[((1ll << (2 * l)) - 1) / 3 + at] = to;
""")
def store_framelet(
    row: wp.int32,
    samples: wp.int32,
    state: wp.int32,
    slot: Address,
    level: Address,
    index: Address,
    time_s: Address,
    color: Address,
    coefficients: Address,
    cached_level: Address,
    cached_index: Address,
    cached_time: Address,
    cached_color: Address,
    cached_state: Address,
    dead: Address,
    slot_of_node: Address,
):
    """Copies one framelet into its slot."""
    ...
