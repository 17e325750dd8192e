"""Kernels that trace sixteen neighbouring samples at once, the fast path of the CPU.

Sixteen consecutive samples on the Morton curve are a block of 4 x 4, so their rays are coherent. The C++ in ``native/``
traces them together in vector registers; Warp's compiler builds it with these kernels.
:func:`renderer.kernels.entry.shade_samples` is the same computation for one sample in Python, which CUDA runs and with
which tests compare.
"""

from __future__ import annotations

import warp as wp

from renderer.compute.launching import Address
from renderer.compute.native_code import module_options
from renderer.layout import sizes
from renderer.layout.features import PACKETS, Feature
from renderer.layout.structs import SceneData, ViewData


@wp.struct
class SingleQueries:
    """Rays through one mesh, and arrays for their hits: ``face`` is -1 for a miss, or a flag where any hit suffices."""

    origin: wp.array(dtype=wp.vec3)
    direction: wp.array(dtype=wp.vec3)
    reach: wp.array(dtype=wp.float32)
    face: wp.array(dtype=wp.int32)
    t: wp.array(dtype=wp.float32)
    u: wp.array(dtype=wp.float32)
    v: wp.array(dtype=wp.float32)


def suffice_for(features: Feature) -> bool:
    """Whether packets support all features of a set."""
    return features | PACKETS == PACKETS


wp.set_module_options(module_options("queries.h", "samples.h", given=sizes.GIVEN))


@wp.func_native("packets::build_tree(vertices, faces, boxes, order, nodes, blocks, counts);")
def native_build_tree(
    vertices: wp.array(dtype=wp.vec3),
    faces: wp.array(dtype=wp.vec3i),
    boxes: wp.array(dtype=wp.float32),
    order: wp.array(dtype=wp.int32),
    nodes: wp.array(dtype=wp.float32),
    blocks: wp.array(dtype=wp.float32),
    counts: wp.array(dtype=wp.int32),
): ...


@wp.func_native("packets::trace_single(scene, rays, ray, nearest != 0, (long long*)work.data);")
def native_trace_single(
    scene: SceneData, rays: SingleQueries, ray: wp.int32, nearest: wp.int32, work: wp.array(dtype=wp.int64)
): ...


@wp.func_native("packets::trace_queries(*(const packets::Queries*)rays, first, end, nearest != 0);")
def native_trace_queries(rays: Address, first: wp.int32, end: wp.int32, nearest: wp.int32): ...


@wp.func_native(
    """
    packets::shade_samples(scene, view, (int*)taken,
                           {count, (const float*)position, (const double*)time_s, (const float*)footprint_scale,
                            (float*)color, (int*)instance, (float*)point, (int*)occluder},
                           (long long*)rays);
    """
)
def native_shade_samples(
    scene: SceneData,
    view: ViewData,
    taken: Address,
    count: wp.int32,
    position: Address,
    time_s: Address,
    footprint_scale: Address,
    color: Address,
    instance: Address,
    point: Address,
    occluder: Address,
    rays: Address,
): ...


@wp.func_native("packets::render_pixels(scene, view, taken.data, samples, time_s, image);")
def native_render_pixels(
    scene: SceneData,
    view: ViewData,
    taken: wp.array(dtype=wp.int32),
    samples: wp.int32,
    time_s: wp.float64,
    image: wp.array2d(dtype=wp.vec3),
): ...


@wp.kernel(enable_backward=False)
def build_tree(
    vertices: wp.array(dtype=wp.vec3),
    faces: wp.array(dtype=wp.vec3i),
    boxes: wp.array(dtype=wp.float32),
    order: wp.array(dtype=wp.int32),
    nodes: wp.array(dtype=wp.float32),
    blocks: wp.array(dtype=wp.float32),
    counts: wp.array(dtype=wp.int32),
):
    """Fills ``nodes`` and ``blocks``, and ``counts`` with the number of each; ``boxes`` and ``order`` are scratch."""
    native_build_tree(vertices, faces, boxes, order, nodes, blocks, counts)


@wp.kernel(enable_backward=False)
def trace_singles(
    scene: SceneData, rays: SingleQueries, first: wp.int32, nearest: wp.int32, work: wp.array(dtype=wp.int64)
):
    """Traces one ray per thread through the scene's first mesh, from ray ``first`` on, and sums the work."""
    native_trace_single(scene, rays, first + wp.tid(), nearest, work)


@wp.kernel(enable_backward=False)
def trace_queries(rays: Address, first: wp.int32, end: wp.int32, nearest: wp.int32):
    """Traces the rays from ``first`` up to ``end`` of the record ``Queries`` in ``native/queries.h``."""
    native_trace_queries(rays, first, end, nearest)


@wp.kernel(enable_backward=False)
def shade_samples(
    scene: SceneData,
    view: ViewData,
    taken: Address,
    count: wp.int32,
    position: Address,
    time_s: Address,
    footprint_scale: Address,
    color: Address,
    instance: Address,
    point: Address,
    occluder: Address,
    rays: Address,
):
    """Like the kernel of the same name in ``entry.py``, for all samples that no other launch has taken.

    Host threads launch it in parallel, with the same counter ``taken``, which starts at zero. ``rays`` receives the
    totals. Arrays are passed as addresses, because a launch is recorded once; zero stands for arrays that are not given
    or not requested.
    """
    native_shade_samples(
        scene, view, taken, count, position, time_s, footprint_scale, color, instance, point, occluder, rays
    )


@wp.kernel(enable_backward=False)
def render_pixels(
    scene: SceneData,
    view: ViewData,
    taken: wp.array(dtype=wp.int32),
    samples: wp.int32,
    time_s: wp.float64,
    image: wp.array2d(dtype=wp.vec3),
):
    """Like the kernel of the same name in ``entry.py``, shared between launches as :func:`shade_samples` is."""
    native_render_pixels(scene, view, taken, samples, time_s, image)
