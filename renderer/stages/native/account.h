// Sums for the record of a cycle, as defined in `tsar/accounting.py`.
#pragma once

namespace account {

// Whether a value is not finite: x - x is 0 only for finite numbers.
template <class V> inline int is_infinite(V value) { return value - value != 0; }

// Combined density over the field, spread of ages in elements of fast refresh, and number of non-finite values of the
// four fields.
inline void sum(int elements, double fast, const double* spatial, const double* temporal, const float* error_spatial,
                const float* error_temporal, const double* newest_s, const int* part_of_element, double* result) {
    double lane[8] = {};  // eight partial sums fill a vector; their order is fixed
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
