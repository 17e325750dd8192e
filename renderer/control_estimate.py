"""One framelet's errors in C: compressed luminance, streaming Haar transform, levelwise norm, signed error, scatter.
Definitions in ``tsar/error.py`` and ``tsar/haar.py``; nothing leaves the first-level cache between them."""

from __future__ import annotations

import warp as wp

from renderer.launching import Address


@wp.struct
class ErrorPlan:
    """What of the configuration the estimate depends on."""

    samples: wp.int32
    """Per framelet, at most 1024."""
    octaves: wp.int32
    octave_positions: wp.int32
    """Positions of all octaves together."""
    state: wp.int32
    """Coefficients kept per framelet."""
    field_level: wp.int32
    linf: wp.int32
    """Whether the norm is the greatest power instead of the total."""
    difference: wp.int32
    """Whether the error is a difference of logarithms instead of a contrast."""
    template_spatial: wp.float32
    template_temporal: wp.float32
    """Powers that the template tolerates, summed over octaves."""
    radiance_max: wp.float32


@wp.func_native("""
    const float* __restrict__ c = (const float*)color + 3ll * plan.samples * row;
    float* __restrict__ out = (float*)luminance;
    int bad = 0;
    for (int i = 0; i < 3 * plan.samples; ++i) bad |= !(wp::abs(c[i]) <= plan.radiance_max);
    for (int i = 0; i < plan.samples; ++i) {
        float y = 0.2126f * c[3 * i] + 0.7152f * c[3 * i + 1] + 0.0722f * c[3 * i + 2];
        y = y > 0.0f ? y : 0.0f;
        out[i] = sqrtf(y / (1.0f + y));
    }
    return bad;
""")
def compress(row: wp.int32, plan: ErrorPlan, color: Address, luminance: Address) -> wp.int32:
    """Compressed luminance of a framelet. Returns 1 where a sample is not a number that counts."""
    ...


@wp.func_native("""
    const float* __restrict__ past = (const float*)state_before;
    float* __restrict__ kept = (float*)state_after;
    float buffer[2][1024];
    float s[341], t[341];  // powers of every octave, the finest first
    const int positions = plan.samples / 4;
    memcpy(buffer[0], (const float*)luminance, 4 * plan.samples);
    for (int octave = 0, begin = 0; octave < plan.octaves; ++octave) {
        const int count = positions >> (2 * octave);
        const float* __restrict__ in = buffer[octave & 1];
        float* __restrict__ approximation = buffer[~octave & 1];
        float* __restrict__ power_s = s + begin;
        float* __restrict__ power_t = t + begin;
        for (int i = 0; i < count; ++i) {
            const float a = in[4 * i], b = in[4 * i + 1], c = in[4 * i + 2], d = in[4 * i + 3];
            const float h_upper = (a + b) * 0.5f, h_lower = (c + d) * 0.5f, g_upper = a - b, g_lower = c - d;
            const float hh = (h_upper + h_lower) * 0.5f, hg = h_upper - h_lower;
            const float gh = (g_upper + g_lower) * 0.5f, gg = g_upper - g_lower;
            // Along time: low is the mean with the last update, high the change since; without a past, none.
            const float hh_past = has_past ? past[i] : hh, hg_past = has_past ? past[count + i] : hg;
            const float gh_past = has_past ? past[2 * count + i] : gh, gg_past = has_past ? past[3 * count + i] : gg;
            const float hgh = (hg + hg_past) * 0.5f, ghh = (gh + gh_past) * 0.5f, ggh = (gg + gg_past) * 0.5f;
            const float hhg = hh - hh_past, hgg = hg - hg_past, ghg = gh - gh_past;
            kept[i] = hh, kept[count + i] = hg, kept[2 * count + i] = gh, kept[3 * count + i] = gg;
            approximation[i] = (hh + hh_past) * 0.5f;
            const float s0 = ghh * ghh, s1 = hgh * hgh, s2 = ggh * ggh, t0 = hhg * hhg, t1 = hgg * hgg, t2 = ghg * ghg;
            power_s[i] = plan.linf ? wp::max(wp::max(s0, s1), s2) : s0 + s1 + s2;
            power_t[i] = plan.linf ? wp::max(wp::max(t0, t1), t2) : t0 + t1 + t2;
        }
        past += 4 * count, kept += 4 * count, begin += count;
    }
    // From coarse to fine: a coefficient spreads over the four below it, in equal shares or whole.
    const float share = plan.linf ? 1.0f : 0.25f;
    for (int count = 1, begin = plan.octave_positions - 1; count < positions; count *= 4, begin -= count)
        for (int i = 0; i < 4 * count; ++i) {
            s[begin - 4 * count + i] += share * s[begin + i / 4];
            t[begin - 4 * count + i] += share * t[begin + i / 4];
        }
    memcpy((float*)power_spatial, s, 4 * positions);
    memcpy((float*)power_temporal, t, 4 * positions);
""")
def transform(
    plan: ErrorPlan,
    has_past: wp.bool,
    luminance: Address,
    state_before: Address,
    state_after: Address,
    power_spatial: Address,
    power_temporal: Address,
):
    """Every octave of a framelet: the wavelet state to keep, and the summed powers at each finest position."""
    ...


