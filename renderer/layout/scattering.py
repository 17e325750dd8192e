"""The memory layout of a material's scattering along paths."""

from __future__ import annotations

import warp as wp


@wp.struct
class ScatterRecord:
    """Scattering of a material along paths; ``kind`` is a :class:`renderer.layout.kinds.ScatterKind`.

    A negative texture means none. The parameters of Phong reflection and of spread mirrors are in the material's other
    record.
    """

    kind: wp.int32
    base: wp.int32  # diffuse colour, colour of a metal, or transmittance of glass
    specular: wp.int32  # factor of the reflection of a coat, a mirror or glass
    parts: wp.int32  # green multiplies the roughness, blue the metallic share
    alpha: wp.float32  # roughness of the facets
    rough: wp.vec2  # A and B of Oren and Nayar
    roughness: wp.float32
    metallic: wp.float32
    clear: wp.float32  # strength of a clear coat
    clear_alpha: wp.float32
    ior: wp.float32
    thin: wp.int32
    eta: wp.vec3
    k: wp.vec3
    beckmann: wp.int32  # 1 if the facets have the distribution of Beckmann
    inner: wp.float32  # internal diffuse reflectance of a coat
    passed_low: wp.vec4  # coefficients of the transmittance of a rough coat minus that of a smooth one, lowest power
    passed_high: wp.vec4  # first
    glow: wp.int32
    emission: wp.vec3
    opacity: wp.int32
    cutoff: wp.float32  # opacity below which there is a hole; negative if opacity is the share of light stopped
    bend: wp.int32  # normal map or bump map
    bend_scale: wp.float32
    bumps: wp.int32  # 1 if ``bend`` is a bump map
