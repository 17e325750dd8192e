"""The record of how a material scatters light along paths, as it lies in memory."""

from __future__ import annotations

import warp as wp


@wp.struct
class ScatterRecord:
    """How a material scatters light along paths; of its kind see :class:`renderer.layout.kinds.ScatterKind`.

    A negative texture means none. What Phong reflection and spread mirrors need stands in the material's other record.
    """

    kind: wp.int32
    base: wp.int32  # colour: diffuse, of a metal, or of what glass lets through
    specular: wp.int32  # what multiplies the reflection of a coat, a mirror or glass
    parts: wp.int32  # green multiplies the roughness, blue the share of metal
    alpha: wp.float32  # of the facets
    rough: wp.vec2  # Oren and Nayar's A and B
    roughness: wp.float32
    metallic: wp.float32
    clear: wp.float32  # strength of a clear coat
    clear_alpha: wp.float32
    ior: wp.float32
    thin: wp.int32
    eta: wp.vec3
    k: wp.vec3
    inner: wp.float32  # share of diffuse light that a coat throws back inside
    glow: wp.int32
    emission: wp.vec3
    opacity: wp.int32
    cutoff: wp.float32  # opacity below which there is a hole; negative where it is the share of light that is stopped
    bend: wp.int32  # normal map, or height of a bump map
    bend_scale: wp.float32
    bumps: wp.int32  # 1 where ``bend`` is a height