@wp.func_native("""
    const float* __restrict__ p = (const float*)power;
    double* __restrict__ out = (double*)field + (index << (2 * (plan.field_level - (int)level)));
    const int positions = plan.samples / 4, elements = 1 << (2 * (plan.field_level - (int)level));
    float phi[256];
    if (plan.difference)
        for (int i = 0; i < positions; ++i) {
            const float octaves = wp::log2(wp::max(p[i], 1.17549435e-38f) / wp::max(tolerated, 1.17549435e-38f));
            phi[i] = wp::min(wp::max(octaves / 8.0f, -1.0f), 1.0f);
        }
    else
        for (int i = 0; i < positions; ++i) phi[i] = (p[i] - tolerated) / (p[i] + tolerated);
    if (elements > positions)
        for (int i = 0; i < elements; ++i) out[i] = phi[i / (elements / positions)];
    else
        for (int i = 0, each = positions / elements; i < elements; ++i) {
            float sum = 0.0f;
            for (int k = 0; k < each; ++k) sum += phi[i * each + k];
            out[i] = sum / (float)each;
        }
""")
def scatter(plan: ErrorPlan, level: wp.int64, index: wp.int64, power: Address, tolerated: wp.float32, field: Address):
    """Signed errors from powers into the elements that the tile covers."""
    ...


@wp.func_native("""
    const char* at = (const char*)cached_state + 4ll * plan.state * (slot < 0 ? 0 : slot);
    for (int i = 0; i < 4 * plan.state; i += 64) __builtin_prefetch(at + i);
""")
def fetch_ahead(plan: ErrorPlan, slot: wp.int64, cached_state: Address):
    """Asks for a wavelet state before it is needed: the cache is larger than the processor's."""
    ...


@wp.func
def estimate_framelet(
    row: wp.int32,
    plan: ErrorPlan,
    level: wp.int64,
    index: wp.int64,
    slot: wp.int64,
    color: Address,
    cached_state: Address,
    coefficients: Address,
    errors_spatial: Address,
    errors_temporal: Address,
    scratch: Address,
) -> wp.int32:
    """Errors and wavelet state of one framelet; ``slot`` holds its past, -1 where there is none.

    Returns:
        1 where a sample is not finite: the results then do not count.
    """
    # three fields of at most 1024 values each
    spatial, temporal = scratch + Address(4096), scratch + Address(8192)
    state_bytes = wp.int64(4 * plan.state)
    bad = compress(row, plan, color, scratch)
    before = cached_state + Address(wp.max(slot, wp.int64(0)) * state_bytes)
    after = coefficients + Address(wp.int64(row) * state_bytes)
    transform(plan, slot >= wp.int64(0), scratch, before, after, spatial, temporal)
    scatter(plan, level, index, spatial, plan.template_spatial, errors_spatial)
    if slot >= wp.int64(0):
        scatter(plan, level, index, temporal, plan.template_temporal, errors_temporal)
    return bad
