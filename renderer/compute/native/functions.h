// Elementary functions of sixteen floats, accurate to a few units in the last place; for vpow, in the last place of the
// logarithm of the result.
#pragma once
#include "lanes.h"

namespace packets {

// log2 of positive, normal numbers: twice the series of the inverse hyperbolic tangent on [sqrt(1/2), sqrt(2)], plus
// the exponent.
inline f16 vlog2(f16 x) {
    const i16 raw = __builtin_bit_cast(i16, x);
    const i16 exponent = (raw - 0x3f3504f3) >> 23;  // 0x3f3504f3 is sqrt(1/2)
    const f16 m = __builtin_bit_cast(f16, raw - (exponent << 23));
    const f16 s = (m - 1.0f) / (m + 1.0f), z = s * s;
    const f16 series = 1.0f + z * (1.0f / 3.0f + z * (0.2f + z * (1.0f / 7.0f + z * (1.0f / 9.0f))));
    return to_float(exponent) + s * series * 2.88539008f;  // 2 / ln 2
}

// 2^x: the Taylor series of exp(f ln 2) on [-1/2, 1/2], times a power of two; 0 below the least normal number.
inline f16 vexp2(f16 x) {
    const f16 bounded = clamped(x, -126.0f, 127.0f), whole = vfloor(bounded + 0.5f),
              f = (bounded - whole) * 0.693147181f;
    const f16 tail = 1.0f / 120.0f + f * (1.0f / 720.0f + f * (1.0f / 5040.0f));
    const f16 series = 1.0f + f * (1.0f + f * (0.5f + f * (1.0f / 6.0f + f * (1.0f / 24.0f + f * tail))));
    const f16 power = __builtin_bit_cast(f16, (to_int(whole) + 127) << 23);
    return x < -126.0f ? (f16)0.0f : series * power;
}

// base^exponent for bases of at least 0.
inline f16 vpow(f16 base, f16 exponent) {
    const f16 value = vexp2(exponent * vlog2(vmax(base, (f16)1.2e-38f)));
    return base > 0.0f ? value : exponent == 0.0f ? (f16)1.0f : (f16)0.0f;
}

// Angle of the point (x, y), radians in [-pi, pi]. Polynomial: Moshier, Cephes library, atanf.
inline f16 vatan2(f16 y, f16 x) {
    const f16 across = vabs(x), up = vabs(y);
    const f16 most = vmax(across, up);
    const f16 ratio = most > 0.0f ? vmin(across, up) / most : (f16)0.0f;
    const i16 steep = ratio > 0.414213562f;
    const f16 a = steep ? (ratio - 1.0f) / (ratio + 1.0f) : ratio, z = a * a;
    const f16 series = ((8.05374449538e-2f * z - 1.38776856032e-1f) * z + 1.99777106478e-1f) * z - 3.33329491539e-1f;
    f16 angle = series * z * a + a + (steep ? (f16)(PI / 4.0f) : (f16)0.0f);
    angle = up > across ? PI / 2.0f - angle : angle;
    angle = x < 0.0f ? PI - angle : angle;
    return y < 0.0f ? -angle : angle;
}

inline f16 vacos(f16 cosine) {
    const f16 c = clamped(cosine, -1.0f, 1.0f);
    return vatan2(vsqrt((1.0f - c) * (1.0f + c)), c);
}

}  // namespace packets
