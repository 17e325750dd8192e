// The greatest of many, without sorting: what selection, cache and tiling have in common.
#pragma once

namespace ranking {

typedef unsigned long long Key;

// Unsigned keys that order as the float64 values do; no NaN among them.
inline void rank_keys(const double* value, int count, Key* key) {
    for (int i = 0; i < count; ++i) {
        const double plain = value[i] + 0.0;  // -0 counts as 0
        const Key bits = __builtin_bit_cast(Key, plain);
        // Negative numbers order by their bits the wrong way round, and belong below the positive ones.
        key[i] = bits ^ ((bits >> 63) ? ~0ull : 1ull << 63);
    }
}

// A bound that the `wanted` greatest keys reach, and of the others only those equal to the least of them: keys above the
// bound are all taken. 0 where there are not so many keys.
inline Key kth_greatest(const Key* key, int count, int wanted) {
    if (count < wanted) return 0;
    Key all = ~0ull, any = 0;
    for (int i = 0; i < count; ++i) all &= key[i], any |= key[i];
    if (all == any) return all;
    const int top = 63 - __builtin_clzll(all ^ any);  // above it all keys are alike
    Key found = top == 63 ? 0 : all >> (top + 1) << (top + 1);
    for (int bit = top; bit >= 0; --bit) {
        const Key trial = found | (1ull << bit);
        long long at_least = 0;
        for (int i = 0; i < count; ++i) at_least += key[i] >= trial;
        if (at_least >= wanted) found = trial;
        if (at_least == wanted) break;
    }
    return found;
}

// How many values exceed a bound.
template <class V> inline int count_above(const V* value, int count, V bound) {
    int above = 0;
    for (int i = 0; i < count; ++i) above += value[i] > bound;
    return above;
}

// Whether a key is among those wanted: above the threshold, or one of the first `ties` at it, which it then uses up.
inline bool is_taken(Key key, Key threshold, int& ties) { return key > threshold || (key == threshold && ties-- > 0); }

}  // namespace ranking
