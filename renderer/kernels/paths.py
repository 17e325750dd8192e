"""Path tracing: every surface scatters light from the lights and from other surfaces.

At each surface of a path one light is sampled, and the path continues in one direction sampled from the surface; where
both find the same light, they are weighted by multiple importance sampling. Long paths end at random (Russian
roulette), and the weights of the others are increased.

Source: Kajiya 1986, "The Rendering Equation"; Veach 1997, "Robust Monte Carlo Methods for Light Transport Simulation",
chs 9 and 10.
"""

from __future__ import annotations

import warp as wp

from renderer.kernels.bending import bent_normal
from renderer.kernels.intersect import closest_hit
from renderer.kernels.lights import arriving_light, environment_radiance, map_radiance
from renderer.kernels.path_lights import lamp_density, let_through, opacity_at, preferred, sky_density
from renderer.kernels.randomness import branched, cell_2d, draw_2d
from renderer.kernels.scattering.kinds import chosen_of, lobes_at, response_of
from renderer.kernels.scattering.lobes import Lobes, frame_about
from renderer.kernels.surface import surface_at
from renderer.kernels.textures import texture_color
from renderer.layout.features import Feature
from renderer.layout.kinds import LightKind, ScatterKind
from renderer.layout.path_sizes import PASSED_MOST, ROULETTE_FIRST, ROULETTE_MOST, SPREAD_FIRST
from renderer.layout.sizes import FAR, SLANT_LEAST, UNLIT
from renderer.layout.structs import Draw, FirstHit, SceneData, Surface, ViewData

PURPOSE_VERTEX = 4
_PLACE, _PICK, _TURN, _CHANCE = range(4)  # purposes of the random numbers at one surface of a path


@wp.func
def numbers(draw: Draw, purpose: wp.int32, bounces: wp.int32) -> wp.vec2:
    """Two random numbers, stratified over the group at the first surfaces and independent at deeper ones."""
    if bounces < SPREAD_FIRST:
        return draw_2d(draw, purpose)
    return cell_2d(draw, purpose, 0, 1)


@wp.func
def asked_light(
    features: wp.int32,
    scene: SceneData,
    view: ViewData,
    time_s: wp.float64,
    surface: Surface,
    lobes: Lobes,
    frame: wp.mat33,
    outgoing: wp.vec3,
    pick: wp.float32,
    place: wp.vec2,
):
    """Radiance that a surface scatters from one sampled light, and the number of shadow rays: one or none."""
    light = wp.min(wp.int32(pick * wp.float32(scene.light_count)), scene.light_count - 1)
    record = scene.lights[light]
    arriving = arriving_light(features, scene, view, time_s, record, place, surface.position)
    found = wp.vec3(0.0, 0.0, 0.0)
    if wp.max(arriving.irradiance) <= 0.0:
        return found, 0
    local = frame * arriving.direction
    height = wp.dot(surface.geometric_normal, arriving.direction)
    # light must not leak through the surface where smooth and true normal disagree
    if height * local[2] <= 0.0:
        return found, 0
    response = response_of(features, lobes, outgoing, local)
    if wp.max(response.value) <= 0.0:
        return found, 0
    side = wp.where(height > 0.0, 1.0, -1.0)
    start = surface.position + (side * surface.offset) * surface.geometric_normal
    share = let_through(features, scene, view, time_s, start, arriving.direction, arriving.reach)
    if wp.max(share) > 0.0:
        count = wp.float32(scene.light_count)
        weight = wp.float32(1.0)
        if record.kind == LightKind.QUAD or record.kind == LightKind.SPHERE:
            # radiance over irradiance is the density of the sampled direction
            weight = preferred(wp.max(record.color) / (wp.max(arriving.irradiance) * count), response.density)
        if (features & Feature.ENVIRONMENT) != 0 and record.kind == LightKind.ENVIRONMENT:
            weight = preferred(sky_density(scene, arriving.direction) / count, response.density)
        found = wp.cw_mul(wp.cw_mul(response.value, arriving.irradiance), share) * (weight * count)
    return found, 1


@wp.func
def from_infinity(features: wp.int32, scene: SceneData, direction: wp.vec3, density: wp.float32) -> wp.vec3:
    """Radiance that a path finds at infinity, along a direction that was sampled with a density; 0 for perfect
    directions.

    A background that replaces the environment is visible only to the camera, in mirrors and through glass.
    """
    if density <= 0.0:
        return environment_radiance(features, scene, direction)
    if (features & Feature.ENVIRONMENT) == 0 or scene.lighting_level < 0:
        return wp.vec3(0.0, 0.0, 0.0)
    other = sky_density(scene, direction) / wp.float32(scene.light_count)
    radiance = map_radiance(scene, scene.lighting_level, scene.lighting_to_map, scene.lighting_scale, direction)
    return radiance * preferred(density, other)


