"""The control decision in C, for the solver ``waterfill``; definitions in ``tsar/response``.

Only elements with an error take part: they are gathered into columns one after the other, and every pass runs over
these. A column holds one quantity of all of them.
"""

from __future__ import annotations

import warp as wp

from renderer.launching import Address


@wp.struct
class ResponsePlan:
    """What of the configuration the response depends on; densities are normalised by their maxima."""

    elements: wp.int32
    spatial_high: wp.float64
    temporal_high: wp.float64
    spatial_min: wp.float64
    temporal_min: wp.float64
    gain: wp.float64
    surplus_max: wp.float64
    """Normalised as combined density is."""
    shift: wp.float64
    """Factor by which a decision slides towards space: 2 to the bias."""


COLUMNS = 10
"""θ_s, θ_t, a_s, a_t, m_s, m_t, k_min, k_max, desired, bound; φ_s and φ_t begin where m_s and m_t end up."""


@wp.func_native("""
    const double *s = (const double*)spatial, *t = (const double*)temporal;
    const double *phi_s = (const double*)error_spatial, *phi_t = (const double*)error_temporal;
    int* element = (int*)active;
    double* c = (double*)columns;
    const int n = plan.elements;
    int count = 0;
    for (int i = 0; i < n; ++i) {
        element[count] = i;
        count += phi_s[i] != 0.0 || phi_t[i] != 0.0;
    }
    for (int i = 0; i < count; ++i) {
        const int e = element[i];
        c[i] = s[e], c[n + i] = t[e], c[4 * n + i] = phi_s[e], c[5 * n + i] = phi_t[e];
    }
    return count;
""")
def gather_active(
    plan: ResponsePlan,
    spatial: Address,
    temporal: Address,
    error_spatial: Address,
    error_temporal: Address,
    active: Address,
    columns: Address,
) -> wp.int32:
    """Elements with an error, their densities and errors. Returns how many."""
    ...


@wp.func_native("""
    const int n = plan.elements;
    double* c = (double*)columns;
    const double *theta_s = c, *theta_t = c + n;
    double *as = c + 2 * n, *at = c + 3 * n, *ms = c + 4 * n, *mt = c + 5 * n;
    double *kn = c + 6 * n, *kx = c + 7 * n, *want = c + 8 * n, *most = c + 9 * n;
    const double low_s = plan.spatial_min, low_t = plan.temporal_min, wall = 1e-9;
    for (int i = 0; i < count; ++i) {
        const double a_s = theta_s[i] / plan.spatial_high, a_t = theta_t[i] / plan.temporal_high;
        double f_s = ms[i], f_t = mt[i];
        // What points out of the box from its wall is dropped: the decision slides along the wall.
        if ((f_s < 0 & a_s <= low_s * (1 + wall)) | (f_s > 0 & a_s >= 1 - wall)) f_s = 0.0;
        if ((f_t < 0 & a_t <= low_t * (1 + wall)) | (f_t > 0 & a_t >= 1 - wall)) f_t = 0.0;
        const double length = sqrt(f_s * f_s + f_t * f_t), unit = length > 0 ? length : 1.0;
        const double m_s = f_s / unit, m_t = f_t / unit;
        // Distance to the wall that the ray meets first (eq. 6.13 corrected).
        const double to_s = m_s == 0 ? INFINITY : ((m_s > 0 ? 1.0 : low_s) - a_s) / m_s;
        const double to_t = m_t == 0 ? INFINITY : ((m_t > 0 ? 1.0 : low_t) - a_t) / m_t;
        const double nearest = wp::min(wp::max(to_s, 0.0), wp::max(to_t, 0.0));
        const double k_max = length > 0 ? nearest : 0.0, k_min = wp::min(k_max, plan.gain * length);
        const double slope = a_s * m_t + a_t * m_s, product = m_s * m_t;
        const double desired = k_min * (slope + product * k_min);
        // Errors of opposite sign: the area has an extremum along the ray, and that is as far as it helps to go.
        const double extremum = -slope / (product < 0 ? 2.0 * product : 1.0);
        const bool inside = product < 0 & extremum > 0 & extremum < k_max & k_min < 2.0 * extremum;
        const double k = inside ? extremum : k_max, furthest = k * (slope + product * k);
        as[i] = a_s, at[i] = a_t, ms[i] = m_s, mt[i] = m_t, kn[i] = k_min, kx[i] = k_max, want[i] = desired;
        most[i] = desired >= 0 ? wp::max(desired, furthest) : wp::min(desired, furthest);
    }
    for (int i = count; i % 8 != 0; ++i) want[i] = most[i] = 0.0;  // sums go by eights
""")
def constrain_active(plan: ResponsePlan, count: wp.int32, columns: Address):
    """Desired and greatest change of combined density (eq. 6.8–6.22)."""
    ...


