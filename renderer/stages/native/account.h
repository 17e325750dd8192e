// Sums for the record of a cycle; definition in `tsar/accounting.py`.
#pragma once

namespace account {

// Values that are not finite: x - x is 0 for finite numbers only.
template <class V> inline int is_infinite(V value) { return value - value != 0; }

// Combined density over the field, the spread of ages among elements of fast refresh, and how many values of the four
// fields are not finite.
inline void sum(int elements, double fast, const double* spatial, const double* temporal, const float* error_spatial,
                const float* error_temporal, const double* newest_s, const int* part_of_element, double* result) {
    double lane[8] = {};  // eight sums side by side fill a vector; their order is fixed
    double oldest = __builtin_inf(), newest = -__builtin_inf();
    for (int i = 0; i < elements; i += 8)
        for (int k = 0; k < 8; ++k) lane[k] += spatial[i + k] * temporal[i + k];
    int infinite = 0;
    for (int i = 0; i < elements; ++i)
        infinite += is_infinite(spatial[i]) + is_infinite(temporal[i]) + is_infinite(error_spatial[i]) +
                    is_infinite(error_temporal[i]);
    for (int i = 0; i < elements; ++i) {
        if (temporal[i] < fast) continue;
        const double shown = newest_s[part_of_element[i]];
        if (shown == -__builtin_inf()) continue;
        oldest = wp::min(oldest, shown);
        newest = wp::max(newest, shown);
    }
    result[0] = ((lane[0] + lane[1]) + (lane[2] + lane[3])) + ((lane[4] + lane[5]) + (lane[6] + lane[7]));
    result[1] = newest >= oldest ? newest - oldest : 0.0;
    result[2] = infinite;
}

}  // namespace account
