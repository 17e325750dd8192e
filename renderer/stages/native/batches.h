// A batch of samples taken into the estimates, the surfels and what is known of change (tsar/filtering/batches.py,
// samples.py and change.py, whose bits these are). Only pixels that samples touch are looked at.
#pragma once
#include "quadtree.h"
#include "taking.h"

#pragma clang fp contract(off)

namespace batches {

using surfels::Planes;

constexpr int TILE = given::TILE_SIDE, SAMPLES = TILE * TILE, EDGE = given::ELEMENT_PX;

struct Traced {
    const float *color, *position;
    const double* time_s;
    const float* spacing;
    const int* instance;
    const float* point;
};

// By elements: as it was, and as it will be.
struct Change {
    const float *excess, *span_s;
    const double* seen_s;
    float *new_excess, *new_span_s;
    double* new_seen_s;
    float *rate, *own;
};

// What the samples of a pixel say together, and its roughness before.
struct Pixel {
    double time_s;
    int at, newest;
    float count, color[3], least, most, roughness;
};
static_assert(sizeof(Pixel) <= 8 * given::PIXEL_WORDS);

struct Moment {
    double now_s;
    float memory_s, rate_max;
    int reprojected, accumulates, spreads;
};

inline float clipped(float value) { return value < 0.0f ? 0.0f : value > 1.0f ? 1.0f : value; }
inline float encoded(float value) { return __builtin_sqrtf(clipped(value)); }
inline float larger(float a, float b) { return a > b ? a : b; }
inline float smaller(float a, float b) { return a < b ? a : b; }

// Half the mean squared difference of each sample from its neighbours in the tile.
inline void semivariances(const float* color, float* found) {
    float value[TILE][TILE][3], across[TILE + 1][TILE + 1] = {}, down[TILE + 1][TILE + 1] = {};
    for (int i = 0; i < SAMPLES; ++i)
        for (int k = 0; k < 3; ++k) value[quadtree::row_of(i)][quadtree::column_of(i)][k] = encoded(color[3 * i + k]);
    const auto half = [](const float* a, const float* b) {
        const float red = a[0] - b[0], green = a[1] - b[1], blue = a[2] - b[2];
        return 0.5f * ((red * red + green * green + blue * blue) / 3.0f);
    };
    // at i the difference from the neighbour before: 0 at both ends
    for (int row = 0; row < TILE; ++row)
        for (int i = 1; i < TILE; ++i) {
            across[row][i] = half(value[row][i], value[row][i - 1]);
            down[i][row] = half(value[i][row], value[i - 1][row]);
        }
    for (int i = 0; i < SAMPLES; ++i) {
        const int row = quadtree::row_of(i), column = quadtree::column_of(i);
        const float total =
            ((across[row][column] + across[row][column + 1]) + down[row][column]) + down[row + 1][column];
        const auto neighbours = [](int at) { return at == 0 || at == TILE - 1 ? 1.0f : 2.0f; };
        found[i] = total / (neighbours(column) + neighbours(row));
    }
}

// Sums the samples up by pixels. `slot` says for each pixel of the image where its sums are, -1 for nowhere; so it is
// before and after.
template <class Plan>
inline int gather(const Plan& plan, const surfels::Poses& poses, const Traced& traced, int tiles, const Moment& moment,
                  int* slot, Pixel* pixel) {
    int pixels = 0;
    for (int tile = 0; tile < tiles; ++tile) {
        float semivariance[SAMPLES];
        semivariances(traced.color + 3 * SAMPLES * tile, semivariance);
        const float wide = larger(traced.spacing[tile], 1.0f), ratio = traced.spacing[tile] / wide;
        const float root = __builtin_sqrtf(wide);
        for (int i = SAMPLES * tile; i < SAMPLES * (tile + 1); ++i) {
            double x = traced.position[2 * i], y = traced.position[2 * i + 1];
            if (moment.reprojected) {
                double depth;
                surfels::project(plan, poses, traced.instance[i], traced.point + 3 * i, x, y, depth);
                if (!(depth > 0.0)) continue;
            }
            if (!(x >= 0.0 && y >= 0.0 && x < plan.side && y < plan.side)) continue;
            const int at = (int)y * plan.side + (int)x;
            if (slot[at] < 0) {
                slot[at] = pixels;
                pixel[pixels++] = Pixel{0.0, at, 0, 0.0f, {0.0f, 0.0f, 0.0f}, 0.0f, 0.0f, 0.0f};
            }
            Pixel& p = pixel[slot[at]];
            const float v = semivariance[i - SAMPLES * tile] / ratio;
            p.count += 1.0f, p.newest = i, p.time_s += traced.time_s[i] - moment.now_s;
            for (int k = 0; k < 3; ++k) p.color[k] += traced.color[3 * i + k];
            p.least += v / root, p.most += v;
        }
    }
    for (int i = 0; i < pixels; ++i) {
        Pixel& p = pixel[i];
        for (int k = 0; k < 3; ++k) p.color[k] = p.color[k] / p.count;
        p.time_s = p.time_s / (double)p.count + moment.now_s;
    }
    return pixels;
}

// Roughness around the pixels that were hit, from the sums in 3 x 3 pixels; the border repeats.
inline void roughen(int side, int pixels, const int* slot, Pixel* pixel, unsigned char* done, float* roughness) {
    const auto inside = [side](int at) { return at < 0 ? 0 : at < side ? at : side - 1; };
    for (int i = 0; i < pixels; ++i) pixel[i].roughness = roughness[pixel[i].at];
    for (int i = 0; i < pixels; ++i)
        for (int around = 0; around < 9; ++around) {
            const int row = pixel[i].at / side + around / 3 - 1, column = pixel[i].at % side + around % 3 - 1;
            const int at = row * side + column;
            if (row < 0 || column < 0 || row >= side || column >= side || done[at]) continue;
            done[at] = 1;
            float count = 0.0f, least = 0.0f, most = 0.0f;
            for (int k = 0; k < 9; ++k) {
                const int other = slot[inside(row + k / 3 - 1) * side + inside(column + k % 3 - 1)];
                if (other >= 0) count += pixel[other].count, least += pixel[other].least, most += pixel[other].most;
            }
            const float near = larger(count / 9.0f, 1e-9f), was = roughness[at];
            const float bounded = smaller(larger(was, (least / 9.0f) / near), (most / 9.0f) / near);
            roughness[at] = larger(0.5f * (was + bounded), given::ROUGHNESS_MIN);
        }
    for (int i = 0; i < pixels; ++i)
        for (int around = 0; around < 9; ++around)
            done[inside(pixel[i].at / side + around / 3 - 1) * side + inside(pixel[i].at % side + around % 3 - 1)] = 0;
}

// What the residuals of an element say of change.
inline void observe_element(int side, int element, const Moment& moment, const int* slot, const Pixel* pixel,
                            const Planes& planes, const Change& change) {
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
        const float expected = given::TOLERANCE * (0.5f * g * planes.inverse[at] + 0.8f * g / p.count);
        excess += residual - expected, usual += expected, span_s += (float)(p.time_s - planes.time_s[at]);
        looked = true;
    }
    change.new_excess[element] = change.excess[element];
    change.new_span_s[element] = change.span_s[element];
    change.new_seen_s[element] = change.seen_s[element];
    if (!looked) return;
    double since = moment.now_s - change.seen_s[element];
    since = since < 0.0 ? 0.0 : since > 1e3 ? 1e3 : since;
    const float gap = (float)since / moment.memory_s;
    float fade = 1.0f / (1.0f + gap + 0.5f * gap * gap);
    if (excess > given::SURE * usual) fade = smaller(fade, given::DROPPED);
    change.new_excess[element] = fade * change.excess[element] + excess;
    change.new_span_s[element] = fade * change.span_s[element] + span_s;
    change.new_seen_s[element] = moment.now_s;
}

