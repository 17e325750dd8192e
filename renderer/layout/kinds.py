"""Kinds of things that records name by a number."""

from __future__ import annotations

from enum import IntEnum


class Shape(IntEnum):
    """Shapes of instances."""

    MESH, SPHERE, DISK, RECTANGLE, CUBE, RELIEF = range(6)


class TextureKind(IntEnum):
    """Nodes of a texture."""

    CONSTANT, IMAGE, CHECKERBOARD = range(3)


class Wrap(IntEnum):
    """What lies outside an image."""

    REPEAT, CLAMP, BLACK = range(3)


class Filter(IntEnum):
    """How an image is looked up."""

    NEAREST, BILINEAR, MIPMAP = range(3)


class LightKind(IntEnum):
    """Lights."""

    POINT, DIRECTIONAL, SUN_DISC, SPOT, QUAD, SPHERE, ENVIRONMENT = range(7)


class CameraKind(IntEnum):
    """Projections."""

    PERSPECTIVE, PARALLEL, PANORAMA = range(3)


class ScatterKind(IntEnum):
    """How surfaces scatter light along paths."""

    BLACK, DIFFUSE, PHONG, MIRROR, METAL, GLASS, COATED, METALLIC = range(8)


class StructureKind(IntEnum):
    """Acceleration structures over the triangles of a mesh."""

    BVH, KDTREE, BRUTE = range(3)
