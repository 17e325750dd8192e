// Samples from the camera to their colours, sixteen at a time: `camera.py` and `entry.py` in lanes.
#pragma once
#include "quadtree.h"
#include "shading.h"

namespace packets {

using quadtree::column_of;
using quadtree::row_of;

constexpr int PACKET_PX = 4;  // side of the square of pixels whose samples form packets
static_assert(PACKET_PX * PACKET_PX == LANES);
constexpr int PACKETS_A_BLOCK = BLOCK_PX * BLOCK_PX / LANES;
constexpr int AT_ONCE = 16;  // packets that a thread takes at a time

inline int blocks_across(int pixels) { return (pixels + BLOCK_PX - 1) / BLOCK_PX; }

template <class Scene, class View>
inline void camera_rays(const Stage<Scene, View>& stage, f16 x, f16 y, Vec16& origin, Vec16& direction) {
    const View& view = stage.view;
    const Vec16 local = {(2.0f * x - 1.0f) * view.tan_x, (1.0f - 2.0f * y) * view.tan_y, (f16)-1.0f};
    origin = spread(view.from_camera_offset);
    direction = transformed(view.from_camera, local);
    if (view.camera_track) {
        const Pose pose = stage.pose(view.camera_track);
        origin = pose.to_world(origin) + pose.translation;
        direction = pose.to_world(direction);
    }
    direction = unit(direction);
}

// Mean of `samples` squared samples of a pixel, in whole packets, row by row.
template <class Scene, class View>
inline void render_pixel(const Stage<Scene, View>& stage, int column, int row, int samples, float across, float down,
                         float* color) {
    const int per_pixel = samples * samples;
    i16 lane_number;
    for (int lane = 0; lane < LANES; ++lane) lane_number[lane] = lane;
    Vec16 total = {(f16)0.0f, (f16)0.0f, (f16)0.0f};
    for (int first = 0; first < per_pixel; first += LANES) {
        const f16 sample = to_float(lane_number + first), y = vfloor((sample + 0.5f) / (float)samples);
        const f16 x = sample - y * (float)samples;
        Vec16 origin, direction;
        camera_rays(stage, ((float)(column * samples) + x + 0.5f) / across, ((float)(row * samples) + y + 0.5f) / down,
                    origin, direction);
        i16 shadow_rays, bounces;
        total = total + radiance(stage, origin, direction, ALL, shadow_rays, bounces, nullptr);
    }
    const float share = 1.0f / (float)per_pixel;
    color[0] = added(total.x) * share, color[1] = added(total.y) * share, color[2] = added(total.z) * share;
}

// Renders a block of 4 x 4 pixels with `samples` squared samples each. Blocks follow the Morton curve within squares of
// `BLOCK_PX` pixels, and the squares are ordered by rows. Consecutive samples share a pixel where possible.
template <class Scene, class View, class Pixel>
inline void render_block(const Scene& scene, const View& view, int block, int width, int height, int samples,
                         double time_s, Pixel* image) {
    const int columns = blocks_across(width), place = block / PACKETS_A_BLOCK, inner = block % PACKETS_A_BLOCK;
    const int left = place % columns * BLOCK_PX + column_of(inner) * PACKET_PX;
    const int top = place / columns * BLOCK_PX + row_of(inner) * PACKET_PX;
    if (left >= width || top >= height) return;
    Stage<Scene, View> stage = {scene, view, {}, (f16)1.0f};
    for (int lane = 0; lane < LANES; ++lane) stage.time_s[lane] = time_s;
    const int per_pixel = samples * samples;
    const float across = (float)(width * samples), down = (float)(height * samples);
    if (per_pixel % LANES == 0) {
        for (int at = 0; at < LANES; ++at) {
            const int column = left + column_of(at), row = top + row_of(at);
            float color[3];
            if (column >= width || row >= height) continue;
            render_pixel(stage, column, row, samples, across, down, color);
            image[(long long)row * width + column] = Pixel(color[0], color[1], color[2]);
        }
        return;
    }
    float sums[LANES][3] = {};
    int at = 0, within_x = 0, within_y = 0;  // pixel of the block, and sample of the pixel
    for (int packet = 0; packet < per_pixel; ++packet) {
        int pixel[LANES];
        alignas(64) float place_x[LANES], place_y[LANES];
        unsigned busy = 0;
        for (int lane = 0; lane < LANES; ++lane) {
            const int column = left + column_of(at), row = top + row_of(at);
            pixel[lane] = at;
            busy |= (unsigned)(column < width && row < height) << lane;
            place_x[lane] = (float)(column * samples + within_x), place_y[lane] = (float)(row * samples + within_y);
            if (++within_x < samples) continue;
            within_x = 0;
            if (++within_y < samples) continue;
            within_y = 0, ++at;
        }
        if (!busy) continue;
        Vec16 origin, direction;
        camera_rays(stage, (load<f16>(place_x) + 0.5f) / across, (load<f16>(place_y) + 0.5f) / down, origin, direction);
        i16 shadow_rays, bounces;
        float color[3 * LANES];
        store_joined(color, radiance(stage, origin, direction, busy, shadow_rays, bounces, nullptr));
        for (int lane = 0; lane < LANES; ++lane)
            for (int channel = 0; channel < 3; ++channel) sums[pixel[lane]][channel] += color[3 * lane + channel];
    }
    const float share = 1.0f / (float)per_pixel;
    for (at = 0; at < LANES; ++at) {
        const int column = left + column_of(at), row = top + row_of(at);
        if (column < width && row < height)
            image[(long long)row * width + column] =
                Pixel(sums[at][0] * share, sums[at][1] * share, sums[at][2] * share);
    }
}

// A batch: inputs of each sample, and arrays for the results. Times are read only if samples differ in them;
// `footprint_scale` and the three arrays of first hits may be null.
struct Samples {
    int count;
    const float* position;
    const double* time_s;
    const float* footprint_scale;
    float* color;
    int* instance;
    float* point;
    int* occluder;
};

// Stores the first `used` of sixteen vectors consecutively.
inline void put_first(float* to, const Vec16& value, int used) {
    if (used == LANES) return store_joined(to, value);
    float all[3 * LANES];
    store_joined(all, value);
    __builtin_memcpy(to, all, 3 * sizeof(float) * used);
}

// Shades the samples `first` to `first + 15`, or up to the last one. Adds the numbers of shadow and reflected rays to
// `rays`.
template <class Scene, class View>
inline void shade_packet(const Scene& scene, const View& view, int first, const Samples& samples, long long* rays) {
    Stage<Scene, View> stage = {scene, view, {}, (f16)1.0f};
    const int left = samples.count - first, used = left < LANES ? left : LANES;
    f16 x, y;
    if (used == LANES) {
        const float* place = samples.position + 2ll * first;
        const f16 p = load<f16>(place), q = load<f16>(place + LANES);
        x = __builtin_shufflevector(p, q, 0, 2, 4, 6, 8, 10, 12, 14, 16, 18, 20, 22, 24, 26, 28, 30);
        y = __builtin_shufflevector(p, q, 1, 3, 5, 7, 9, 11, 13, 15, 17, 19, 21, 23, 25, 27, 29, 31);
        if (!view.single_time) __builtin_memcpy(stage.time_s, samples.time_s + first, sizeof stage.time_s);
        if (samples.footprint_scale) stage.footprint_scale = load<f16>(samples.footprint_scale + first);
    }
    for (int lane = 0; lane < LANES && used < LANES; ++lane) {
        const long long sample = first + (lane < used ? lane : used - 1);
        x[lane] = samples.position[2 * sample], y[lane] = samples.position[2 * sample + 1];
        if (!view.single_time) stage.time_s[lane] = samples.time_s[sample];
        if (samples.footprint_scale) stage.footprint_scale[lane] = samples.footprint_scale[sample];
    }
    Vec16 origin, direction;
    camera_rays(stage, x, y, origin, direction);
    i16 shadow_rays, bounces;
    FirstHit hit;
    const Vec16 result = radiance(stage, origin, direction, ALL >> (LANES - used), shadow_rays, bounces,
                                  samples.instance ? &hit : nullptr);
    rays[0] += added(shadow_rays), rays[1] += added(bounces);
    put_first(samples.color + 3ll * first, result, used);
    if (!samples.instance) return;
    put_first(samples.instance + first, hit.instance, used);
    put_first(samples.point + 3ll * first, hit.point, used);
    put_first(samples.occluder + first, hit.occluder, used);
}

// Calls `work(item)` for items below `count` that no other caller has taken; `taken` is the shared counter.
template <class Work> inline void share(int* taken, int count, int at_once, Work work) {
    for (int first; (first = __atomic_fetch_add(taken, at_once, __ATOMIC_RELAXED)) < count;)
        for (int item = first; item < first + at_once && item < count; ++item) work(item);
}

template <class Scene, class View>
inline void shade_samples(const Scene& scene, const View& view, int* taken, const Samples& samples, long long* rays) {
    long long mine[2] = {};
    share(taken, (samples.count + LANES - 1) / LANES, AT_ONCE,
          [&](int packet) { shade_packet(scene, view, packet * LANES, samples, mine); });
    for (int kind = 0; kind < 2; ++kind) __atomic_fetch_add(rays + kind, mine[kind], __ATOMIC_RELAXED);
}

template <class Scene, class View, class Image>
inline void render_pixels(const Scene& scene, const View& view, int* taken, int samples, double time_s,
                          const Image& image) {
    const int width = image.shape[1], height = image.shape[0];
    share(taken, blocks_across(width) * blocks_across(height) * PACKETS_A_BLOCK, AT_ONCE,
          [&](int block) { render_block(scene, view, block, width, height, samples, time_s, image.data); });
}

}  // namespace packets
