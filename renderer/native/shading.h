// Sixteen samples from the camera to their colours: the lanes of `camera.py`, `surface.py`, `lights.py`
// and `shading.py`, which say why each step is as it is, and which every other device runs.
#pragma once
#include "functions.h"
#include "scene.h"
#include "textures.h"

namespace packets {

constexpr float OFFSET = 1.0e-6f;
constexpr int LIGHT_POINT = 0;

inline f16 greatest_component(const Vec16& v) { return vmax(vmax(vabs(v.x), vabs(v.y)), vabs(v.z)); }

// A hit in the unit space of its shape.
struct LocalSurface {
    Vec16 position, geometric_normal, normal, tangent_u, tangent_v;
    f16 u, v, uv_area;
};

struct Surface {
    Vec16 position, geometric_normal, normal;
    f16 u, v, uv_density, offset;
    i16 material;
};

// Elements of an array of vectors at lane-wise indices.
template <class V> inline Vec16 gather3(const V* base, i16 index) {
    Vec16 v;
    for (int lane = 0; lane < LANES; ++lane) {
        const V& value = base[index[lane]];
        v.x[lane] = value[0], v.y[lane] = value[1], v.z[lane] = value[2];
    }
    return v;
}

inline Vec16 weighted(const Vec16& a, const Vec16& b, const Vec16& c, f16 u, f16 v, f16 w) {
    return a * u + b * v + c * w;
}

template <class Scene, class Mesh> inline LocalSurface mesh_surface(const Scene& scene, const Mesh& mesh, const PacketHit& hit) {
    LocalSurface local;
    i16 first, second, third;
    for (int lane = 0; lane < LANES; ++lane) {
        const auto& face = scene.faces.data[mesh.first_face + hit.face[lane]];
        first[lane] = face[0], second[lane] = face[1], third[lane] = face[2];
    }
    const f16 w = 1.0f - hit.u - hit.v;
    const auto* vertices = scene.vertices.data + mesh.first_vertex;
    const Vec16 a = gather3(vertices, first), b = gather3(vertices, second), c = gather3(vertices, third);
    local.position = weighted(a, b, c, hit.u, hit.v, w);
    local.tangent_u = b - a, local.tangent_v = c - a;
    local.geometric_normal = unit(cross(local.tangent_u, local.tangent_v));
    local.normal = local.geometric_normal;
    if (mesh.first_normal >= 0) {
        const auto* normals = scene.normals.data + mesh.first_normal;
        const Vec16 smooth =
            weighted(gather3(normals, first), gather3(normals, second), gather3(normals, third), hit.u, hit.v, w);
        local.normal = pick(dot(smooth, smooth) > 1.0e-12f, smooth, local.normal);
    }
    local.u = local.v = local.uv_area = 0.0f;
    if (mesh.first_uv >= 0) {
        const auto* uvs = scene.uvs.data + mesh.first_uv;
        f16 ua, va, ub, vb, uc, vc;
        for (int lane = 0; lane < LANES; ++lane) {
            ua[lane] = uvs[first[lane]][0], va[lane] = uvs[first[lane]][1];
            ub[lane] = uvs[second[lane]][0], vb[lane] = uvs[second[lane]][1];
            uc[lane] = uvs[third[lane]][0], vc[lane] = uvs[third[lane]][1];
        }
        local.u = ua * hit.u + ub * hit.v + uc * w, local.v = va * hit.u + vb * hit.v + vc * w;
        local.uv_area = vabs((ub - ua) * (vc - va) - (vb - va) * (uc - ua));
    }
    return local;
}

inline LocalSurface sphere_surface(const Vec16& point) {
    LocalSurface local;
    const Vec16 p = unit(point);
    local.position = local.geometric_normal = local.normal = p;
    const f16 turn = vatan2(p.y, p.x) * (0.5f / PI);
    local.u = turn - vfloor(turn), local.v = 1.0f - vacos(p.z) * (1.0f / PI);
    const f16 ring = vmax(vsqrt(p.x * p.x + p.y * p.y), (f16)1.0e-3f);
    local.tangent_u = {-p.y / ring, p.x / ring, (f16)0.0f};
    local.tangent_v = cross(p, local.tangent_u);
    local.uv_area = 1.0f / (2.0f * PI * PI * ring);
    return local;
}

// A face of the unit cube at `side` of an axis, or the plane z = 0 (axis 2, side 1, not snapped).
inline LocalSurface flat_surface(const Vec16& point, i16 axis, f16 side) {
    LocalSurface local;
    const i16 on_x = axis == 0, on_y = axis == 1;
    const f16 zero = 0.0f, two = 2.0f;
    const Vec16 x_axis = {on_x ? side : zero, on_y ? side : zero, on_x | on_y ? zero : side};
    local.position = point, local.geometric_normal = local.normal = x_axis;
    const f16 first = on_x ? point.y : on_y ? point.z : point.x, second = on_x ? point.z : on_y ? point.x : point.y;
    local.u = 0.5f * first + 0.5f, local.v = 0.5f * second + 0.5f;
    local.tangent_u = {on_x | on_y ? zero : two, on_x ? two : zero, on_y ? two : zero};
    local.tangent_v = {on_y ? two : zero, on_x | on_y ? zero : two, on_x ? two : zero};
    local.uv_area = 1.0f;
    return local;
}

template <class Scene, class Record>
inline LocalSurface local_surface(const Scene& scene, const Record& record, const PacketHit& hit, Vec16 point) {
    if (record.shape == SHAPE_MESH) return mesh_surface(scene, scene.meshes.data[record.mesh], hit);
    if (record.shape == SHAPE_SPHERE) return sphere_surface(point);
    if (record.shape == SHAPE_CUBE) {
        const i16 axis = hit.face % 3;
        const f16 side = hit.face < 3 ? (f16)1.0f : (f16)-1.0f;
        point = {axis == 0 ? side : point.x, axis == 1 ? side : point.y, axis == 2 ? side : point.z};
        return flat_surface(point, axis, side);
    }
    point.z = 0.0f;
    return flat_surface(point, (i16)2, (f16)1.0f);
}

// The surface of one instance at the lanes of a mask, in world space.
template <class Scene, class View>
inline Surface surface_of(const Stage<Scene, View>& stage, int instance, unsigned mask, PacketHit hit,
                          const Vec16& origin, const Vec16& direction) {
    const Scene& scene = stage.scene;
    const auto& record = scene.instances.data[instance];
    hit.face = lanes_of(mask) ? hit.face : (i16)0;  // other lanes may hold no face of this mesh
    Vec16 point = origin + direction * hit.t;
    Pose pose;
    if (record.track) {
        pose = stage.pose(record.track);
        point = pose.to_track(point - pose.translation);
    }
    const Vec16 at = transformed(record.to_local, point) + spread(record.to_local_offset);
    const LocalSurface local = local_surface(scene, record, hit, at);
    Vec16 geometric = transformed_by_transpose(record.to_local, local.geometric_normal);
    Vec16 normal = transformed_by_transpose(record.to_local, local.normal);
    const f16 patch = length(
        cross(transformed(record.from_local, local.tangent_u), transformed(record.from_local, local.tangent_v)));
    Surface surface;
    surface.position = transformed(record.from_local, local.position) + spread(record.from_local_offset);
    f16 magnitude = record.extent;
    if (record.track) {
        magnitude = magnitude + greatest_component(surface.position) + greatest_component(pose.translation);
        surface.position = pose.to_world(surface.position) + pose.translation;
        geometric = pose.to_world(geometric), normal = pose.to_world(normal);
    }
    geometric = unit(geometric), normal = unit(normal);
    geometric = pick(dot(geometric, direction) > 0.0f, -geometric, geometric);
    normal = pick(dot(normal, geometric) < 0.0f, -normal, normal);
    const f16 away = dot(normal, direction);
    surface.geometric_normal = geometric;
    surface.normal = pick(away > -1.0e-3f, unit(normal - direction * (away + 1.0e-3f)), normal);
    surface.u = local.u, surface.v = local.v;
    surface.uv_density = vsqrt(local.uv_area / vmax(patch, (f16)1.0e-30f));
    surface.offset = (magnitude + greatest_component(surface.position)) * OFFSET;
    surface.material = record.material;
    if (record.material < 0)
        surface.material = gather(scene.face_materials.data + scene.meshes.data[record.mesh].first_material, hit.face);
    return surface;
}

inline void take(Surface& into, const Surface& from, unsigned mask) {
    const i16 lanes = lanes_of(mask);
    into.position = pick(lanes, from.position, into.position);
    into.geometric_normal = pick(lanes, from.geometric_normal, into.geometric_normal);
    into.normal = pick(lanes, from.normal, into.normal);
    into.u = lanes ? from.u : into.u, into.v = lanes ? from.v : into.v;
    into.uv_density = lanes ? from.uv_density : into.uv_density, into.offset = lanes ? from.offset : into.offset;
    into.material = lanes ? from.material : into.material;
}

// What the lights meet at each lane.
struct Reflection {
    Vec16 emission, albedo, specular, mirror;  // `mirror` is what the mirrored ray is weighed with
    f16 ambient, exponent;
    unsigned lit;  // lanes with a diffuse colour
};

template <class Scene>
inline Reflection reflection_of(const Scene& scene, const Surface& surface, unsigned mask, f16 cosine, f16 footprint) {
    const Vec16 black = {(f16)0.0f, (f16)0.0f, (f16)0.0f};
    Reflection result = {black, black, black, black, (f16)0.0f, (f16)1.0f, 0u};
    each_distinct(surface.material, mask, [&](int index, unsigned same) {
        const auto& material = scene.materials.data[index];
        const i16 lanes = lanes_of(same);
        f16 reflectance = material.fresnel_min;
        if (material.fresnel_max != material.fresnel_min)
            reflectance += (material.fresnel_max - material.fresnel_min) *
                           vpow(clamped(1.0f - cosine, 0.0f, 1.0f), (f16)material.fresnel_exponent);
        result.emission = pick(lanes, spread(material.emission), result.emission);
        if (material.diffuse >= 0) {
            const Vec16 color = texture_color(scene, material.diffuse, surface.u, surface.v, footprint, same);
            result.albedo = pick(lanes, color * (1.0f - reflectance), result.albedo);
            result.lit |= same;
        }
        result.ambient = lanes ? (f16)material.ambient : result.ambient;
        result.exponent = lanes ? (f16)material.exponent : result.exponent;
        result.specular = pick(lanes, spread(material.specular), result.specular);
        Vec16 mirror = spread(material.mirror_tint) * reflectance;
        if (material.mirror >= 0)
            mirror = mirror * texture_color(scene, material.mirror, surface.u, surface.v, footprint, same);
        result.mirror = pick(lanes, mirror, result.mirror);
    });
    return result;
}

// Radiance that the lights send towards the viewer; counts the shadow rays it took.
template <class Scene, class View>
inline Vec16 direct_light(const Stage<Scene, View>& stage, const Surface& surface, const Reflection& material,
                          const Vec16& direction, i16& shadow_rays) {
    const Scene& scene = stage.scene;
    Vec16 total = {(f16)0.0f, (f16)0.0f, (f16)0.0f};
    const Vec16 start = surface.position + surface.geometric_normal * surface.offset;
    const Vec16 mirrored = direction - surface.normal * (2.0f * dot(direction, surface.normal));
    const unsigned glossy = material.lit & bits(greatest_component(material.specular) > 0.0f);
    for (int light = 0; light < scene.light_count; ++light) {
        const auto& record = scene.lights.data[light];
        Vec16 towards = spread(record.place), irradiance = spread(record.color);
        Hit shadow = {};
        shadow.at.t = FAR;
        if (record.kind == LIGHT_POINT) {
            towards = towards - start;
            const f16 distance = length(towards);
            towards = towards * (1.0f / distance);
            irradiance = irradiance * (1.0f / (distance * distance));
            shadow.at.t = distance * 0.9999f;  // as lights.py
        }
        const f16 cosine = dot(surface.normal, towards);
        const unsigned facing =
            material.lit & bits((cosine > 0.0f) & (dot(surface.geometric_normal, towards) > 0.0f));
        if (!facing) continue;
        shadow_rays -= lanes_of(facing);
        const unsigned blocked = meet_scene<true>(stage, start, towards, facing, shadow);
        const unsigned seen = facing & ~blocked;
        if (!seen) continue;
        Vec16 reflected = material.albedo * (cosine * (1.0f / PI));
        if (seen & glossy) {
            const f16 lobe = vmax(dot(mirrored, towards), (f16)0.0f);
            const f16 gloss = vpow(lobe, material.exponent) * (material.exponent + 2.0f) * (0.5f / PI);
            reflected = reflected + material.specular * gloss;
        }
        total = pick(lanes_of(seen), total + reflected * irradiance, total);
    }
    return total;
}

inline Vec16 mirror_direction(const Surface& surface, const Vec16& direction) {
    Vec16 mirrored = direction - surface.normal * (2.0f * dot(direction, surface.normal));
    const f16 height = dot(mirrored, surface.geometric_normal);
    mirrored = pick(height < 1.0e-4f, mirrored + surface.geometric_normal * (1.0e-4f - height), mirrored);
    return unit(mirrored);
}

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

// Radiance along rays, and how many shadow rays and reflections it took.
template <class Scene, class View>
inline Vec16 radiance(const Stage<Scene, View>& stage, Vec16 start, Vec16 towards, unsigned busy, i16& shadow_rays,
                      i16& bounces) {
    const Scene& scene = stage.scene;
    Vec16 total = {(f16)0.0f, (f16)0.0f, (f16)0.0f}, weight = {(f16)1.0f, (f16)1.0f, (f16)1.0f};
    f16 travelled = 0.0f;
    shadow_rays = bounces = 0;
    while (busy) {
        Hit hit;
        hit.at.t = lanes_of(busy) ? (f16)FAR : (f16)-1.0f;
        hit.at.u = hit.at.v = 0.0f;
        hit.at.face = hit.instance = 0;
        const unsigned met = meet_scene<false>(stage, start, towards, busy, hit);
        const unsigned gone = busy & ~met;
        if (gone) total = pick(lanes_of(gone), total + weight * environment_radiance(scene, towards), total);
        if (!met) break;
        Surface surface = {};
        each_distinct(hit.instance, met, [&](int instance, unsigned same) {
            take(surface, surface_of(stage, instance, same, hit.at, start, towards), same);
        });
        const i16 on_surface = lanes_of(met);
        travelled += on_surface ? hit.at.t : (f16)0.0f;
        const f16 cosine = -dot(surface.normal, towards);
        const f16 slant = vmax(vabs(dot(surface.geometric_normal, towards)), (f16)1.0e-4f);
        const f16 footprint = stage.view.spread * travelled / slant * surface.uv_density;
        const Reflection material = reflection_of(scene, surface, met, cosine, footprint);
        Vec16 leaving = material.emission;
        if (material.lit) {
            const Vec16 glow = material.albedo * spread(scene.ambient) * material.ambient;
            leaving = leaving + glow + direct_light(stage, surface, material, towards, shadow_rays);
        }
        total = pick(on_surface, total + weight * leaving, total);
        weight = pick(on_surface, weight * material.mirror, weight);
        const i16 bright = vmax(vmax(weight.x, weight.y), weight.z) > scene.throughput_cutoff;
        busy = met & bits((bounces < scene.depth) & bright);
        bounces -= lanes_of(busy);
        start = surface.position + surface.geometric_normal * surface.offset;
        towards = mirror_direction(surface, towards);
    }
    return total;
}

// Mean of `samples` squared samples of a pixel, whole packets of them, by rows.
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
        total = total + radiance(stage, origin, direction, ALL, shadow_rays, bounces);
    }
    const float share = 1.0f / (float)per_pixel;
    color[0] = added(total.x) * share, color[1] = added(total.y) * share, color[2] = added(total.z) * share;
}

