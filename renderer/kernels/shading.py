"""Light transport along one camera ray: Phong reflection, shadows, mirrors and glass.

Source: Whitted 1980 (tree of rays); Cook, Porter and Carpenter 1984 (spread rays). Every function takes the set of
features (:mod:`renderer.layout.features`) for which its kernel is compiled. It is a literal in the kernel, so the
compiler removes code for other features.
"""

from __future__ import annotations

import warp as wp

from renderer.kernels.bundles import bundle_size, leave_waiting, mirror_direction, sent_on
from renderer.kernels.glass import Sent, sent_by_glass
from renderer.kernels.intersect import closest_hit, occluder
from renderer.kernels.lights import arriving_light, environment_radiance, has_extent
from renderer.kernels.randomness import PURPOSE_LIGHT, PURPOSE_REFLECT, PURPOSE_REFRACT, cell_2d, draw_2d
from renderer.kernels.surface import surface_at
from renderer.kernels.textures import texture_color
from renderer.layout.features import Feature
from renderer.layout.sizes import FAR, LIT, SLANT_LEAST, UNLIT
from renderer.layout.structs import Draw, FirstHit, MaterialRecord, Ray, SceneData, Surface, ViewData

_EXTENDED = wp.constant(int(Feature.SUN_DISC | Feature.QUAD | Feature.SPHERE_LIGHT | Feature.ENVIRONMENT))


@wp.func
def direct_light(
    features: wp.int32,
    scene: SceneData,
    view: ViewData,
    time_s: wp.float64,
    draw: Draw,
    surface: Surface,
    material: MaterialRecord,
    albedo: wp.vec3,
    direction: wp.vec3,
):
    """Radiance reflected from the lights towards the viewer, the number of shadow rays, and the occluder of the first
    shadow ray to the first light.

    ``albedo`` is the diffuse colour, reduced by the mirrored part; ``direction`` is that of the viewing ray.
    """
    total = wp.vec3(0.0, 0.0, 0.0)
    rays = wp.int32(0)
    first = wp.int32(UNLIT)
    start = surface.position + surface.offset * surface.geometric_normal
    mirrored = direction - 2.0 * wp.dot(direction, surface.normal) * surface.normal
    for light in range(scene.light_count):
        record = scene.lights[light]
        extended = wp.bool((features & _EXTENDED) != 0)
        if extended:
            extended = has_extent(record)
        cells = wp.int32(1)
        if (features & Feature.ALL_CELLS) != 0 and extended:
            cells = scene.light_cells
        sample = wp.vec2(0.0, 0.0)
        if extended and cells == 1:
            sample = draw_2d(draw, PURPOSE_LIGHT + light)
        share = 1.0 / wp.float32(cells * cells)
        for cell in range(cells * cells):
            if cells > 1:
                sample = cell_2d(draw, PURPOSE_LIGHT + light, cell, cells)
            arriving = arriving_light(features, scene, view, time_s, record, sample, start)
            towards = arriving.direction
            cosine = wp.dot(surface.normal, towards)
            # light from behind the true surface must not leak through a smooth normal
            if cosine > 0.0 and wp.dot(surface.geometric_normal, towards) > 0.0 and wp.max(arriving.irradiance) > 0.0:
                reflected = albedo * (cosine / wp.pi)
                if (features & Feature.HIGHLIGHT) != 0:
                    lobe = wp.max(wp.dot(mirrored, towards), 0.0)
                    gloss = wp.pow(lobe, material.exponent) * (material.exponent + 2.0) * (0.5 / wp.pi)
                    reflected = reflected + material.specular * gloss
                rays = rays + 1
                between = occluder(features, scene, view, time_s, start, towards, arriving.reach)
                if between == LIT:
                    total = total + wp.cw_mul(reflected, arriving.irradiance) * share
                if light == 0 and first == UNLIT:
                    first = between
    return total, rays, first


@wp.func
def fresnel(material: MaterialRecord, cosine: wp.float32) -> wp.float32:
    """Mirror reflectance ``min + (max - min) (1 - cos)^exponent``."""
    grazing = wp.pow(wp.clamp(1.0 - cosine, 0.0, 1.0), material.fresnel_exponent)
    return material.fresnel_min + (material.fresnel_max - material.fresnel_min) * grazing


@wp.func
def sent_by(
    features: wp.int32,
    scene: SceneData,
    surface: Surface,
    material: MaterialRecord,
    cosine: wp.float32,
    footprint: wp.float32,
    direction: wp.vec3,
) -> Sent:
    """Weights of the secondary rays along the perfect directions of a surface."""
    if (features & Feature.GLASS) != 0 and material.transmission >= 0:
        return sent_by_glass(features, scene, surface, material, cosine, footprint, direction)
    sent = Sent()
    if (features & Feature.MIRROR) != 0:
        sent.reflection = material.mirror_tint * fresnel(material, cosine)
        if material.mirror >= 0:
            color = texture_color(features, scene, material.mirror, surface.uv, footprint)
            sent.reflection = wp.cw_mul(sent.reflection, color)
    return sent


