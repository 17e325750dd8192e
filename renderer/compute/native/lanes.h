// SIMD vectors of sixteen, eight or four lanes.
//
// Clang's vector types take the usual operators; a comparison gives a vector of 0 and -1, and `condition ? a : b`
// selects lane by lane. The widths are fixed: with narrower registers the compiler splits vectors, with the same
// results.
#pragma once

namespace packets {

typedef float f4 __attribute__((ext_vector_type(4)));
typedef float f8 __attribute__((ext_vector_type(8)));
typedef float f16 __attribute__((ext_vector_type(16)));
typedef double d8 __attribute__((ext_vector_type(8)));
typedef decltype(d8() < d8()) l8;
typedef int i4 __attribute__((ext_vector_type(4)));
typedef int i8 __attribute__((ext_vector_type(8)));
typedef int i16 __attribute__((ext_vector_type(16)));

using namespace given;

static_assert(sizeof(f16) == LANES * sizeof(float));
constexpr unsigned ALL = (1u << LANES) - 1;

template <class F> struct IntOf;
template <> struct IntOf<f4> {
    typedef i4 type;
};
template <> struct IntOf<f8> {
    typedef i8 type;
};
template <> struct IntOf<f16> {
    typedef i16 type;
};

typedef bool b4 __attribute__((ext_vector_type(4)));
typedef bool b8 __attribute__((ext_vector_type(8)));
typedef bool b16 __attribute__((ext_vector_type(16)));

// One bit per lane from a comparison, and the reverse.
inline unsigned bits(i4 c) { return __builtin_bit_cast(unsigned char, __builtin_convertvector(c, b4)) & 15u; }
inline unsigned bits(i8 c) { return __builtin_bit_cast(unsigned char, __builtin_convertvector(c, b8)); }
inline unsigned bits(l8 c) { return __builtin_bit_cast(unsigned char, __builtin_convertvector(c, b8)); }
inline unsigned bits(i16 c) { return __builtin_bit_cast(unsigned short, __builtin_convertvector(c, b16)); }
inline i16 lanes_of(unsigned mask) {
    return __builtin_convertvector(__builtin_bit_cast(b16, (unsigned short)mask), i16) != 0;
}

inline int first_bit(unsigned mask) { return __builtin_ctz(mask); }

// One instruction each on x86; the builtins take two more for NaN. Here the result is `b` if either is NaN.
template <class F> inline F vmin(F a, F b) { return a < b ? a : b; }
template <class F> inline F vmax(F a, F b) { return a > b ? a : b; }
template <class F> inline F vabs(F a) { return __builtin_elementwise_abs(a); }
template <class F> inline F vfma(F a, F b, F c) { return __builtin_elementwise_fma(a, b, c); }
template <class F> inline F vsqrt(F a) { return __builtin_elementwise_sqrt(a); }
template <class F> inline F vfloor(F a) { return __builtin_elementwise_floor(a); }
inline f16 clamped(f16 a, float low, float high) { return vmin(vmax(a, (f16)low), (f16)high); }
inline i16 to_int(f16 a) { return __builtin_convertvector(a, i16); }
inline f16 to_float(i16 a) { return __builtin_convertvector(a, f16); }

template <class F, class T> inline F load(const T* from) {
    F value;
    __builtin_memcpy(&value, from, sizeof(F));
    return value;
}
template <class F, class T> inline void store(T* to, F value) { __builtin_memcpy(to, &value, sizeof(F)); }

// Stores the first `used` of sixteen lanes.
template <class F, class T> inline void put_first(T* to, const F& value, int used) {
    if (used == LANES) return store(to, value);
    __builtin_memcpy(to, &value, sizeof(T) * used);
}

// Reductions over all lanes, by halves.
inline float least(f8 a) {
    auto b = vmin(a.lo, a.hi);
    auto c = vmin(b.lo, b.hi);
    return c.x < c.y ? c.x : c.y;
}
inline float least(f16 a) { return least(vmin((f8)a.lo, (f8)a.hi)); }
template <class F> inline float greatest(F a) { return -least(-a); }
// The least lane of each of eight vectors, in half the steps of eight separate reductions.
inline f8 least_of_each(const f16* a) {
    f8 halves[8], quarters[4], eighths[2];
    for (int i = 0; i < 8; ++i) halves[i] = vmin((f8)a[i].lo, (f8)a[i].hi);
    for (int i = 0; i < 4; ++i) {
        const f8 p = halves[2 * i], q = halves[2 * i + 1];
        quarters[i] = vmin((f8)__builtin_shufflevector(p, q, 0, 1, 2, 3, 8, 9, 10, 11),
                           (f8)__builtin_shufflevector(p, q, 4, 5, 6, 7, 12, 13, 14, 15));
    }
    for (int i = 0; i < 2; ++i) {
        const f8 p = quarters[2 * i], q = quarters[2 * i + 1];
        eighths[i] = vmin((f8)__builtin_shufflevector(p, q, 0, 1, 4, 5, 8, 9, 12, 13),
                          (f8)__builtin_shufflevector(p, q, 2, 3, 6, 7, 10, 11, 14, 15));
    }
    return vmin((f8)__builtin_shufflevector(eighths[0], eighths[1], 0, 2, 4, 6, 8, 10, 12, 14),
                (f8)__builtin_shufflevector(eighths[0], eighths[1], 1, 3, 5, 7, 9, 11, 13, 15));
}
inline int added(i16 a) {
    i8 b = a.lo + a.hi;
    i4 c = b.lo + b.hi;
    return (c.x + c.y) + (c.z + c.w);
}
inline float added(f16 a) {
    f8 b = a.lo + a.hi;
    f4 c = b.lo + b.hi;
    return (c.x + c.y) + (c.z + c.w);
}

// base[index] in every lane; every index must be readable.
inline i16 gather(const int* base, i16 index) {
    i16 value;
    for (int lane = 0; lane < LANES; ++lane) value[lane] = base[index[lane]];
    return value;
}

// Transposes the 4 x 4 floats of each quarter; the fourth rows are omitted.
inline void transpose_quarters(const f16* row, f16* column) {
    const f16 a = __builtin_shufflevector(row[0], row[1], 0, 16, 1, 17, 4, 20, 5, 21, 8, 24, 9, 25, 12, 28, 13, 29);
    const f16 b = __builtin_shufflevector(row[2], row[3], 0, 16, 1, 17, 4, 20, 5, 21, 8, 24, 9, 25, 12, 28, 13, 29);
    const f16 c = __builtin_shufflevector(row[0], row[1], 2, 18, 3, 19, 6, 22, 7, 23, 10, 26, 11, 27, 14, 30, 15, 31);
    const f16 d = __builtin_shufflevector(row[2], row[3], 2, 18, 3, 19, 6, 22, 7, 23, 10, 26, 11, 27, 14, 30, 15, 31);
    column[0] = __builtin_shufflevector(a, b, 0, 1, 16, 17, 4, 5, 20, 21, 8, 9, 24, 25, 12, 13, 28, 29);
    column[1] = __builtin_shufflevector(a, b, 2, 3, 18, 19, 6, 7, 22, 23, 10, 11, 26, 27, 14, 15, 30, 31);
    column[2] = __builtin_shufflevector(c, d, 0, 1, 16, 17, 4, 5, 20, 21, 8, 9, 24, 25, 12, 13, 28, 29);
}

template <class F> struct Vec {
    F x, y, z;
    const F& operator[](int axis) const { return axis == 0 ? x : axis == 1 ? y : z; }
};
typedef Vec<f16> Vec16;

template <class F> inline Vec<F> operator+(Vec<F> a, Vec<F> b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
template <class F> inline Vec<F> operator-(Vec<F> a, Vec<F> b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
template <class F> inline Vec<F> operator-(Vec<F> a) { return {-a.x, -a.y, -a.z}; }
template <class F> inline Vec<F> operator*(Vec<F> a, Vec<F> b) { return {a.x * b.x, a.y * b.y, a.z * b.z}; }
template <class F> inline Vec<F> operator*(Vec<F> a, F s) { return {a.x * s, a.y * s, a.z * s}; }
template <class F> inline F dot(Vec<F> a, Vec<F> b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
template <class F> inline Vec<F> cross(Vec<F> a, Vec<F> b) {
    return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
inline Vec16 pick(i16 condition, Vec16 a, Vec16 b) {
    return {condition ? a.x : b.x, condition ? a.y : b.y, condition ? a.z : b.z};
}
// Loads sixteen consecutive 3-vectors.
inline Vec16 separated(const float* xyz) {
    const f16 p = load<f16>(xyz), q = load<f16>(xyz + 16), w = load<f16>(xyz + 32);
    const f16 pq_x = __builtin_shufflevector(p, q, 0, 3, 6, 9, 12, 15, 18, 21, 24, 27, 30, -1, -1, -1, -1, -1);
    const f16 pq_y = __builtin_shufflevector(p, q, 1, 4, 7, 10, 13, 16, 19, 22, 25, 28, 31, -1, -1, -1, -1, -1);
    const f16 pq_z = __builtin_shufflevector(p, q, 2, 5, 8, 11, 14, 17, 20, 23, 26, 29, -1, -1, -1, -1, -1, -1);
    return {__builtin_shufflevector(pq_x, w, 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 17, 20, 23, 26, 29),
            __builtin_shufflevector(pq_y, w, 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 18, 21, 24, 27, 30),
            __builtin_shufflevector(pq_z, w, 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 16, 19, 22, 25, 28, 31)};
}
// Stores sixteen consecutive 3-vectors.
inline void store_joined(float* xyz, const Vec16& v) {
    const f16 p = __builtin_shufflevector(v.x, v.y, 0, 16, -1, 1, 17, -1, 2, 18, -1, 3, 19, -1, 4, 20, -1, 5);
    const f16 q = __builtin_shufflevector(v.x, v.y, 21, -1, 6, 22, -1, 7, 23, -1, 8, 24, -1, 9, 25, -1, 10, 26);
    const f16 w = __builtin_shufflevector(v.x, v.y, -1, 11, 27, -1, 12, 28, -1, 13, 29, -1, 14, 30, -1, 15, 31, -1);
    store<f16>(xyz, __builtin_shufflevector(p, v.z, 0, 1, 16, 3, 4, 17, 6, 7, 18, 9, 10, 19, 12, 13, 20, 15));
    store<f16>(xyz + 16, __builtin_shufflevector(q, v.z, 0, 21, 2, 3, 22, 5, 6, 23, 8, 9, 24, 11, 12, 25, 14, 15));
    store<f16>(xyz + 32, __builtin_shufflevector(w, v.z, 26, 1, 2, 27, 4, 5, 28, 7, 8, 29, 10, 11, 30, 13, 14, 31));
}
// Gathers 3-vectors of an array at lane-wise indices; each is read together with the float after it.
inline Vec16 gather3(const float* base, i16 index) {
    f16 row[4], column[3];
    for (int i = 0; i < 4; ++i) {
        f4 part[4];
        for (int quarter = 0; quarter < 4; ++quarter) part[quarter] = load<f4>(base + 3ll * index[4 * quarter + i]);
        const f8 low = __builtin_shufflevector(part[0], part[1], 0, 1, 2, 3, 4, 5, 6, 7);
        const f8 high = __builtin_shufflevector(part[2], part[3], 0, 1, 2, 3, 4, 5, 6, 7);
        row[i] = __builtin_shufflevector(low, high, 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15);
    }
    transpose_quarters(row, column);
    return {column[0], column[1], column[2]};
}
inline f16 length(Vec16 a) { return vsqrt(dot(a, a)); }
// The zero vector is unchanged, as in Warp.
inline Vec16 unit(Vec16 a) {
    f16 size = length(a);
    return a * (size > 0.0f ? 1.0f / size : (f16)0.0f);
}

}  // namespace packets
