"""Secondary rays: mirrored and refracted ones, spread about a perfect direction; all but one wait on a stack."""

from __future__ import annotations

import warp as wp

from renderer.kernels.randomness import PURPOSE_REFLECT, branched, cone_direction, draw_2d
from renderer.layout.features import Feature
from renderer.layout.sizes import ABOVE_LEAST
from renderer.layout.structs import MaterialRecord, Ray, Surface


@wp.func
def above(towards: wp.vec3, normal: wp.vec3) -> wp.vec3:
    """A direction moved above a surface where a smooth normal or the spread of rays would send it below."""
    height = wp.dot(towards, normal)
    if height < ABOVE_LEAST:
        towards = towards + (ABOVE_LEAST - height) * normal
    return wp.normalize(towards)


@wp.func
def mirror_direction(surface: Surface, direction: wp.vec3) -> wp.vec3:
    """The mirrored viewing direction, kept above the true surface."""
    mirrored = direction - 2.0 * wp.dot(direction, surface.normal) * surface.normal
    return above(mirrored, surface.geometric_normal)


@wp.func
def sent_on(
    features: wp.int32,
    surface: Surface,
    material: MaterialRecord,
    ray: Ray,
    perfect: wp.vec3,
    weight: wp.vec3,
    number: wp.int32,
    rays: wp.int32,
    purpose: wp.int32,
) -> Ray:
    """One of ``rays`` secondary rays about a perfect direction: above the surface for reflection, below it for
    refraction."""
    side = wp.where(purpose == PURPOSE_REFLECT, 1.0, -1.0)
    normal = side * surface.geometric_normal
    child = Ray()
    child.draw = branched(ray.draw, number, rays, purpose)
    child.start = surface.position + surface.offset * normal
    child.towards = perfect
    if (features & Feature.GLOSSY) != 0 and material.cos_spread < 1.0:
        spread = cone_direction(perfect, material.cos_spread, draw_2d(child.draw, purpose))
        child.towards = above(spread, normal)
    child.weight = weight
    child.travelled = ray.travelled
    child.bounces = ray.bounces + 1
    return child


@wp.func
def leave_waiting(
    features: wp.int32,
    surface: Surface,
    material: MaterialRecord,
    ray: Ray,
    perfect: wp.vec3,
    weight: wp.vec3,
    first: wp.int32,
    rays: wp.int32,
    purpose: wp.int32,
    stack: wp.array2d(dtype=Ray),
    row: wp.int32,
    waiting: wp.int32,
) -> wp.int32:
    """Pushes the rays ``first`` to ``rays - 1`` of a bundle of equal weights on the stack; returns the number of
    waiting rays."""
    for number in range(first, rays):
        stack[row, waiting] = sent_on(features, surface, material, ray, perfect, weight, number, rays, purpose)
        waiting = waiting + 1
    return waiting


@wp.func
def bundle_size(features: wp.int32, material: MaterialRecord, ray: Ray, rays: wp.int32) -> wp.int32:
    """Number of rays about a perfect direction: several at the first surface if its material spreads them, else one."""
    if (features & Feature.MANY_RAYS) != 0 and ray.bounces == 0 and material.cos_spread < 1.0:
        return rays
    return 1


def stack_size(features: Feature, depth: int, reflection_rays: int, refraction_rays: int) -> int:
    """Maximum number of rays that wait at once while one camera ray is followed.

    The first surface leaves at most ``refraction_rays + reflection_rays - 1`` waiting rays, each deeper one a single
    ray.
    """
    if not features & (Feature.GLASS | Feature.MANY_RAYS):
        return 1
    bundles = reflection_rays + refraction_rays if features & Feature.MANY_RAYS else 2
    return bundles + depth
