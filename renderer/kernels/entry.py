"""Kernel entry points: index, load, call, store.

Shading kernels are compiled for the features of a scene (:func:`specialised`).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from pathlib import Path

import warp as wp

from renderer.kernels.camera import camera_ray, track_rotation, track_translation
from renderer.kernels.intersect import MODULE_OPTIONS
from renderer.kernels.paths import path_radiance
from renderer.kernels.randomness import group_draw
from renderer.kernels.shading import radiance
from renderer.layout.features import ALL, Feature
from renderer.layout.sizes import BLOCK_PX
from renderer.layout.structs import Draw, Ray, SceneData, ViewData


@dataclass(frozen=True)
class ShadingKernels:
    """Kernels for one set of features.

    Attributes:
        shade_samples: shades a list of samples in groups.
        render_pixels: shades a regular grid of samples in every pixel and averages them. None for paths, whose kernels
            take long to compile.
        module: module that contains both, for loading.
    """

    shade_samples: wp.Kernel
    render_pixels: wp.Kernel | None
    module: wp.Module


_MODULE = "renderer.kernels.shading_"

SETS_MAX = 24
"""Maximum number of sets of features for which one process compiles kernels; further scenes use kernels with all
features."""


def compiled_count() -> int:
    """Number of sets of features for which this process has kernels."""
    return specialised.cache_info().currsize


def kept_count() -> int:
    """Number of sets of features for which compiled kernels are cached on this machine, from this and earlier
    revisions."""
    folders = Path(wp.config.kernel_cache_dir or "").glob(f"wp_{_MODULE}*")
    return len({folder.name.removeprefix(f"wp_{_MODULE}")[:8] for folder in folders if folder.is_dir()})


def nearest(features: Feature) -> Feature:
    """The set for which kernels for ``features`` are compiled: that set itself, or all features once the maximum number
    of sets is reached."""
    if features in _asked or len(_asked) < SETS_MAX:
        _asked.add(features)
        return features
    return ALL | features & Feature.PATHS


_asked: set[Feature] = set()


@cache
def specialised(features: Feature) -> ShadingKernels:
    """Kernels for ``features`` that contain no code for other features; the same object for the same set."""
    mask = int(features)
    transport = along_path if Feature.PATHS in features else radiance
    name = f"{_MODULE}{mask:08x}"
    wp.get_module(name).options.update(MODULE_OPTIONS)

    @wp.kernel(enable_backward=False, module=name)
    def shade_samples(
        scene: SceneData,
        view: ViewData,
        stack: wp.array2d(dtype=Ray),
        first: wp.int32,
        group_size: wp.int32,
        position: wp.array(dtype=wp.vec2),
        time_s: wp.array(dtype=wp.float64),
        footprint_scale: wp.array(dtype=wp.float32),
        color: wp.array(dtype=wp.vec3),
        instance: wp.array(dtype=wp.int32),
        point: wp.array(dtype=wp.vec3),
        occluder: wp.array(dtype=wp.int32),
        rays: wp.array(dtype=wp.vec3i),
    ):
        """Shades the samples from ``first`` on; ``rays`` receives the numbers of shadow, reflected and refracted rays
        of each.

        ``footprint_scale``, and the three arrays of first hits, may be empty.
        """
        i = first + wp.tid()
        leader = (i / group_size) * group_size
        draw = group_draw(scene.seed, position[leader], time_s[leader], i - leader, group_size)
        origin, direction = camera_ray(wp.static(mask), scene, view, draw, position[i], time_s[i])
        factor = wp.float32(1.0)
        if footprint_scale.shape[0] > 0:
            factor = footprint_scale[i]
        result, counts, hit = transport(
            wp.static(mask), scene, view, time_s[i], draw, origin, direction, factor, stack, wp.tid()
        )  # fmt: skip
        color[i] = result
        if instance.shape[0] > 0:
            instance[i] = hit.instance
            point[i] = hit.point
            occluder[i] = hit.occluder
        rays[i] = counts

    if Feature.PATHS in features:
        return ShadingKernels(shade_samples, None, shade_samples.module)

    @wp.kernel(enable_backward=False, module=name)
    def render_pixels(
        scene: SceneData,
        view: ViewData,
        stack: wp.array2d(dtype=Ray),
        first: wp.int32,
        samples: wp.int32,
        time_s: wp.float64,
        image: wp.array2d(dtype=wp.vec3),
    ):
        """Renders pixels from number ``first`` on, each the mean of a regular grid of ``samples`` squared samples.
        Pixels are numbered along the Morton curve within blocks of ``BLOCK_PX`` squared pixels, and the blocks row by
        row."""
        pixel = first + wp.tid()
        height = image.shape[0]
        width = image.shape[1]
        columns = (width + BLOCK_PX - 1) / BLOCK_PX
        block = pixel / (BLOCK_PX * BLOCK_PX)
        within = pixel % (BLOCK_PX * BLOCK_PX)
        column = (block % columns) * BLOCK_PX + every_second_bit(within)
        row = (block / columns) * BLOCK_PX + every_second_bit(within >> 1)
        if column < width and row < height:
            total = wp.vec3(0.0, 0.0, 0.0)
            leader = grid_position(column, row, 0, samples, width, height)
            for sample in range(samples * samples):
                position = grid_position(column, row, sample, samples, width, height)
                draw = group_draw(scene.seed, leader, time_s, sample, samples * samples)
                origin, direction = camera_ray(wp.static(mask), scene, view, draw, position, time_s)
                result, _counts, _hit = transport(
                    wp.static(mask), scene, view, time_s, draw, origin, direction, 1.0, stack, wp.tid()
                )  # fmt: skip
                total = total + result
            image[row, column] = total * (1.0 / wp.float32(samples * samples))

    return ShadingKernels(shade_samples, render_pixels, shade_samples.module)


@wp.func
def along_path(
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
    """Radiance along one path, with the arguments of the tree of rays; the stack is not used."""
    total, counts, first = path_radiance(features, scene, view, time_s, draw, origin, direction, footprint_scale)
    return total, counts, first


@wp.func
def every_second_bit(code: wp.int32) -> wp.int32:
    """Bits 0, 2, 4 and 6 of a Morton code as a number."""
    return (code & 1) | ((code >> 1) & 2) | ((code >> 2) & 4) | ((code >> 3) & 8)


@wp.func
def grid_position(
    column: wp.int32, row: wp.int32, sample: wp.int32, samples: wp.int32, width: wp.int32, height: wp.int32
) -> wp.vec2:
    """Position on the image of a sample of a pixel's regular grid."""
    x = column * samples + sample % samples
    y = row * samples + sample / samples
    return wp.vec2(
        (wp.float32(x) + 0.5) / wp.float32(width * samples), (wp.float32(y) + 0.5) / wp.float32(height * samples)
    )


@wp.kernel(enable_backward=False)
def pose_tracks(
    scene: SceneData,
    view: ViewData,
    translation: wp.array(dtype=wp.vec3),
    rotation: wp.array(dtype=wp.quat),
    time_s: wp.float64,
):
    """Poses of all tracks at one time, with the same bits as those computed for a sample."""
    track = wp.tid()
    translation[track] = track_translation(scene, view, track, time_s)
    rotation[track] = track_rotation(scene, view, track, time_s)