inline float greatest_around(const float* own, int elements, int row, int column, int reach) {
    float most = 0.0f;
    for (int r = row - reach; r <= row + reach; ++r)
        for (int c = column - reach; c <= column + reach; ++c)
            if (r >= 0 && c >= 0 && r < elements && c < elements) most = larger(most, own[r * elements + c]);
    return most;
}

inline void observe(int side, const Moment& moment, const int* slot, const Pixel* pixel, const Planes& planes,
                    const Change& change) {
    const int elements = side / EDGE;
    for (int element = 0; element < elements * elements; ++element) {
        observe_element(side, element, moment, slot, pixel, planes, change);
        change.own[element] =
            larger(change.new_excess[element], 0.0f) / larger(change.new_span_s[element], given::SPAN_MIN_S);
    }
    for (int row = 0; row < elements; ++row)
        for (int column = 0; column < elements; ++column) {
            float rate = change.own[row * elements + column];
            if (moment.spreads) {
                rate = larger(rate, 0.5f * greatest_around(change.own, elements, row, column, 1));
                rate = larger(rate, 0.25f * greatest_around(change.own, elements, row, column, 2));
            }
            change.rate[row * elements + column] = smaller(larger(rate, given::RATE_MIN), moment.rate_max);
        }
}

// Where a sample's surface is on the image, 0 where it is not seen.
template <class Plan>
inline void image_of(const Plan& plan, const surfels::Poses& poses, const Traced& traced, int sample, float* at) {
    double x, y, depth;
    surfels::project(plan, poses, traced.instance[sample], traced.point + 3ll * sample, x, y, depth);
    at[0] = x == x ? (float)x : 0.0f, at[1] = y == y ? (float)y : 0.0f;
}

