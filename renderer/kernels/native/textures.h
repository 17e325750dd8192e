// Texture lookup for sixteen points: `textures.py` in lanes.
#pragma once
#include "functions.h"
#include "scene.h"

namespace packets {

// Texel indices in 0 .. count - 1, or -1 where the texture is black.
inline i16 wrapped(i16 index, i16 count, int wrap) {
    const i16 outside = (index < 0) | (index >= count);
    if (!bits(outside)) return index;
    if (wrap == WRAP_BLACK) return outside ? (i16)-1 : index;
    if (wrap == WRAP_CLAMP) return index < 0 ? (i16)0 : index >= count ? count - 1 : index;
    const i16 rest = index % count;
    return rest < 0 ? rest + count : rest;
}

struct Level {
    i16 first_texel, width, height;
};

template <class Scene> inline Level level_of(const Scene& scene, int index) {
    const auto& record = scene.levels.data[index];
    return {(i16)record.first_texel, (i16)record.width, (i16)record.height};
}

// Neighbouring samples use few levels.
template <class Scene> inline Level level_of(const Scene& scene, i16 index) {
    Level level = {};
    each_distinct(index, ALL, [&](int number, unsigned same) {
        const Level one = level_of(scene, number);
        const i16 lanes = lanes_of(same);
        level.first_texel = lanes ? one.first_texel : level.first_texel;
        level.width = lanes ? one.width : level.width, level.height = lanes ? one.height : level.height;
    });
    return level;
}

template <class Scene> inline Vec16 texel(const Scene& scene, const Level& level, i16 x, i16 y) {
    const i16 black = (x < 0) | (y < 0);
    const i16 at = black ? (i16)0 : level.first_texel + y * level.width + x;
    return pick(black, {(f16)0.0f, (f16)0.0f, (f16)0.0f}, gather3((const float*)scene.texels.data, at));
}

template <class Scene>
inline Vec16 bilinear(const Scene& scene, const Level& level, f16 x, f16 y, int wrap_x, int wrap_y) {
    const f16 left = vfloor(x - 0.5f), top = vfloor(y - 0.5f);
    const f16 fx = x - 0.5f - left, fy = y - 0.5f - top;
    const i16 column = to_int(left), row = to_int(top);
    const i16 x0 = wrapped(column, level.width, wrap_x), x1 = wrapped(column + 1, level.width, wrap_x);
    const i16 y0 = wrapped(row, level.height, wrap_y), y1 = wrapped(row + 1, level.height, wrap_y);
    const Vec16 upper = texel(scene, level, x0, y0) * (1.0f - fx) + texel(scene, level, x1, y0) * fx;
    const Vec16 lower = texel(scene, level, x0, y1) * (1.0f - fx) + texel(scene, level, x1, y1) * fx;
    return upper * (1.0f - fy) + lower * fy;
}

template <class Scene, class Record>
inline Vec16 level_lookup(const Scene& scene, const Record& record, i16 index, f16 u, f16 v) {
    const Level level = level_of(scene, record.first_level + index);
    return bilinear(scene, level, u * to_float(level.width), (1.0f - v) * to_float(level.height), record.wrap,
                    record.wrap);
}

template <class Scene, class Record>
inline Vec16 image_lookup(const Scene& scene, const Record& record, f16 u, f16 v, f16 footprint_uv) {
    u = u * record.uv_scale[0] + record.uv_offset[0];
    v = v * record.uv_scale[1] + record.uv_offset[1];
    if (record.wrap == WRAP_REPEAT)
        u = u - vfloor(u), v = v - vfloor(v);
    else
        u = clamped(u, UV_LEAST, UV_MOST), v = clamped(v, UV_LEAST, UV_MOST);
    if (record.filter == FILTER_NEAREST) {
        const Level level = level_of(scene, record.first_level);
        const i16 column = wrapped(to_int(vfloor(u * to_float(level.width))), level.width, record.wrap);
        const i16 row = wrapped(to_int(vfloor((1.0f - v) * to_float(level.height))), level.height, record.wrap);
        return texel(scene, level, column, row);
    }
    f16 detail = 0.0f;
    if (record.filter == FILTER_MIPMAP)
        detail = vmin(vlog2(clamped(footprint_uv * record.texel_scale, 1.0f, TEXELS_MOST)),
                      (f16)(record.level_count - 1.0f));
    const i16 first = to_int(detail);
    const f16 blend = detail - to_float(first);
    Vec16 color = level_lookup(scene, record, first, u, v);
    const i16 between = blend > 0.0f;
    if (bits(between)) {
        const i16 second = between ? first + 1 : first;
        const Vec16 coarser = level_lookup(scene, record, second, u, v);
        color = pick(between, color * (1.0f - blend) + coarser * blend, color);
    }
    return color;
}

// Colour of one texture at the lanes of a mask; the other lanes are undefined.
template <class Scene>
inline Vec16 texture_color(const Scene& scene, int texture, f16 u, f16 v, f16 footprint_uv, unsigned mask) {
    const auto& record = scene.textures.data[texture];
    const Vec16 tint = spread(record.value);
    if (record.kind == TEXTURE_CONSTANT) return tint;
    if (record.kind == TEXTURE_IMAGE) {
        // Lanes outside the mask may hold NaN, from which texel indices must not be computed.
        const i16 valid = lanes_of(mask);
        return tint * image_lookup(scene, record, valid ? u : (f16)0.0f, valid ? v : (f16)0.0f,
                                   valid ? footprint_uv : (f16)0.0f);
    }
    const f16 square = vfloor(u * record.uv_scale[0]) + vfloor(v * record.uv_scale[1]);
    const i16 even = square - 2.0f * vfloor(square * 0.5f) == 0.0f;
    const unsigned on_even = mask & bits(even), on_odd = mask & ~on_even;
    Vec16 color = {(f16)0.0f, (f16)0.0f, (f16)0.0f};
    if (on_even) color = texture_color(scene, record.even, u, v, footprint_uv, on_even);
    if (on_odd) color = pick(lanes_of(on_odd), texture_color(scene, record.odd, u, v, footprint_uv, on_odd), color);
    return tint * color;
}

// Radiance from infinity along unit world directions.
template <class Scene> inline Vec16 environment_radiance(const Scene& scene, const Vec16& direction) {
    if (scene.environment_level < 0) return {(f16)0.0f, (f16)0.0f, (f16)0.0f};
    const Vec16 local = unit(transformed(scene.environment_to_map, direction));
    const f16 u = vatan2(local.x, -local.z) * (0.5f / PI), v = vacos(local.y) * (1.0f / PI);
    const Level level = level_of(scene, scene.environment_level);
    return bilinear(scene, level, (u - vfloor(u)) * to_float(level.width), v * to_float(level.height), WRAP_REPEAT,
                    WRAP_CLAMP) *
           (f16)scene.environment_scale;
}

}  // namespace packets
