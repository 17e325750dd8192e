// The control decision for the solver `waterfill`, eight elements at a time; definitions are in `tsar/response`.
//
// Only elements that can move take part: those with an error that does not point out of the box at its wall. They are
// gathered into columns, one per quantity, and every pass runs over these. Sums have eight partial sums on every
// machine, so their rounding is the same everywhere.
#pragma once
#include "lanes.h"

namespace response {

using packets::vmax;
using packets::vmin;
using packets::vsqrt;

using packets::d8;
using packets::l8;
typedef packets::b8 b8;

inline d8 load(const double* from) {
    d8 value;
    __builtin_memcpy(&value, from, sizeof(d8));
    return value;
}
inline void store(double* to, d8 value) { __builtin_memcpy(to, &value, sizeof(d8)); }
inline unsigned bits(l8 c) { return __builtin_bit_cast(unsigned char, __builtin_convertvector(c, b8)); }
inline double added(d8 a) { return ((a[0] + a[1]) + (a[2] + a[3])) + ((a[4] + a[5]) + (a[6] + a[7])); }
inline d8 where(l8 condition, d8 a, d8 b) { return condition ? a : b; }

constexpr double INF = __builtin_inf();

// Columns for all elements, with padding for the last block of eight.
struct Columns {
    double *a_s, *a_t, *m_s, *m_t, *k_min, *k_max, *want, *most;
    int* element;