// Renders a block of 4 x 4 pixels, `samples` squared samples each; blocks go along the Morton curve within 16 x 16
// pixels, those by rows. Consecutive samples share a pixel as far as they can.
template <class Scene, class View, class Pixel>
inline void render_block(const Scene& scene, const View& view, int block, int width, int height, int samples,
                         double time_s, Pixel* image) {
    const int columns = (width + 15) / 16, place = block / 16, inner = block % 16;
    const int left = place % columns * 16 + (inner & 1) * 4 + (inner >> 2 & 1) * 8;
    const int top = place / columns * 16 + (inner >> 1 & 1) * 4 + (inner >> 3) * 8;
    if (left >= width || top >= height) return;
    Stage<Scene, View> stage = {scene, view, {}};
    for (int lane = 0; lane < LANES; ++lane) stage.time_s[lane] = time_s;
    const int per_pixel = samples * samples;
    const float across = (float)(width * samples), down = (float)(height * samples);
    if (per_pixel % LANES == 0) {
        for (int at = 0; at < LANES; ++at) {
            const int column = left + (at & 1) + (at >> 2 & 1) * 2, row = top + (at >> 1 & 1) + (at >> 3) * 2;
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
        f16 x, y;
        unsigned busy = 0;
        for (int lane = 0; lane < LANES; ++lane) {
            const int column = left + (at & 1) + (at >> 2 & 1) * 2, row = top + (at >> 1 & 1) + (at >> 3) * 2;
            pixel[lane] = at;
            busy |= (unsigned)(column < width && row < height) << lane;
            x[lane] = (float)(column * samples + within_x), y[lane] = (float)(row * samples + within_y);
            if (++within_x < samples) continue;
            within_x = 0;
            if (++within_y < samples) continue;
            within_y = 0, ++at;
        }
        if (!busy) continue;
        Vec16 origin, direction;
        camera_rays(stage, (x + 0.5f) / across, (y + 0.5f) / down, origin, direction);
        i16 shadow_rays, bounces;
        const Vec16 color = radiance(stage, origin, direction, busy, shadow_rays, bounces);
        for (int lane = 0; lane < LANES; ++lane) {
            float* to = sums[pixel[lane]];
            to[0] += color.x[lane], to[1] += color.y[lane], to[2] += color.z[lane];
        }
    }
    const float share = 1.0f / (float)per_pixel;
    for (at = 0; at < LANES; ++at) {
        const int column = left + (at & 1) + (at >> 2 & 1) * 2, row = top + (at >> 1 & 1) + (at >> 3) * 2;
        if (column < width && row < height)
            image[(long long)row * width + column] = Pixel(sums[at][0] * share, sums[at][1] * share, sums[at][2] * share);
    }
}

// Shades samples `first` to `first + 15`, as far as there are `count` of them. Adds the shadow rays and reflections it
// took to `rays`. Times are read only where samples differ in them.
template <class Scene, class View>
inline void shade_packet(const Scene& scene, const View& view, int first, int count, const float* position,
                         const double* time_s, float* color, long long* rays) {
    Stage<Scene, View> stage = {scene, view, {}};
    const int used = count - first < LANES ? count - first : LANES;
    f16 x, y;
    for (int lane = 0; lane < LANES; ++lane) {
        const long long sample = first + (lane < used ? lane : used - 1);
        x[lane] = position[2 * sample], y[lane] = position[2 * sample + 1];
        if (!view.single_time) stage.time_s[lane] = time_s[sample];
    }
    Vec16 origin, direction;
    camera_rays(stage, x, y, origin, direction);
    i16 shadow_rays, bounces;
    const Vec16 result = radiance(stage, origin, direction, ALL >> (LANES - used), shadow_rays, bounces);
    for (int lane = 0; lane < used; ++lane) {
        float* to = color + 3ll * (first + lane);
        to[0] = result.x[lane], to[1] = result.y[lane], to[2] = result.z[lane];
        rays[0] += shadow_rays[lane], rays[1] += bounces[lane];
    }
}

// Calls `work(item)` for items below `count` that no other caller has taken; `taken` counts them for all callers.
template <class Work> inline void share(int* taken, int count, int at_once, Work work) {
    for (int first; (first = __atomic_fetch_add(taken, at_once, __ATOMIC_RELAXED)) < count;)
        for (int item = first; item < first + at_once && item < count; ++item) work(item);
}

template <class Scene, class View>
inline void shade_samples(const Scene& scene, const View& view, int* taken, int count, const float* position,
                          const double* time_s, float* color, long long* rays) {
    long long mine[2] = {};
    share(taken, (count + LANES - 1) / LANES, 16, [&](int packet) {
        shade_packet(scene, view, packet * LANES, count, position, time_s, color, mine);
    });
    for (int kind = 0; kind < 2; ++kind) __atomic_fetch_add(rays + kind, mine[kind], __ATOMIC_RELAXED);
}

template <class Scene, class View, class Image>
inline void render_pixels(const Scene& scene, const View& view, int* taken, int samples, double time_s,
                          const Image& image) {
    const int width = image.shape[1], height = image.shape[0];
    share(taken, (width + 15) / 16 * ((height + 15) / 16) * 16, 16, [&](int block) {
        render_block(scene, view, block, width, height, samples, time_s, image.data);
    });
}

}  // namespace packets
