// Radiance along sixteen rays: `lights.py` and `shading.py` in lanes; the reasons for the steps are given there.
#pragma once
#include "surface.h"
#include "textures.h"

namespace packets {

// First hits of camera rays: the instance, -1 for none; the point in the space of its track, or the direction of the
// ray for a miss; and the instance that hides the first light, LIT for none, UNLIT without a shadow ray.
struct FirstHit {
    Vec16 point;
    i16 instance, occluder;
};

// Material parameters at each lane.
struct Reflection {
    Vec16 emission, albedo, specular, mirror;  // `mirror` is the weight of the mirrored ray
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

// Radiance reflected from the lights towards the viewer; counts the shadow rays. `first` receives the occluder, unless
// it is null.
template <class Scene, class View>
inline Vec16 direct_light(const Stage<Scene, View>& stage, const Surface& surface, const Reflection& material,
                          const Vec16& direction, i16& shadow_rays, FirstHit* first) {
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
            shadow.at.t = distance * SHORT;
        }
        const f16 cosine = dot(surface.normal, towards);
        const unsigned facing = material.lit & bits((cosine > 0.0f) & (dot(surface.geometric_normal, towards) > 0.0f));
        if (!facing) continue;
        shadow_rays -= lanes_of(facing);
        const unsigned blocked = meet_scene<true>(stage, start, towards, facing, shadow);
        if (first && light == 0)
            first->occluder = lanes_of(blocked) ? shadow.instance : lanes_of(facing) ? (i16)LIT : (i16)UNLIT;
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
    mirrored = pick(height < ABOVE_LEAST, mirrored + surface.geometric_normal * (ABOVE_LEAST - height), mirrored);
    return unit(mirrored);
}

// Radiance along rays, and the numbers of shadow and reflected rays; `first` receives the first hits, unless it is
// null.
template <class Scene, class View>
inline Vec16 radiance(const Stage<Scene, View>& stage, Vec16 start, Vec16 towards, unsigned busy, i16& shadow_rays,
                      i16& bounces, FirstHit* first) {
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
        if (first) {
            first->point = towards, first->occluder = UNLIT;
            first->instance = lanes_of(met) ? hit.instance : (i16)-1;
        }
        if (gone) total = pick(lanes_of(gone), total + weight * environment_radiance(scene, towards), total);
        if (!met) break;
        Surface surface = {};
        each_distinct(hit.instance, met, [&](int instance, unsigned same) {
            Vec16* in_track = first ? &first->point : nullptr;
            take(surface, surface_of(stage, instance, same, hit.at, start, towards, in_track), same);
        });
        const i16 on_surface = lanes_of(met);
        travelled += on_surface ? hit.at.t : (f16)0.0f;
        const f16 cosine = -dot(surface.normal, towards);
        const f16 slant = vmax(vabs(dot(surface.geometric_normal, towards)), (f16)SLANT_LEAST);
        const f16 footprint = stage.footprint_scale * stage.view.spread * travelled / slant * surface.uv_density;
        const Reflection material = reflection_of(scene, surface, met, cosine, footprint);
        Vec16 leaving = material.emission;
        if (material.lit) {
            const Vec16 glow = material.albedo * spread(scene.ambient) * material.ambient;
            leaving = leaving + glow + direct_light(stage, surface, material, towards, shadow_rays, first);
        }
        total = pick(on_surface, total + weight * leaving, total);
        weight = pick(on_surface, weight * material.mirror, weight);
        const i16 bright = vmax(vmax(weight.x, weight.y), weight.z) > scene.throughput_cutoff;
        busy = met & bits((bounces < scene.depth) & bright);
        if (!busy) break;
        bounces -= lanes_of(busy), first = nullptr;
        start = surface.position + surface.geometric_normal * surface.offset;
        towards = mirror_direction(surface, towards);
    }
    return total;
}

}  // namespace packets