@wp.func_native("""
    const double *want = (const double*)columns + 8ll * plan.elements, *most = want + plan.elements;
    double ask = 0.0, free = 0.0, ask_most = 0.0, free_most = 0.0;
    for (int i = 0; i < count; ++i) {
        ask += want[i] > 0 ? want[i] : 0.0, ask_most += want[i] > 0 ? most[i] : 0.0;
        free -= want[i] < 0 ? want[i] : 0.0, free_most -= want[i] < 0 ? most[i] : 0.0;
    }
    double given, freed;
    if (ask >= free) {
        freed = wp::min(free_most, ask);
        given = wp::min(ask, freed + surplus);
    } else {
        given = wp::min(ask_most, free);
        freed = wp::min(free, given + plan.surplus_max - surplus);
    }
    // Water level of either side: the sum of min(level * desired, bound) is concave, so Newton's steps from below rise
    // to the exact level and stop as soon as no further element fills up.
    double level[2];
    const double target[2] = {given, freed}, total[2] = {ask, free}, vessels[2] = {ask_most, free_most};
    for (int side = 0; side < 2; ++side) {
        if (target[side] == total[side]) level[side] = 1.0;  // not by way of sums, which round
        else if (target[side] <= 0.0) level[side] = 0.0;
        else if (target[side] >= vessels[side]) level[side] = INFINITY;
        else level[side] = -1.0;
        if (level[side] >= 0.0) continue;
        level[side] = target[side] / total[side];
        const double sign = side == 0 ? 1.0 : -1.0;
        int full = -1;
        for (int turn = 0; turn < 64; ++turn) {
            double filled[8] = {}, open[8] = {};  // eight sums side by side, in a fixed order
            int reached[8] = {};
            for (int i = 0; i < count; i += 8)
                for (int k = 0; k < 8; ++k) {
                    const double w = sign * want[i + k], v = sign * most[i + k];
                    const bool at_bound = (w > 0) & (level[side] * w >= v);
                    filled[k] += at_bound ? v : 0.0;
                    open[k] += ((w > 0) & !at_bound) ? w : 0.0;
                    reached[k] += at_bound;
                }
            double poured = 0.0, rest = 0.0;
            int now = 0;
            for (int k = 0; k < 8; ++k) poured += filled[k], rest += open[k], now += reached[k];
            if (now == full || rest <= 0.0) break;
            full = now;
            level[side] = wp::max(level[side], (target[side] - poured) / rest);
        }
    }
    return wp::vec_t<2, wp::float64>(level[0], level[1]);
""")
def water_levels(plan: ResponsePlan, count: wp.int32, columns: Address, surplus: wp.float64) -> wp.vec2d:
    """Factors on the desired change of those who ask and of those who free density; inf: all go to their bound."""
    ...


