"""First hits of camera rays without shading, for the auxiliary layers of a picture."""

from __future__ import annotations

from functools import cache

import warp as wp

from renderer.kernels.camera import camera_ray
from renderer.kernels.intersect import MODULE_OPTIONS, closest_hit
from renderer.kernels.randomness import group_draw
from renderer.kernels.surface import surface_at
from renderer.kernels.textures import texture_color
from renderer.layout.features import Feature
from renderer.layout.sizes import FAR, SLANT_LEAST
from renderer.layout.structs import SceneData, ViewData

_SEEN = (
    Feature.MESH | Feature.SPHERE | Feature.FLAT | Feature.CUBE | Feature.HEIGHT_FIELD | Feature.MOTION | Feature.LENS
    | Feature.PARALLEL | Feature.PANORAMA | Feature.IMAGE | Feature.CHECKERBOARD | Feature.WARP_TREES | Feature.PATHS
)  # fmt: skip


@cache
def guides(features: Feature) -> wp.Kernel:
    """A kernel for those features of a set that determine camera rays and their first hits; the same object for the
    same set."""
    mask = int(features & _SEEN)
    name = f"renderer.kernels.guides_{mask:08x}"
    wp.get_module(name).options.update(MODULE_OPTIONS)

    @wp.kernel(enable_backward=False, module=name)
    def guide_samples(
        scene: SceneData,
        view: ViewData,
        first: wp.int32,
        group_size: wp.int32,
        position: wp.array(dtype=wp.vec2),
        time_s: wp.array(dtype=wp.float64),
        instance: wp.array(dtype=wp.int32),
        point: wp.array(dtype=wp.vec3),
        distance: wp.array(dtype=wp.float32),
        normal: wp.array(dtype=wp.vec3),
        albedo: wp.array(dtype=wp.vec3),
    ):
        """Stores the first hits of the samples from ``first`` on. For a miss the instance is -1, the point is the ray's
        direction, and the rest is zero."""
        i = first + wp.tid()
        leader = (i / group_size) * group_size
        draw = group_draw(scene.seed, position[leader], time_s[leader], i - leader, group_size)
        origin, direction = camera_ray(wp.static(mask), scene, view, draw, position[i], time_s[i])
        hit = closest_hit(wp.static(mask), scene, view, time_s[i], origin, direction, FAR)
        instance[i] = hit.instance
        point[i] = direction
        distance[i] = 0.0
        normal[i] = wp.vec3(0.0, 0.0, 0.0)
        albedo[i] = wp.vec3(0.0, 0.0, 0.0)
        if hit.instance >= 0:
            surface = surface_at(wp.static(mask), scene, view, time_s[i], hit, origin, direction)
            slant = wp.max(wp.abs(wp.dot(surface.geometric_normal, direction)), SLANT_LEAST)
            footprint = (view.width + view.spread * hit.t) / slant * surface.uv_density
            point[i] = surface.in_track
            distance[i] = hit.t
            normal[i] = surface.normal
            material = scene.materials[surface.material]
            texture = wp.int32(material.diffuse)
            if texture < 0:
                texture = material.transmission
            if texture < 0:
                texture = material.mirror
            if wp.static((mask & int(Feature.PATHS)) != 0):
                record = scene.scattering[surface.material]
                texture = wp.where(record.base >= 0, record.base, record.specular)
            if texture >= 0:
                albedo[i] = texture_color(wp.static(mask), scene, texture, surface.uv, footprint)

    return guide_samples
