"""Sizes and tolerances that the kernels in Python, those in C++ and the host share.

:data:`GIVEN` is what the C++ is compiled with: no header repeats one of these numbers.
"""

from __future__ import annotations

from renderer.layout.kinds import Filter, LightKind, Shape, StructureKind, TextureKind, Wrap

BLOCK_PX = 16
"""Pixels are rendered in squares of this side, by rows, and along the Morton curve within a square."""

WIDTH = 8
"""Children of a tree's node."""
NODE_FLOATS = 8 * WIDTH
"""Size of a node in units of four bytes: the sides of its children's boxes, the children, and a fill to whole lines."""
BLOCK_WIDTH = 4
"""Triangles of a block."""
BLOCK_FLOATS = 10 * BLOCK_WIDTH
"""Size of a block in units of four bytes: three corners of three coordinates, and the face, of each triangle."""
KD_FLOATS = 4
"""Size of a kd-tree's node in units of four bytes."""
KD_LEAF = 3
"""Stands for the axis of a leaf in a kd-tree."""
KD_DEPTH_MAX = 20
"""Depth of a kd-tree's deepest leaf, the root's being 0."""

LIT = -1
"""Stands for the occluder of a light that is seen."""
UNLIT = -2
"""Stands for the occluder of a light that is not asked: it lies behind the surface, or the surface reflects none."""

FAR = 1.0e30
"""How far a ray reaches that has no end of its own."""
TINY = 1.0e-20
"""Least component of a direction that is divided by."""
SHORT = 0.9999
"""Share of the way to a light that its shadow ray goes: the lamp's own shape there does not count as an occluder."""
OFFSET = 1.0e-6
"""By which a ray starts off a surface, in the sizes that are involved: eight units in the last place of float32, for a
hit is carried through two transforms of some roundings each."""
SPHERE_SLACK = 4.0e-6
"""What rounding takes from the squared distance of a far start to a sphere, as a share of it."""
SLERP_ANGLE_LEAST = 1.0e-3
"""Angle between two keys, radians, below which linear weights differ by less than float32 can tell."""
EDGE_ON = 1.0e-3
"""Least cosine between a smooth normal and the viewer, after it is bent back."""
ABOVE_LEAST = 1.0e-4
"""Least height of a mirrored direction above a surface."""
SLANT_LEAST = 1.0e-4
"""Least cosine that the footprint of a ray is divided by."""
SMOOTH_LEAST = 1.0e-12
"""Least squared length of a normal between those of the corners that is taken."""
RING_LEAST = 1.0e-3
"""Least distance of a point of the unit sphere from its axis that tangents are divided by."""
PATCH_LEAST = 1.0e-30
"""Least area that the density of texture coordinates is divided by."""
UV_LEAST, UV_MOST = -8.0, 9.0
"""Where texture coordinates that do not repeat are cut off: only the border is seen there, and texel indices must stay
within int32."""
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
"""Every number above, and every kind as ``SHAPE_MESH``."""