@wp.func
def path_radiance(
    features: wp.int32,
    scene: SceneData,
    view: ViewData,
    time_s: wp.float64,
    draw: Draw,
    origin: wp.vec3,
    direction: wp.vec3,
    footprint_scale: wp.float32,
):
    """Like :func:`renderer.kernels.shading.radiance`, along one path; the continuing rays count as reflected rays."""
    total = wp.vec3(0.0, 0.0, 0.0)
    counts = wp.vec3i(0, 0, 0)
    first = FirstHit()
    first.instance = -1
    first.point = direction
    first.occluder = UNLIT
    weight = wp.vec3(1.0, 1.0, 1.0)
    start = wp.vec3(origin[0], origin[1], origin[2])
    towards = wp.vec3(direction[0], direction[1], direction[2])
    scattered_at = wp.vec3(origin[0], origin[1], origin[2])
    density = wp.float32(0.0)  # with which ``towards`` was sampled; zero for a perfect direction
    squeeze = wp.float32(1.0)
    travelled = wp.float32(0.0)
    bounces = wp.int32(0)
    passed = wp.int32(0)
    vertex = draw
    alive = wp.bool(True)
    while alive:
        alive = False
        vertex = branched(vertex, 0, 1, PURPOSE_VERTEX)
        hit = closest_hit(features, scene, view, time_s, start, towards, FAR)
        if hit.instance < 0:
            total = total + wp.cw_mul(weight, from_infinity(features, scene, towards, density))
        else:
            surface = surface_at(features, scene, view, time_s, hit, start, towards)
            record = scene.scattering[surface.material]
            material = scene.materials[surface.material]
            travelled = travelled + hit.t
            if bounces == 0 and passed == 0:
                first.instance = hit.instance
                first.point = surface.in_track
            slant = wp.max(wp.abs(wp.dot(surface.geometric_normal, towards)), SLANT_LEAST)
            footprint = footprint_scale * (view.width + view.spread * travelled) / slant * surface.uv_density
            chance = wp.vec2(0.0, 0.0)
            if (features & Feature.PASSING) != 0 or bounces >= ROULETTE_FIRST:
                chance = numbers(vertex, _CHANCE, bounces)
            there = wp.bool(True)
            if (features & Feature.PASSING) != 0:
                there = chance[0] < opacity_at(features, scene, record, surface, footprint)
            if not there:
                start = surface.position - surface.offset * surface.geometric_normal
                passed = passed + 1
                alive = passed < PASSED_MOST
            else:
                glow = record.emission
                if record.glow >= 0:
                    glow = wp.cw_mul(glow, texture_color(features, scene, record.glow, surface.uv, footprint))
                if not surface.inside and wp.max(surface.emission) > 0.0:
                    share = wp.float32(1.0)
                    light = scene.light_of_instance[hit.instance]
                    if density > 0.0 and light >= 0:
                        other = lamp_density(features, scene, view, time_s, light, scattered_at, towards, surface)
                        share = preferred(density, other / wp.float32(scene.light_count))
                    glow = glow + surface.emission * share
                total = total + wp.cw_mul(weight, glow)
                alive = bounces <= scene.depth and record.kind != ScatterKind.BLACK
                if alive and bounces >= ROULETTE_FIRST:
                    survival = wp.min(wp.max(weight) * squeeze, ROULETTE_MOST)
                    alive = chance[1] < survival
                    weight = weight / wp.max(survival, 1.0e-12)
                if alive:
                    if (features & Feature.BENT) != 0 and record.bend >= 0:
                        surface.normal = bent_normal(
                            features, scene, view, time_s, record, hit, surface, towards, footprint
                        )
                    frame = frame_about(surface.normal)
                    outgoing = frame * (-towards)
                    lobes = lobes_at(features, scene, surface, record, material, outgoing[2], footprint)
                    pick = numbers(vertex, _PICK, bounces)
                    if scene.light_count > 0:
                        place = numbers(vertex, _PLACE, bounces)
                        lit, rays = asked_light(
                            features, scene, view, time_s, surface, lobes, frame, outgoing, pick[0], place
                        )
                        total = total + wp.cw_mul(weight, lit)
                        counts[0] = counts[0] + rays
                    turn = numbers(vertex, _TURN, bounces)
                    chosen = chosen_of(features, lobes, outgoing, pick[1], turn)
                    onward = wp.normalize(wp.transpose(frame) * chosen.direction)
                    height = wp.dot(onward, surface.geometric_normal)
                    alive = wp.max(chosen.weight) > 0.0 and height * chosen.direction[2] > 0.0
                    weight = wp.cw_mul(weight, chosen.weight)
                    squeeze = squeeze / chosen.squeeze
                    side = wp.where(height > 0.0, 1.0, -1.0)
                    start = surface.position + (side * surface.offset) * surface.geometric_normal
                    if (features & Feature.PASSING) != 0 and chosen.passes:
                        passed = passed + 1
                        alive = alive and passed < PASSED_MOST
                    else:
                        towards = onward
                        density = chosen.density
                        scattered_at = surface.position
                        bounces = bounces + 1
                    if alive and side > 0.0:
                        counts[1] = counts[1] + 1
                    elif alive:
                        counts[2] = counts[2] + 1
    return total, counts, first