inline float most_of(float x, float y) { return larger(__builtin_fabsf(x), __builtin_fabsf(y)); }

// Estimate and surfel of a pixel with its samples taken in.
template <class Plan>
inline void update(const Plan& plan, const surfels::Poses& poses, const surfels::Poses& earlier, const Traced& traced,
                   const Moment& moment, const Pixel& p, float rate, const Planes& planes) {
    const int at = p.at, count = plan.side * plan.side;
    bool replaced = false, same = true;
    float least_share = 0.0f, aged = planes.aged[at], position[2], step[2] = {0.0f, 0.0f};
    if (moment.reprojected) {
        image_of(plan, poses, traced, p.newest, position);
        if (earlier.rows) {
            image_of(plan, earlier, traced, p.newest, step);
            step[0] = position[0] - step[0], step[1] = position[1] - step[1];
        }
        const float was_x = planes.step[at], was_y = planes.step[count + at];
        same = planes.instance[at] == traced.instance[p.newest];
        replaced = !same && most_of(step[0] - was_x, step[1] - was_y) > given::MOVES_PX;
        least_share = most_of(was_x, was_y) > given::MOVES_PX ? given::SHARE_MOVING : 0.0f;
        const float away = most_of(planes.position[at] - (at % plan.side + 0.5f),
                                   planes.position[count + at] - (at / plan.side + 0.5f));
        aged = aged + p.roughness * larger(away - 0.5f, 0.0f);
    }
    const float elapsed_s = (float)(p.time_s - moment.now_s), g = planes.roughness[at], inverse = planes.inverse[at];
    aged = aged + rate * elapsed_s;
    const float variance = smaller(aged + 0.5f * g * inverse, given::VARIANCE_MAX);
    float share = larger(variance / (variance + 0.5f * g / p.count), least_share);
    if (!moment.accumulates || replaced || !(planes.time_s[at] > -surfels::INF)) share = 1.0f;
    const float kept = (1.0f - share) * (1.0f - share);
    for (int k = 0; k < 3; ++k) {
        float& color = planes.color[k * count + at];
        color = color + share * (p.color[k] - color);
    }
    planes.aged[at] = smaller(kept * aged, given::VARIANCE_MAX);
    planes.inverse[at] = kept * inverse + share * share / p.count;
    planes.time_s[at] = p.time_s;
    if (!moment.reprojected) return;
    const float weight = same ? share : 1.0f;
    for (int k = 0; k < 3; ++k) {
        float& point = planes.point[k * count + at];
        point = point + weight * (traced.point[3ll * p.newest + k] - point);
    }
    for (int k = 0; k < 2; ++k) {
        float& place = planes.position[k * count + at];
        place = place + weight * (position[k] - place);
        if (!same) planes.step[k * count + at] = step[k];
    }
    if (!same) planes.instance[at] = traced.instance[p.newest];
}

// `addresses` are those of Traced, Planes and Change. `slot`, all -1, and `done`, all 0, are left so.
template <class Plan>
inline void take_in(const Plan& plan, const long long* addresses, int tiles, const surfels::Poses& poses,
                    const surfels::Poses& earlier, const Moment& moment, int* slot, Pixel* pixel, unsigned char* done) {
    Traced traced;
    Planes planes;
    Change change;
    __builtin_memcpy(&traced, addresses, sizeof(traced));
    addresses += sizeof(traced) / sizeof(*addresses);
    __builtin_memcpy(&planes, addresses, sizeof(planes));
    addresses += sizeof(planes) / sizeof(*addresses);
    __builtin_memcpy(&change, addresses, sizeof(change));
    const int side = plan.side, elements = side / EDGE;
    const int pixels = gather(plan, poses, traced, tiles, moment, slot, pixel);
    roughen(side, pixels, slot, pixel, done, planes.roughness);
    observe(side, moment, slot, pixel, planes, change);
    for (int i = 0; i < pixels; ++i) {
        const int at = pixel[i].at;
        const float rate = change.rate[at / side / EDGE * elements + at % side / EDGE];
        update(plan, poses, earlier, traced, moment, pixel[i], rate, planes);
        slot[at] = -1;
    }
}

}  // namespace batches
