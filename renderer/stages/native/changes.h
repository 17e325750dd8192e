// The rate of change of elements from residuals, with the same bits as tsar/filtering/change.py.
#pragma once
#include "taking.h"

#pragma clang fp contract(off)

namespace batches {

constexpr int EDGE = given::ELEMENT_PX, ELEMENTS_MAX = 4096;

// Change of the elements, before and after the batch.
struct Change {
    const float *excess, *span_s;
    const double* seen_s;
    float *new_excess, *new_span_s;
    double* new_seen_s;
    float *rate, *own;
};

// Sums over the samples of a pixel, and its roughness before.
struct Pixel {
    double time_s;
    int at, newest;
    float count, color[3], least, most, roughness;
};
static_assert(sizeof(Pixel) <= 8 * given::PIXEL_WORDS);

struct Moment {
    double now_s, memory_s, rate_max;
    long long reprojected, accumulates, spreads;
};

inline float clipped(float value) { return value < 0.0f ? 0.0f : value > 1.0f ? 1.0f : value; }
inline float encoded(float value) { return __builtin_sqrtf(clipped(value)); }
inline float larger(float a, float b) { return a > b ? a : b; }
inline float smaller(float a, float b) { return a < b ? a : b; }

// Updates an element that contains pixels with samples.
inline void observe_element(int side, int element, const Moment& moment, const int* slot, const Pixel* pixel,
                            const surfels::Planes& planes, const Change& change) {
    const int elements = side / EDGE, count = side * side;
    const int first = element / elements * EDGE * side + element % elements * EDGE;
    float excess = 0.0f, usual = 0.0f, span_s = 0.0f;
    bool looked = false;
    for (int k = 0; k < EDGE * EDGE; ++k) {
        const int at = first + k / EDGE * side + k % EDGE, number = slot[at];
        if (number < 0 || !(planes.time_s[at] > -surfels::INF)) continue;
        const Pixel& p = pixel[number];
        float square[3];
        for (int c = 0; c < 3; ++c) {
            const float off = encoded(p.color[c]) - encoded(planes.color[c * count + at]);
            square[c] = off * off;
        }
        const float residual = ((square[0] + square[1]) + square[2]) / 3.0f, g = planes.roughness[at];
        const float expected = given::TOLERANCE * (0.5f * g * planes.inverse[at] + given::BETWEEN * g / p.count);
        excess += residual - expected, usual += expected, span_s += (float)(p.time_s - planes.time_s[at]);
        looked = true;
    }
    if (!looked) return;
    double since = moment.now_s - change.seen_s[element];
    since = since < 0.0 ? 0.0 : since > given::GAP_MOST_S ? given::GAP_MOST_S : since;
    const float gap = (float)since / (float)moment.memory_s;
    float fade = 1.0f / (1.0f + gap + 0.5f * gap * gap);
    if (excess > given::SURE * usual) fade = smaller(fade, given::DROPPED);
    change.new_excess[element] = fade * change.excess[element] + excess;
    change.new_span_s[element] = fade * change.span_s[element] + span_s;
    change.new_seen_s[element] = moment.now_s;
}

// Updates the elements of some rows of pixels; `hit` are the pixels with samples.
inline void observe_rows(int side, const Moment& moment, const int* slot, const Pixel* pixel, const Pixel* hit,
                         long long hits, const surfels::Planes& planes, const Change& change, long long first_row,
                         long long last_row) {
    const long long elements = side / EDGE, first = first_row / EDGE * elements, last = last_row / EDGE * elements;
    for (long long i = first; i < last; ++i) {
        change.new_excess[i] = change.excess[i], change.new_span_s[i] = change.span_s[i];
        change.new_seen_s[i] = change.seen_s[i];
        change.rate[i] = 0.0f;  // 1 in elements that have been updated
    }
    for (long long i = 0; i < hits; ++i) {
        const int element = hit[i].at / side / EDGE * (int)elements + hit[i].at % side / EDGE;
        if (change.rate[element] > 0.0f) continue;
        change.rate[element] = 1.0f;
        observe_element(side, element, moment, slot, pixel, planes, change);
    }
    for (long long i = first; i < last; ++i)
        change.own[i] = larger(change.new_excess[i], 0.0f) / larger(change.new_span_s[i], given::SPAN_MIN_S);
}

// Rates of the elements in some rows of pixels, from the own rates of all elements.
inline void rate_rows(int side, const Moment& moment, const Change& change, long long first_row, long long last_row) {
    const int elements = side / EDGE;
    float near[ELEMENTS_MAX + 4] = {}, far[ELEMENTS_MAX + 4] = {};  // maxima over 3 and 5 rows, 0 at both ends
    for (int row = (int)first_row / EDGE; row < last_row / EDGE; ++row) {
        const float* own = change.own + row * elements;
        float* rate = change.rate + row * elements;
        const auto greatest = [&](int reach, float* most) {
            for (int i = 0; i < elements; ++i) most[2 + i] = own[i];
            for (int other = row - reach; other <= row + reach; ++other)
                for (int i = 0; other >= 0 && other < elements && i < elements; ++i)
                    most[2 + i] = larger(most[2 + i], change.own[other * elements + i]);
        };
        if (moment.spreads) greatest(1, near), greatest(2, far);
        for (int i = 0; i < elements; ++i) {
            float own_rate = own[i];
            if (moment.spreads) {
                const float beside = larger(near[1 + i], larger(near[2 + i], near[3 + i]));
                const float around =
                    larger(larger(far[i], far[1 + i]), larger(far[2 + i], larger(far[3 + i], far[4 + i])));
                own_rate = larger(larger(own_rate, given::SHARE_NEAR * beside), given::SHARE_AROUND * around);
            }
            rate[i] = smaller(larger(own_rate, given::RATE_MIN), (float)moment.rate_max);
        }
    }
}

}  // namespace batches
