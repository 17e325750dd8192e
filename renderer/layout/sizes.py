"""Sizes and tolerances that Python kernels, C++ kernels and the host share.

The C++ is compiled with :data:`GIVEN`; no header repeats one of these numbers.
"""

from __future__ import annotations

from renderer.layout.kinds import Filter, LightKind, Shape, StructureKind, TextureKind, Wrap

BLOCK_PX = 16
"""Side of the squares in which pixels are rendered: squares row by row, pixels along the Morton curve within one."""

WIDTH = 8
"""Number of children of a tree's node."""
NODE_FLOATS = 8 * WIDTH
"""Size of a node in units of four bytes: its children's boxes, the children, and padding to whole cache lines."""
BLOCK_WIDTH = 4
"""Number of triangles of a block."""
BLOCK_FLOATS = 10 * BLOCK_WIDTH
"""Size of a block in units of four bytes: for each triangle three corners of three coordinates, and its face."""
KD_FLOATS = 4
"""Size of a kd-tree's node in units of four bytes."""
KD_LEAF = 3
"""Value of the axis that marks a leaf in a kd-tree."""
KD_DEPTH_MAX = 20
"""Greatest depth of a kd-tree's leaves; the root has depth 0."""

LIT = -1
"""Occluder of a light that is visible."""
UNLIT = -2
"""Occluder of a light without a shadow ray: it lies behind the surface, or the surface reflects none of it."""

FAR = 1.0e30
"""Length of a ray without an end."""
TINY = 1.0e-20
"""Least absolute component of a direction in divisions."""
SHORT = 0.9999
"""Length of a shadow ray as a share of the distance to the light, so that the lamp's own shape is no occluder."""
OFFSET = 1.0e-6
"""Relative offset of a ray's origin from a surface: eight units in the last place of float32, because a hit passes two
transforms with several roundings each."""
SPHERE_SLACK = 4.0e-6
"""Relative rounding error of the squared distance from a distant origin to a sphere."""
SLERP_ANGLE_LEAST = 1.0e-3
"""Angle between two keys, radians, below which linear weights equal spherical ones in float32."""
EDGE_ON = 1.0e-3
"""Least cosine between a smooth normal and the direction to the viewer, after the normal is rotated back."""
ABOVE_LEAST = 1.0e-4
"""Least height of a mirrored direction above a surface."""
SLANT_LEAST = 1.0e-4
"""Least cosine by which the footprint of a ray is divided."""
SMOOTH_LEAST = 1.0e-12
"""Least squared length at which an interpolated normal is used."""
RING_LEAST = 1.0e-3
"""Least distance of a point of the unit sphere from its axis by which tangents are divided."""
PATCH_LEAST = 1.0e-30
"""Least area by which the density of texture coordinates is divided."""
UV_LEAST, UV_MOST = -8.0, 9.0
"""Bounds to which non-repeating texture coordinates are clamped: only the border is visible there, and texel indices
must fit into int32."""
TEXELS_MOST = 1.0e9
"""Greatest width of a ray's footprint, in texels."""

KINDS = {
    "SHAPE": Shape,
    "TEXTURE": TextureKind,
    "WRAP": Wrap,
    "FILTER": Filter,
    "LIGHT": LightKind,
    "STRUCTURE": StructureKind,
}

GIVEN: dict[str, float] = {
    **{name: value for name, value in globals().items() if name.isupper() and isinstance(value, int | float)},
    **{f"{prefix}_{kind.name}": int(kind) for prefix, kinds in KINDS.items() for kind in kinds},
}
"""Every number above, and every kind under a name such as ``SHAPE_MESH``."""
