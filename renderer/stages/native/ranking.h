// The greatest of many values without sorting, for selection, cache and tiling.
#pragma once

namespace ranking {

typedef unsigned long long Key;

// Unsigned keys in the order of the float64 values, which must not be NaN.
inline void rank_keys(const double* value, int count, Key* key) {
    for (int i = 0; i < count; ++i) {
        const double plain = value[i] + 0.0;  // turns -0 into 0
        const Key bits = __builtin_bit_cast(Key, plain);
        // The bits of negative numbers are in reverse order, and belong below those of positive ones.
        key[i] = bits ^ ((bits >> 63) ? ~0ull : 1ull << 63);
    }
}

// A bound such that the `wanted` greatest keys are at least it, and other keys at most equal to it, so that all keys
// above it are taken. 0 if there are fewer keys.
inline Key kth_greatest(const Key* key, int count, int wanted) {
    if (count < wanted) return 0;
    Key all = ~0ull, any = 0;
    for (int i = 0; i < count; ++i) all &= key[i], any |= key[i];
    if (all == any) return all;
    const int top = 63 - __builtin_clzll(all ^ any);  // above it the bits of all keys are equal
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

// Number of values above a bound.
template <class V> inline int count_above(const V* value, int count, V bound) {
    int above = 0;
    for (int i = 0; i < count; ++i) above += value[i] > bound;
    return above;
}

// Whether a key is taken: it is above the threshold, or among the first `ties` at it, whose count is then reduced.
inline bool is_taken(Key key, Key threshold, int& ties) { return key > threshold || (key == threshold && ties-- > 0); }

}  // namespace ranking
