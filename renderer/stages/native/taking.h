// The surfels that pixels keep of those chosen, with their estimates, with the same bits as tsar/filtering/motion.py.
#pragma once
#include "surfels.h"

#pragma clang fp contract(off)

namespace surfels {

constexpr int PIXELS = 4096;  // number of pixels that are processed plane by plane

// Which of eight pixels keep their surfels: not those most of whose neighbours took a surfel in front.
template <class Plan> inline void keep8(const Plan& plan, int at) {
    const int side = plan.side, wide = side + 2 * given::FRAME;
    const double* front = (const double*)plan.front + (at / side + 1) * wide + given::FRAME + at % side;
    int* source = (int*)plan.source + at;
    const d8 bound = load<d8>(front) / (double)given::NEARER;
    // six of eight neighbours include one of any three
    if (!packets::bits((load<d8>(front - 1) < bound) | (load<d8>(front + 1) < bound) |
                       (load<d8>(front - wide) < bound)))
        return;
    l8 nearer = 0;
    for (int down = -1; down <= 1; ++down)
        for (int right = -1; right <= 1; ++right) nearer -= load<d8>(front + down * wide + right) < bound;
    store(source, __builtin_convertvector(nearer >= given::NEARER_COUNT, i8) ? (i8)-1 : load<i8>(source));
}

// Sources of the pixels, for any plane.
struct Taking {
    int first, last;
    int source[PIXELS];                  // the pixel itself if it takes nothing
    unsigned char straight[PIXELS / 8];  // for each eight pixels, whether they take eight consecutive ones
    int none[PIXELS], nones;             // pixels that take nothing
};

inline void prepare(Taking& by, const int* source) {
    by.nones = 0;
    for (int i = by.first; i < by.last; i += 8) {
        const int at = i - by.first;
        const i8 own = load<i8>(source + i), lane = {0, 1, 2, 3, 4, 5, 6, 7}, from = own < 0 ? lane + i : own;
        store(by.source + at, from);
        by.straight[at / 8] = packets::bits(from == from[0] + lane) == 255u;
        for (unsigned left = packets::bits(own < 0); left; left &= left - 1)
            by.none[by.nones++] = i + packets::first_bit(left);
    }
}

template <class T> inline void take(T* to, const T* from, const Taking& by) {
    typedef T Eight __attribute__((ext_vector_type(8)));
    for (int i = by.first; i < by.last; i += 8) {
        const int* source = by.source + (i - by.first);
        if (by.straight[(i - by.first) / 8])
            store(to + i, load<Eight>(from + source[0]));
        else
#pragma clang loop vectorize(disable) unroll(full)
            for (int k = 0; k < 8; ++k) to[i + k] = from[source[k]];
    }
}

template <class T> inline void take(T* to, const T* from, const Taking& by, T otherwise) {
    take(to, from, by);
    for (int i = 0; i < by.nones; ++i) to[by.none[i]] = otherwise;
}

struct Before {
    const float *color, *aged, *inverse;
    const double* time_s;
    const float* roughness;
    const long long* instance;
    const float *point, *position;
};
// Planes of estimates and surfels to be written.
struct Planes {
    float *color, *aged, *inverse;
    double* time_s;
    float* roughness;
    long long* instance;
    float *point, *position, *step;
};

// Copies the estimates and surfels that the pixels of a band keep. `planes` holds the addresses of Before, then those
// of Planes.
template <class Plan> inline void take_rows(const Plan& plan, const long long* planes, const Band& band) {
    Before b;
    Planes a;
    __builtin_memcpy(&b, planes, sizeof(b));
    __builtin_memcpy(&a, planes + sizeof(b) / sizeof(*planes), sizeof(a));
    const int side = plan.side, count = side * side;
    const f4* motion = (const f4*)plan.motion;
    Taking by;
    for (by.first = (int)band.first * side; by.first < band.last * side; by.first = by.last) {
        const int end = (int)band.last * side;
        by.last = by.first + PIXELS < end ? by.first + PIXELS : end;
        for (int i = by.first; i < by.last; i += 8) keep8(plan, i);
        prepare(by, (const int*)plan.source);
        for (int plane = 0; plane < 3; ++plane) {
            take(a.color + plane * count, b.color + plane * count, by, 0.0f);
            take(a.point + plane * count, b.point + plane * count, by, 0.0f);
        }
        take(a.aged, (const float*)plan.aged, by, given::VARIANCE_MAX);
        take(a.inverse, b.inverse, by, 1.0f);
        take(a.time_s, b.time_s, by, -INF);
        take(a.instance, b.instance, by, (long long)given::UNSEEN);
        take(a.roughness, b.roughness, by);
        for (int i = by.first; i < by.last; i += 4) {
            f4 m[4];
            for (int k = 0; k < 4; ++k) m[k] = motion[by.source[i - by.first + k]];
            store(a.position + i, f4{m[0].x, m[1].x, m[2].x, m[3].x});
            store(a.position + count + i, f4{m[0].y, m[1].y, m[2].y, m[3].y});
            store(a.step + i, f4{m[0].z, m[1].z, m[2].z, m[3].z});
            store(a.step + count + i, f4{m[0].w, m[1].w, m[2].w, m[3].w});
        }
        for (int k = 0; k < by.nones; ++k) {
            const int i = by.none[k];
            a.position[i] = i % side + 0.5f, a.position[count + i] = i / side + 0.5f;
            a.step[i] = a.step[count + i] = 0.0f;
        }
    }
}

}  // namespace surfels
