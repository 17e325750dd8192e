"""Enumerations of the kinds in records."""

from __future__ import annotations

from enum import IntEnum


class Shape(IntEnum):
    """Kinds of shapes of instances."""

    MESH, SPHERE, DISK, RECTANGLE, CUBE, RELIEF = range(6)


class TextureKind(IntEnum):
    """Kinds of texture nodes."""

    CONSTANT, IMAGE, CHECKERBOARD = range(3)


class Wrap(IntEnum):
    """Values of a texture outside its image."""

    REPEAT, CLAMP, BLACK = range(3)


class Filter(IntEnum):
    """Filters of image lookup."""

    NEAREST, BILINEAR, MIPMAP = range(3)


class LightKind(IntEnum):
    """Kinds of lights."""

    POINT, DIRECTIONAL, SUN_DISC, SPOT, QUAD, SPHERE, ENVIRONMENT = range(7)


class CameraKind(IntEnum):
    """Kinds of camera projections."""

    PERSPECTIVE, PARALLEL, PANORAMA = range(3)


class ScatterKind(IntEnum):
    """Kinds of scattering by surfaces along paths."""

    BLACK, DIFFUSE, PHONG, MIRROR, METAL, GLASS, COATED, METALLIC = range(8)


class StructureKind(IntEnum):
    """Kinds of acceleration structures over the triangles of a mesh."""

    BVH, KDTREE, BRUTE = range(3)