@wp.func
def left_by(
    features: wp.int32,
    scene: SceneData,
    view: ViewData,
    time_s: wp.float64,
    surface: Surface,
    material: MaterialRecord,
    ray: Ray,
    cosine: wp.float32,
    footprint: wp.float32,
):
    """Radiance that leaves a surface against a ray, without mirrored and transmitted light; the number of shadow rays,
    and the occluder of the first light."""
    glow = material.emission
    shadow_rays = wp.int32(0)
    between = wp.int32(UNLIT)
    if not surface.inside:
        glow = glow + surface.emission
    if material.diffuse >= 0:
        albedo = texture_color(features, scene, material.diffuse, surface.uv, footprint)
        if (features & Feature.MIRROR) != 0:
            albedo = albedo * (1.0 - fresnel(material, cosine))
        lit, rays, first = direct_light(features, scene, view, time_s, ray.draw, surface, material, albedo, ray.towards)
        shadow_rays = rays
        between = first
        glow = glow + wp.cw_mul(albedo, scene.ambient) * material.ambient + lit
    return glow, shadow_rays, between


@wp.func
def radiance(
    features: wp.int32,
    scene: SceneData,
    view: ViewData,
    time_s: wp.float64,
    draw: Draw,
    origin: wp.vec3,
    direction: wp.vec3,
    footprint_scale: wp.float32,
    stack: wp.array2d(dtype=Ray),
    row: wp.int32,
):
    """Radiance along a world ray; the numbers of shadow, reflected and refracted rays; and the first hit.

    ``footprint_scale`` multiplies the footprint over which textures are filtered. Rays that are still to be traced wait
    in ``stack[row]``; without glass and spread bundles there are none.
    """
    total = wp.vec3(0.0, 0.0, 0.0)
    counts = wp.vec3i(0, 0, 0)
    first = FirstHit()
    first.instance = -1
    first.point = direction
    first.occluder = UNLIT
    waiting = wp.int32(0)
    ray = Ray()
    ray.start = origin
    ray.towards = direction
    ray.weight = wp.vec3(1.0, 1.0, 1.0)
    ray.draw = draw
    alive = wp.bool(True)
    while alive:
        alive = False
        hit = closest_hit(features, scene, view, time_s, ray.start, ray.towards, FAR)
        if hit.instance < 0:
            total = total + wp.cw_mul(ray.weight, environment_radiance(features, scene, ray.towards))
        else:
            surface = surface_at(features, scene, view, time_s, hit, ray.start, ray.towards)
            material = scene.materials[surface.material]
            ray.travelled = ray.travelled + hit.t
            cosine = -wp.dot(surface.normal, ray.towards)
            slant = wp.max(wp.abs(wp.dot(surface.geometric_normal, ray.towards)), SLANT_LEAST)
            footprint = footprint_scale * (view.width + view.spread * ray.travelled) / slant * surface.uv_density
            glow, rays, between = left_by(features, scene, view, time_s, surface, material, ray, cosine, footprint)
            counts[0] = counts[0] + rays
            if ray.bounces == 0:
                first.instance = hit.instance
                first.point = surface.in_track
                first.occluder = between
            total = total + wp.cw_mul(ray.weight, glow)
            if (features & Feature.MIRROR) != 0 and ray.bounces < scene.depth:
                sent = sent_by(features, scene, surface, material, cosine, footprint, ray.towards)
                weight = wp.cw_mul(ray.weight, sent.refraction)
                if (features & Feature.GLASS) != 0 and wp.max(weight) > scene.throughput_cutoff:
                    rays = bundle_size(features, material, ray, scene.refraction_rays)
                    weight = weight / wp.float32(rays)
                    counts[2] = counts[2] + rays
                    waiting = leave_waiting(
                        features,
                        surface,
                        material,
                        ray,
                        sent.through,
                        weight,
                        0,
                        rays,
                        PURPOSE_REFRACT,
                        stack,
                        row,
                        waiting,
                    )
                weight = wp.cw_mul(ray.weight, sent.reflection)
                if wp.max(weight) > scene.throughput_cutoff:
                    rays = bundle_size(features, material, ray, scene.reflection_rays)
                    weight = weight / wp.float32(rays)
                    counts[1] = counts[1] + rays
                    mirrored = mirror_direction(surface, ray.towards)
                    if (features & Feature.MANY_RAYS) != 0:
                        waiting = leave_waiting(
                            features,
                            surface,
                            material,
                            ray,
                            mirrored,
                            weight,
                            1,
                            rays,
                            PURPOSE_REFLECT,
                            stack,
                            row,
                            waiting,
                        )
                    ray = sent_on(features, surface, material, ray, mirrored, weight, 0, rays, PURPOSE_REFLECT)
                    alive = True
        if (features & (Feature.GLASS | Feature.MANY_RAYS)) != 0 and not alive and waiting > 0:
            waiting = waiting - 1
            ray = stack[row, waiting]
            alive = True
    return total, counts, first
