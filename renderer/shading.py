"""Light transport along one camera ray: Phong reflection, hard shadows, a chain of mirrors."""

from __future__ import annotations

import warp as wp

from renderer.intersect import closest_hit, occluded
from renderer.lights import arriving_light, environment_radiance
from renderer.structs import MaterialRecord, SceneData, Surface, ViewData
from renderer.surface import surface_at
from renderer.textures import texture_color

_FAR = wp.constant(1.0e30)


@wp.func
def direct_light(
    scene: SceneData,
    view: ViewData,
    time_s: wp.float64,
    surface: Surface,
    material: MaterialRecord,
    albedo: wp.vec3,
    direction: wp.vec3,
):
    """Radiance reflected from the lights towards the viewer, and the shadow rays it took.

    ``albedo`` is the diffuse colour, scaled by what the mirrored part leaves; ``direction`` is the viewing ray's.
    """
    total = wp.vec3(0.0, 0.0, 0.0)
    rays = wp.int32(0)
    start = surface.position + surface.offset * surface.geometric_normal
    mirrored = direction - 2.0 * wp.dot(direction, surface.normal) * surface.normal
    for light in range(scene.light_count):
        towards, irradiance, reach = arriving_light(scene, light, start)
        cosine = wp.dot(surface.normal, towards)
        # light from behind the true surface must not leak in over a smooth normal
        if cosine > 0.0 and wp.dot(surface.geometric_normal, towards) > 0.0:
            lobe = wp.max(wp.dot(mirrored, towards), 0.0)
            gloss = wp.pow(lobe, material.exponent) * (material.exponent + 2.0) * (0.5 / wp.pi)
            reflected = albedo * (cosine / wp.pi) + material.specular * gloss
            rays = rays + 1
            if not occluded(scene, view, time_s, start, towards, reach):
                total = total + wp.cw_mul(reflected, irradiance)
    return total, rays


@wp.func
def mirror_direction(surface: Surface, direction: wp.vec3) -> wp.vec3:
    """Mirrored viewing direction, kept above the true surface where the smooth normal would send it below."""
    mirrored = direction - 2.0 * wp.dot(direction, surface.normal) * surface.normal
    height = wp.dot(mirrored, surface.geometric_normal)
    if height < 1.0e-4:
        mirrored = mirrored + (1.0e-4 - height) * surface.geometric_normal
    return wp.normalize(mirrored)


@wp.func
def fresnel(material: MaterialRecord, cosine: wp.float32) -> wp.float32:
    """Mirror reflectance ``min + (max - min) (1 - cos)^exponent``."""
    grazing = wp.pow(wp.clamp(1.0 - cosine, 0.0, 1.0), material.fresnel_exponent)
    return material.fresnel_min + (material.fresnel_max - material.fresnel_min) * grazing


@wp.func
def radiance(scene: SceneData, view: ViewData, time_s: wp.float64, origin: wp.vec3, direction: wp.vec3):
    """Radiance along a world ray, with the number of shadow rays and of reflection rays it took.

    Only the mirrored part continues a path, so the recursive tree of Whitted 1980 is a chain.
    """
    total = wp.vec3(0.0, 0.0, 0.0)
    weight = wp.vec3(1.0, 1.0, 1.0)
    start = wp.vec3(origin[0], origin[1], origin[2])
    towards = wp.vec3(direction[0], direction[1], direction[2])
    travelled = wp.float32(0.0)
    shadow_rays = wp.int32(0)
    bounces = wp.int32(0)
    alive = wp.bool(True)
    while alive:
        alive = False
        hit = closest_hit(scene, view, time_s, start, towards, _FAR)
        if hit.instance < 0:
            total = total + wp.cw_mul(weight, environment_radiance(scene, towards))
        else:
            surface = surface_at(scene, view, time_s, hit, start, towards)
            material = scene.materials[surface.material]
            total = total + wp.cw_mul(weight, material.emission)
            travelled = travelled + hit.t
            cosine = -wp.dot(surface.normal, towards)
            slant = wp.max(wp.abs(wp.dot(surface.geometric_normal, towards)), 1.0e-4)
            footprint = view.spread * travelled / slant * surface.uv_density
            reflectance = fresnel(material, cosine)
            if material.diffuse >= 0:
                albedo = texture_color(scene, material.diffuse, surface.uv, footprint) * (1.0 - reflectance)
                glow = wp.cw_mul(albedo, scene.ambient) * material.ambient
                lit, rays = direct_light(scene, view, time_s, surface, material, albedo, towards)
                shadow_rays = shadow_rays + rays
                total = total + wp.cw_mul(weight, glow + lit)
            weight = wp.cw_mul(weight, material.mirror_tint) * reflectance
            if material.mirror >= 0:
                weight = wp.cw_mul(weight, texture_color(scene, material.mirror, surface.uv, footprint))
            if bounces < scene.depth and wp.max(weight) > scene.throughput_cutoff:
                bounces = bounces + 1
                start = surface.position + surface.offset * surface.geometric_normal
                towards = mirror_direction(surface, towards)
                alive = True
    return total, shadow_rays, bounces