@wp.func_native("""
    const int n = plan.elements;
    double* c = (double*)columns;
    double *__restrict__ theta_s = c, *__restrict__ theta_t = c + n;
    const double *__restrict__ as = c + 2 * n, *__restrict__ at = c + 3 * n;
    const double *__restrict__ ms = c + 4 * n, *__restrict__ mt = c + 5 * n;
    const double *__restrict__ kn = c + 6 * n, *__restrict__ kx = c + 7 * n;
    const double *__restrict__ want = c + 8 * n, *__restrict__ most = c + 9 * n;
    const double low_s = plan.spatial_min, low_t = plan.temporal_min;
    for (int i = 0; i < count; ++i) {
        const double a_s = as[i], a_t = at[i], m_s = ms[i], m_t = mt[i], desired = want[i];
        const double bound = most[i], asked = level_ask * desired, freed = level_free * desired;
        const double up = asked < bound ? asked : bound, down = freed > bound ? freed : bound;
        const double granted = desired > 0 ? up : desired < 0 ? down : 0.0;
        // Smallest root of product k² + slope k - granted without cancellation.
        const double product = m_s * m_t, slope = a_s * m_t + a_t * m_s, d = -granted;
        const double root = sqrt(wp::max(slope * slope - 4.0 * product * d, 0.0));
        const double q = -0.5 * (slope + (slope < 0 ? -1.0 : 1.0) * root);
        // Both are computed and one is taken, here and below: a branch would keep the loop from filling vectors.
        const double first = q / product, second = d / q;  // 0 / 0 and a / 0 are no roots
        const bool first_counts = (product != 0) & (first >= 0), second_counts = (q != 0) & (second >= 0);
        const double least = wp::min(first_counts ? first : INFINITY, second_counts ? second : INFINITY);
        const double root_k = wp::min(least < INFINITY ? least : 0.0, kx[i]), k = granted == 0 ? 0.0 : root_k;
        // Opposite errors and no more granted than desired: the ratio of the axes is that of the desired point.
        const bool redistribute = (product < 0) & (wp::abs(granted) <= wp::abs(desired));
        const double after = a_s * a_t + granted, ratio = (a_s + kn[i] * m_s) / (a_t + kn[i] * m_t);
        double slid = wp::min(wp::max(sqrt(wp::max(after * ratio, 0.0)), after), after / low_t);
        slid = wp::min(wp::max(slid, low_s), 1.0);
        const double ray_s = a_s + k * m_s, ray_t = a_t + k * m_t, slid_t = after / slid;
        double b_s = wp::min(wp::max(redistribute ? slid : ray_s, low_s), 1.0);
        double b_t = wp::min(wp::max(redistribute ? slid_t : ray_t, low_t), 1.0);
        const double lower = wp::max(low_s / b_s, b_t), upper = wp::min(1.0 / b_s, b_t / low_t);
        const double by = wp::min(wp::max(plan.shift, lower), upper);
        b_s = b_s * by, b_t = b_t / by;
        const bool active = (m_s != 0) | (m_t != 0);
        const double old_s = theta_s[i], old_t = theta_t[i];
        theta_s[i] = active ? b_s * plan.spatial_high : old_s;
        theta_t[i] = active ? b_t * plan.temporal_high : old_t;
    }
""")
def mix_active(plan: ResponsePlan, count: wp.int32, columns: Address, level_ask: wp.float64, level_free: wp.float64):
    """New densities of the elements with an error, over the old ones in the columns (sec. 6.4)."""
    ...


@wp.func_native("""
    const int n = plan.elements, *element = (const int*)active;
    const double *new_s = (const double*)columns, *new_t = new_s + n;
    double *s = (double*)spatial_after, *t = (double*)temporal_after;
    memcpy(s, (const double*)spatial, 8ll * n);
    memcpy(t, (const double*)temporal, 8ll * n);
    double freed = 0.0;
    for (int i = 0; i < count; ++i) {
        const int e = element[i];
        const double before = s[e] * t[e], after = new_s[i] * new_t[i];
        freed += before - after;
        s[e] = new_s[i], t[e] = new_t[i];
    }
    return freed;
""")
def write_densities(
    plan: ResponsePlan,
    count: wp.int32,
    active: Address,
    columns: Address,
    spatial: Address,
    temporal: Address,
    spatial_after: Address,
    temporal_after: Address,
) -> wp.float64:
    """The fields after the decision; elements without an error keep their bits. Returns the combined density freed."""
    ...