    Columns(double* memory, int* elements, int n) {
        double** const all[] = {&a_s, &a_t, &m_s, &m_t, &k_min, &k_max, &want, &most};
        static_assert(sizeof(all) / sizeof(*all) == given::COLUMNS);
        for (int i = 0; i < given::COLUMNS; ++i) *all[i] = memory + (long long)i * n;
        element = elements;
    }
};

struct Levels {
    double ask, free;
};

// Gathers the elements that can move: normalised densities, and the error without components that point out of the box
// at its wall, so that the decision moves along the wall. Returns their number; the last block is padded with elements
// that do not move.
template <class Plan>
inline int gather(const Plan& plan, const double* s, const double* t, const float* phi_s, const float* phi_t,
                  const Columns& c) {
    const double above = 1.0 + given::AT_WALL, high = 1.0 - given::AT_WALL;
    const double low_s = plan.spatial_min * above, low_t = plan.temporal_min * above;
    int count = 0;
    for (int first = 0; first < plan.elements; first += 8) {
        packets::f8 e_s = packets::load<packets::f8>(phi_s + first), e_t = packets::load<packets::f8>(phi_t + first);
        if (!packets::bits((e_s != 0.0f) | (e_t != 0.0f))) continue;
        const d8 a_s = load(s + first) / plan.spatial_high, a_t = load(t + first) / plan.temporal_high;
        d8 f_s = __builtin_convertvector(e_s, d8), f_t = __builtin_convertvector(e_t, d8);
        f_s = where(((f_s < 0.0) & (a_s <= low_s)) | ((f_s > 0.0) & (a_s >= high)), 0.0, f_s);
        f_t = where(((f_t < 0.0) & (a_t <= low_t)) | ((f_t > 0.0) & (a_t >= high)), 0.0, f_t);
        unsigned moves = bits((f_s != 0.0) | (f_t != 0.0));
        if (moves == 0xffu) {
            store(c.a_s + count, a_s), store(c.a_t + count, a_t), store(c.m_s + count, f_s), store(c.m_t + count, f_t);
            for (int lane = 0; lane < 8; ++lane) c.element[count + lane] = first + lane;
            count += 8;
            continue;
        }
        for (; moves; moves &= moves - 1, ++count) {
            const int lane = __builtin_ctz(moves);
            c.a_s[count] = a_s[lane], c.a_t[count] = a_t[lane], c.m_s[count] = f_s[lane], c.m_t[count] = f_t[lane];
            c.element[count] = first + lane;
        }
    }
    for (int i = count; i % 8 != 0; ++i) c.a_s[i] = c.a_t[i] = 1.0, c.m_s[i] = c.m_t[i] = 0.0;
    return count;
}

// Directions, and desired and greatest change of combined density (eq. 6.8–6.22).
template <class Plan> inline void constrain(const Plan& plan, int count, const Columns& c) {
    const double low_s = plan.spatial_min, low_t = plan.temporal_min;
    for (int i = 0; i < count; i += 8) {
        const d8 a_s = load(c.a_s + i), a_t = load(c.a_t + i), f_s = load(c.m_s + i), f_t = load(c.m_t + i);
        const d8 length = vsqrt(f_s * f_s + f_t * f_t), unit = where(length > 0.0, length, 1.0);
        const d8 m_s = f_s / unit, m_t = f_t / unit;
        // Distance to the first wall that the ray meets (eq. 6.13, corrected).
        const d8 to_s = where(m_s == 0.0, INF, (where(m_s > 0.0, 1.0, low_s) - a_s) / m_s);
        const d8 to_t = where(m_t == 0.0, INF, (where(m_t > 0.0, 1.0, low_t) - a_t) / m_t);
        const d8 nearest = vmin(vmax(to_s, (d8)0.0), vmax(to_t, (d8)0.0));
        const d8 k_max = where(length > 0.0, nearest, 0.0), k_min = vmin(k_max, plan.gain * length);
        const d8 slope = a_s * m_t + a_t * m_s, product = m_s * m_t;
        const d8 want = k_min * (slope + product * k_min);
        // For errors of opposite signs the area has an extremum along the ray, beyond which the change decreases.
        const d8 extremum = -slope / where(product < 0.0, 2.0 * product, 1.0);
        const l8 inside = (product < 0.0) & (extremum > 0.0) & (extremum < k_max) & (k_min < 2.0 * extremum);
        const d8 k = where(inside, extremum, k_max), furthest = k * (slope + product * k);
        store(c.m_s + i, m_s), store(c.m_t + i, m_t), store(c.k_min + i, k_min), store(c.k_max + i, k_max);
        store(c.want + i, want);
        store(c.most + i, where(want >= 0.0, vmax(want, furthest), vmin(want, furthest)));
    }
}

// Factor of the desired change of the elements that ask (`sign` 1) or free (-1), for which their changes sum to
// `target`. The sum of min(level * desired, bound) is concave, so Newton's steps from below rise to the exact level,
// and end as soon as no further element reaches its bound.
inline double water_level(int count, const Columns& c, double sign, double target, double total, double vessels) {
    if (target == total) return 1.0;  // exact, unlike sums, which are rounded
    if (target <= 0.0) return 0.0;
    if (target >= vessels) return INF;
    double level = target / total;
    int full = -1;
    for (int turn = 0; turn < 64; ++turn) {
        d8 filled = 0.0, open = 0.0;
        l8 reached = 0;
        for (int i = 0; i < count; i += 8) {
            const d8 w = sign * load(c.want + i), v = sign * load(c.most + i);
            const l8 asks = w > 0.0, at_bound = asks & (level * w >= v);
            filled += where(at_bound, v, 0.0);
            open += where(asks & ~at_bound, w, 0.0);
            reached -= at_bound;
        }
        const double rest = added(open);
        int now = 0;
        for (int lane = 0; lane < 8; ++lane) now += (int)reached[lane];
        if (now == full || rest <= 0.0) break;
        full = now;
        const double next = (target - added(filled)) / rest;
        level = next > level ? next : level;
    }
    return level;
}

// Factors of the desired change of the elements that ask for density and of those that free it; infinite if all go to
// their bounds.
template <class Plan> inline Levels water_levels(const Plan& plan, int count, const Columns& c, double surplus) {
    d8 sums[4] = {0.0, 0.0, 0.0, 0.0};
    for (int i = 0; i < count; i += 8) {
        const d8 want = load(c.want + i), most = load(c.most + i);
        sums[0] += where(want > 0.0, want, 0.0), sums[1] += where(want > 0.0, most, 0.0);
        sums[2] -= where(want < 0.0, want, 0.0), sums[3] -= where(want < 0.0, most, 0.0);
    }
    const double ask = added(sums[0]), ask_most = added(sums[1]), free = added(sums[2]), free_most = added(sums[3]);
    double given, freed;
    if (ask >= free) {
        freed = free_most < ask ? free_most : ask;
        given = ask < freed + surplus ? ask : freed + surplus;
    } else {
        given = ask_most < free ? ask_most : free;
        const double room = given + plan.surplus_max - surplus;
        freed = free < room ? free : room;
    }
    return {water_level(count, c, 1.0, given, ask, ask_most), water_level(count, c, -1.0, freed, free, free_most)};
}

// New densities, which replace the normalised old ones in the columns (sec. 6.4). Both branches of a selection are
// computed; NaN and infinity, from 0 / 0 and a / 0, are never selected.
template <bool BIASED, class Plan> inline void mix(const Plan& plan, int count, const Columns& c, Levels level) {
    const double low_s = plan.spatial_min, low_t = plan.temporal_min;
    for (int i = 0; i < count; i += 8) {
        const d8 a_s = load(c.a_s + i), a_t = load(c.a_t + i), m_s = load(c.m_s + i), m_t = load(c.m_t + i);
        const d8 want = load(c.want + i), most = load(c.most + i);
        const d8 up = vmin(level.ask * want, most), down = vmax(level.free * want, most);
        const d8 granted = where(want > 0.0, up, where(want < 0.0, down, 0.0));
        // Smallest root of product k² + slope k - granted = 0, without cancellation.
        const d8 product = m_s * m_t, slope = a_s * m_t + a_t * m_s;
        const d8 root = vsqrt(vmax(slope * slope + 4.0 * product * granted, (d8)0.0));
        const d8 q = -0.5 * (slope + where(slope < 0.0, -root, root));
        const d8 first = q / product, second = -granted / q;
        const d8 least = vmin(where((product != 0.0) & (first >= 0.0), first, INF),
                              where((q != 0.0) & (second >= 0.0), second, INF));
        const d8 root_k = vmin(where(least < INF, least, 0.0), load(c.k_max + i));
        const d8 k = where(granted == 0.0, 0.0, root_k);
        // Errors of opposite signs and no more granted than desired: the ratio of the axes is that of the desired
        // point.
        const d8 k_min = load(c.k_min + i), size = __builtin_elementwise_abs(granted);
        const l8 redistribute = (product < 0.0) & (size <= __builtin_elementwise_abs(want));
        d8 b_s = a_s + k * m_s, b_t = a_t + k * m_t;
        if (bits(redistribute)) {
            const d8 after = a_s * a_t + granted, ratio = (a_s + k_min * m_s) / (a_t + k_min * m_t);
            const d8 along = vsqrt(vmax(after * ratio, (d8)0.0));
            const d8 slid = packets::vmin(vmax(vmin(vmax(along, after), after / low_t), (d8)low_s), (d8)1.0);
            b_s = where(redistribute, slid, b_s), b_t = where(redistribute, after / slid, b_t);
        }
        b_s = vmin(vmax(b_s, (d8)low_s), (d8)1.0), b_t = vmin(vmax(b_t, (d8)low_t), (d8)1.0);
        if (BIASED) {
            const d8 lower = vmax(low_s / b_s, b_t), upper = vmin(1.0 / b_s, b_t / low_t);
            const d8 by = vmin(vmax((d8)plan.shift, lower), upper);
            b_s *= by, b_t /= by;
        }
        store(c.a_s + i, b_s * plan.spatial_high), store(c.a_t + i, b_t * plan.temporal_high);
    }
}

// The fields after the decision; elements that do not move keep their bits. Returns the freed combined density.
template <class Plan>
inline double write(const Plan& plan, int count, const Columns& c, const double* s, const double* t, double* s_after,
                    double* t_after) {
    __builtin_memcpy(s_after, s, sizeof(double) * plan.elements);
    __builtin_memcpy(t_after, t, sizeof(double) * plan.elements);
    double freed[8] = {};
    for (int i = 0; i < count; ++i) {
        const int e = c.element[i];
        freed[i % 8] += s[e] * t[e] - c.a_s[i] * c.a_t[i];
        s_after[e] = c.a_s[i], t_after[e] = c.a_t[i];
    }
    return added(load(freed));
}

// One control decision over the whole field. Returns the new surplus.
template <class Plan>
inline double respond(const Plan& plan, double surplus, const double* s, const double* t, const float* phi_s,
                      const float* phi_t, double* s_after, double* t_after, double* columns, int* element) {
    const Columns c(columns, element, plan.elements);
    const int count = gather(plan, s, t, phi_s, phi_t, c);
    constrain(plan, count, c);
    const Levels levels = water_levels(plan, count, c, surplus / (plan.spatial_high * plan.temporal_high));
    plan.shift == 1.0 ? mix<false>(plan, count, c, levels) : mix<true>(plan, count, c, levels);
    const double after = surplus + write(plan, count, c, s, t, s_after, t_after);
    return after > 0.0 ? after : 0.0;
}

}  // namespace response
