// Framelets: positions of their samples, and signed errors from their colours, sixteen samples at a time: compressed
// luminance, streaming Haar transform, levelwise norms, signed errors on the field. Definitions are in `tsar/error.py`,
// `tsar/estimators.py` and `tsar/haar.py`.
//
// Intermediate results fit into the first-level cache; colours and wavelet state are written directly to the framelet
// cache. A framelet has 4^k samples on the Morton curve, so four neighbours of any octave are consecutive.
#pragma once
#include "functions.h"
#include "lanes.h"
#include "quadtree.h"

namespace framelets {

using namespace packets;

constexpr int POSITIONS_MAX = SAMPLES_MAX / 4;
constexpr int OCTAVE_POSITIONS_MAX = (SAMPLES_MAX - 1) / 3;  // total over all octaves
constexpr int SPARE = 15;  // elements that a last block of sixteen writes beyond the end

// sqrt(y / (1 + y)) as y / sqrt(y (1 + y)). The reciprocal root is found by Newton's method from an initial guess that
// halves the exponent and is accurate to 3.5 %; three steps reach the last digit. From 1e18 on the result is 1.
inline f16 compressed(f16 y) {
    y = clamped(y, 0.0f, 1.0e18f);
    const f16 z = y * (1.0f + y), half = 0.5f * z;
    f16 root = __builtin_bit_cast(f16, 0x5f375a86 - (__builtin_bit_cast(i16, z) >> 1));
    for (int step = 0; step < 3; ++step) root = root * (1.5f - half * root * root);
    return y * root;
}

// Luminance of sixteen samples, which are also copied; lanes of `good` are cleared where a sample is not finite or too
// great.
inline f16 luminance_of(const float* rgb, float* copy, float most, i16& good) {
    const f16 p = load<f16>(rgb), q = load<f16>(rgb + 16), w = load<f16>(rgb + 32);
    store(copy, p), store(copy + 16, q), store(copy + 32, w);
    good &= (vabs(p) <= most) & (vabs(q) <= most) & (vabs(w) <= most);
    const Vec16 color = separated(rgb);
    return LUMINANCE_RED * color.x + LUMINANCE_GREEN * color.y + LUMINANCE_BLUE * color.z;
}

// The four children of each of several positions.
template <class F> struct Four {
    F a, b, c, d;
};
template <class F> inline Four<F> fours(const float* in);
template <> inline Four<f16> fours<f16>(const float* in) {
    const f16 p = load<f16>(in), q = load<f16>(in + 16), r = load<f16>(in + 32), s = load<f16>(in + 48);
    const f16 ab_p = __builtin_shufflevector(p, q, 0, 4, 8, 12, 16, 20, 24, 28, 1, 5, 9, 13, 17, 21, 25, 29);
    const f16 cd_p = __builtin_shufflevector(p, q, 2, 6, 10, 14, 18, 22, 26, 30, 3, 7, 11, 15, 19, 23, 27, 31);
    const f16 ab_r = __builtin_shufflevector(r, s, 0, 4, 8, 12, 16, 20, 24, 28, 1, 5, 9, 13, 17, 21, 25, 29);
    const f16 cd_r = __builtin_shufflevector(r, s, 2, 6, 10, 14, 18, 22, 26, 30, 3, 7, 11, 15, 19, 23, 27, 31);
    return {__builtin_shufflevector(ab_p, ab_r, 0, 1, 2, 3, 4, 5, 6, 7, 16, 17, 18, 19, 20, 21, 22, 23),
            __builtin_shufflevector(ab_p, ab_r, 8, 9, 10, 11, 12, 13, 14, 15, 24, 25, 26, 27, 28, 29, 30, 31),
            __builtin_shufflevector(cd_p, cd_r, 0, 1, 2, 3, 4, 5, 6, 7, 16, 17, 18, 19, 20, 21, 22, 23),
            __builtin_shufflevector(cd_p, cd_r, 8, 9, 10, 11, 12, 13, 14, 15, 24, 25, 26, 27, 28, 29, 30, 31)};
}
template <> inline Four<f4> fours<f4>(const float* in) {
    const f16 v = load<f16>(in);
    return {__builtin_shufflevector(v, v, 0, 4, 8, 12), __builtin_shufflevector(v, v, 1, 5, 9, 13),
            __builtin_shufflevector(v, v, 2, 6, 10, 14), __builtin_shufflevector(v, v, 3, 7, 11, 15)};
}
template <> inline Four<float> fours<float>(const float* in) { return {in[0], in[1], in[2], in[3]}; }

// Calls `body` for all of `count` positions, a power of four: with vectors of sixteen or four, or with one number.
template <class Body> inline void by_lanes(int count, Body body) {
    if (count >= 16)
        for (int i = 0; i < count; i += 16) body(i, f16());
    else if (count == 4)
        body(0, f4());
    else
        body(0, 0.0f);
}

// One octave at some positions: the spatial transform, and along time the mean with an earlier update and the
// difference from it; without a past the difference is 0.
template <class F, class Plan>
inline void transform_some(const Plan& plan, const Four<F>& in, const float* past, float* kept, int count, float* field,
                           float* power_s, float* power_t) {
    const F h_upper = (in.a + in.b) * 0.5f, h_lower = (in.c + in.d) * 0.5f, g_upper = in.a - in.b,
            g_lower = in.c - in.d;
    const F hh = (h_upper + h_lower) * 0.5f, hg = h_upper - h_lower, gh = (g_upper + g_lower) * 0.5f;
    const F gg = g_upper - g_lower;
    const F hh_past = past ? load<F>(past) : hh, hg_past = past ? load<F>(past + count) : hg;
    const F gh_past = past ? load<F>(past + 2 * count) : gh, gg_past = past ? load<F>(past + 3 * count) : gg;
    store(kept, hh), store(kept + count, hg), store(kept + 2 * count, gh), store(kept + 3 * count, gg);
    store(field, (hh + hh_past) * 0.5f);
    const F hgh = (hg + hg_past) * 0.5f, ghh = (gh + gh_past) * 0.5f, ggh = (gg + gg_past) * 0.5f;
    const F hhg = hh - hh_past, hgg = hg - hg_past, ghg = gh - gh_past;
    const F s0 = ghh * ghh, s1 = hgh * hgh, s2 = ggh * ggh, t0 = hhg * hhg, t1 = hgg * hgg, t2 = ghg * ghg;
    store(power_s, plan.linf ? vmax(vmax(s0, s1), s2) : s0 + s1 + s2);
    store(power_t, plan.linf ? vmax(vmax(t0, t1), t2) : t0 + t1 + t2);
}

// All octaves: stores the new state, and the powers at the positions of each octave, fine to coarse. Returns the number
// of octaves that have a past, counted from the finest.
template <class Plan>
inline int transform(const Plan& plan, const float* luminance, const float* past, float* kept, float* power_s,
                     float* power_t) {
    const int positions = plan.samples / 4, updates = past ? (int)past[plan.state - 1] : 0;
    float fields[2][POSITIONS_MAX];
    const float* in = luminance;
    int known = 0;
    for (int octave = 0, begin = 0; octave < plan.octaves; ++octave) {
        const int count = positions >> (2 * octave), width = 4 * count, others = ((1 << octave) - 1) * width;
        const bool has_past = updates >= (2 << octave) - 1;
        const float* before = has_past ? past + others : nullptr;  // oldest field of the octave
        float* field = fields[octave & 1];
        by_lanes(count, [&](int i, auto lanes) {
            transform_some(plan, fours<decltype(lanes)>(in + 4 * i), before ? before + i : nullptr, kept + i, count,
                           field + i, power_s + begin + i, power_t + begin + i);
        });
        if (past)
            __builtin_memcpy(kept + width, past, sizeof(float) * others);
        else
            __builtin_memset(kept + width, 0, sizeof(float) * others);
        in = field, kept += width + others, begin += count, known += has_past;
        past = past ? past + width + others : nullptr;
    }
    const int enough = (1 << plan.octaves) - 1;
    kept[0] = (float)(updates < enough ? updates + 1 : enough);
    return known;
}

// Error of the signal against the template: a contrast, or a difference of logarithms.
template <class Plan> inline f16 compared(const Plan& plan, f16 signal, f16 tolerated) {
    if (!plan.difference) return (signal - tolerated) / (signal + tolerated);
    const f16 octaves = vlog2(vmax(signal, (f16)__FLT_MIN__)) - vlog2(tolerated);
    return clamped(octaves * (1.0f / OCTAVES_OF_FULL_ERROR), -1.0f, 1.0f);
}

// Signed errors in equal parts of a tile from the powers of its finest octaves, at least one. From coarse to fine, the
// norm of each octave is computed in as many parts as it has positions for. Either it is compared and the greatest
// error is kept, or the norms are summed and compared at the end.
template <class Plan>
inline void compare(const Plan& plan, const float* power, int octaves, const float* tolerated, int parts, float* phi) {
    const int positions = plan.samples / 4;
    float norm[POSITIONS_MAX + SPARE] = {};
    float tolerated_sum = 0.0f;
    int begin = 0, size = 0;
    for (int octave = 0; octave < octaves; ++octave) begin += positions >> (2 * octave);
    for (int octave = octaves - 1; octave >= 0; --octave) {
        int here = positions >> (2 * octave);
        begin -= here;
        const float* from = power + begin;
        for (; here > parts; here /= 4, from = norm)
            by_lanes(here / 4, [&](int i, auto lanes) {
                const auto four = fours<decltype(lanes)>(from + 4 * i);
                store(norm + i, plan.linf ? vmax(vmax(four.a, four.b), vmax(four.c, four.d))
                                          : (four.a + four.b) + (four.c + four.d));
            });
        if (from != norm) __builtin_memcpy(norm, from, sizeof(float) * here);
        for (int i = size - 1; i >= 0 && size < here; --i)
            phi[4 * i] = phi[4 * i + 1] = phi[4 * i + 2] = phi[4 * i + 3] = phi[i];
        const f16 limit = (f16)tolerated[octave];
        const float share = plan.linf ? 1.0f : (float)here / (float)parts;
        for (int i = 0; i < here; i += 16) {
            const f16 value = share * load<f16>(norm + i), before = load<f16>(phi + i);
            if (plan.greatest) {
                const f16 error = compared(plan, value, limit);
                store(phi + i, size ? vmax(before, error) : error);
            } else
                store(phi + i, size ? before + value : value);
        }
        size = here, tolerated_sum += tolerated[octave];
    }
    for (int i = 0; i < parts && !plan.greatest; i += 16)
        store(phi + i, compared(plan, load<f16>(phi + i), (f16)tolerated_sum));
}

// Stores the signed errors from powers in the elements that the tile covers.
template <class Plan>
inline void scatter(const Plan& plan, const float* power, int octaves, int axis, float* out, int elements) {
    const int positions = plan.samples / 4;
    const int parts = plan.per_tile ? 1 : (elements < positions ? elements : positions);
    const int row = (axis * OCTAVES_MAX + __builtin_ctz(parts) / 2) * OCTAVES_MAX;
    float phi[POSITIONS_MAX + SPARE] = {};
    compare(plan, power, octaves, (const float*)plan.templates + row, parts, phi);
    const int repeat = elements / parts;
    if (repeat == 1)
        __builtin_memcpy(out, phi, sizeof(float) * parts);
    else
        for (int i = 0; i < parts; ++i)
            for (int k = 0; k < repeat; k += 4) store(out + i * repeat + k, (f4)phi[i]);
}

// Processes one framelet. Its past state must not overlap the new one.
//
// Returns whether all samples are finite and in range; otherwise only the colours have been written.
template <class Plan>
inline bool observe(const Plan& plan, const float* color, const float* past, float* kept_color, float* kept_state,
                    float* errors_s, float* errors_t, int elements) {
    float luminance[SAMPLES_MAX], power_s[OCTAVE_POSITIONS_MAX + SPARE], power_t[OCTAVE_POSITIONS_MAX + SPARE];
    i16 good = ~(i16)0;
    for (int i = 0; i < plan.samples; i += 16)
        store(luminance + i, compressed(luminance_of(color + 3 * i, kept_color + 3 * i, plan.radiance_max, good)));
    if (bits(good) != ALL) return false;
    const int known = transform(plan, luminance, past, kept_state, power_s, power_t);
    scatter(plan, power_s, plan.octaves, 0, errors_s, elements);
    if (known) scatter(plan, power_t, known, 1, errors_t, elements);
    return true;
}

// Positions of the samples of a tile: its corner plus the offsets `centre`, which are in tile widths, converted to
// image widths.
inline void place(long long level, long long index, int samples, const float* centre, float* position) {
    const float x = (float)quadtree::column_of(index), y = (float)quadtree::row_of(index);
    const f4 corner = {x, y, x, y};
    const f16 corners = __builtin_shufflevector(corner, corner, 0, 1, 2, 3, 0, 1, 2, 3, 0, 1, 2, 3, 0, 1, 2, 3);
    const float width = 1.0f / (float)(1ll << level);
    for (int i = 0; i < 2 * samples; i += 16) store(position + i, (corners + load<f16>(centre + i)) * width);
}

// Prefetches memory that is read, or written, later.
template <bool WRITTEN = false> inline void fetch_ahead(const void* from, long long bytes) {
    for (long long at = 0; at < bytes; at += 64) __builtin_prefetch((const char*)from + at, WRITTEN);
}

// Clears the fields of errors, and marks all framelets as pending.
template <class Plan>
inline void start(const Plan& plan, int count, unsigned char* pending, float* errors_s, float* errors_t) {
    const long long bytes = sizeof(float) << (2 * plan.field_level);
    __builtin_memset(errors_s, 0, bytes);
    __builtin_memset(errors_t, 0, bytes);
    __builtin_memset(pending, 1, count);
}

// State of the threads that share a batch: number of rows taken, and number of rows left pending.
struct Progress {
    int taken, left;
};
constexpr int ROWS_AT_ONCE = 8;

// Processes rows of a batch that no other thread has taken. Those marked in `pending` are processed, unless a sample is
// not finite or out of range: these stay marked and are counted.
//
// The framelet cache exceeds the processor's caches: a row's past and its slot are prefetched while the row before is
// computed.
template <class Plan, class Cache>
inline void observe_rows(const Plan& plan, const Cache& cache, int count, const long long* level,
                         const long long* index, const float* color, const long long* slot, const float* const* past,
                         unsigned char* pending, Progress* progress, float* errors_s, float* errors_t) {
    const long long samples = plan.samples, state = plan.state;
    float *cached_color = (float*)cache.color, *cached_state = (float*)cache.coefficients;
    int row, end = 0, left = 0;
    while ((row = __atomic_fetch_add(&progress->taken, ROWS_AT_ONCE, __ATOMIC_RELAXED)) < count) {
        for (end = row + ROWS_AT_ONCE < count ? row + ROWS_AT_ONCE : count; row < end; ++row) {
            if (row + 1 < end) {
                if (past[row + 1]) fetch_ahead(past[row + 1], 4 * state);
                fetch_ahead<true>(cached_state + state * slot[row + 1], 4 * state);
                fetch_ahead<true>(cached_color + 3 * samples * slot[row + 1], 12 * samples);
            }
            if (!pending[row]) continue;
            const int shift = 2 * (plan.field_level - (int)level[row]);
            const long long first = index[row] << shift;
            const bool done =
                observe(plan, color + 3 * samples * row, past[row], cached_color + 3 * samples * slot[row],
                        cached_state + state * slot[row], errors_s + first, errors_t + first, 1 << shift);
            pending[row] = !done;
            left += !done;
        }
    }
    if (left) __atomic_fetch_add(&progress->left, left, __ATOMIC_RELAXED);
}

}  // namespace framelets
