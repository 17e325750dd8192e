"""Optional features of the renderer, which a scene may not need.

Each feature is one bit. Kernels are compiled for a set of them (:func:`renderer.kernels.entry.specialised`): code for
other features is not compiled at all.
"""

from __future__ import annotations

from enum import IntFlag, auto


class Feature(IntFlag):
    """Optional features of the renderer, which a scene may not need."""

    MESH = auto()
    SPHERE = auto()
    FLAT = auto()
    CUBE = auto()
    HEIGHT_FIELD = auto()
    MOTION = auto()
    LENS = auto()
    PARALLEL = auto()
    PANORAMA = auto()
    IMAGE = auto()
    CHECKERBOARD = auto()
    HIGHLIGHT = auto()
    MIRROR = auto()
    GLOSSY = auto()
    GLASS = auto()
    MANY_RAYS = auto()
    SKY = auto()
    POINT = auto()
    DIRECTIONAL = auto()
    SUN_DISC = auto()
    SPOT = auto()
    QUAD = auto()
    SPHERE_LIGHT = auto()
    ENVIRONMENT = auto()
    ALL_CELLS = auto()
    WARP_TREES = auto()
    PATHS = auto()
    FACETS = auto()
    PASSING = auto()
    BENT = auto()


ALL = Feature((1 << len(Feature)) - 1) & ~Feature.PATHS
"""All features of one integrator, the tree of rays; with :attr:`Feature.PATHS`, those of path tracing."""

PACKETS = (
    Feature.MESH
    | Feature.SPHERE
    | Feature.FLAT
    | Feature.CUBE
    | Feature.MOTION
    | Feature.IMAGE
    | Feature.CHECKERBOARD
    | Feature.HIGHLIGHT
    | Feature.MIRROR
    | Feature.SKY
    | Feature.POINT
    | Feature.DIRECTIONAL
)
"""Features that the packets of ``native/`` support."""

RANDOM = (
    Feature.LENS
    | Feature.GLOSSY
    | Feature.SUN_DISC
    | Feature.QUAD
    | Feature.SPHERE_LIGHT
    | Feature.ENVIRONMENT
    | Feature.PATHS
)
"""Features for which a sample draws random numbers."""

MEANING = {
    Feature.MESH: "triangle meshes",
    Feature.SPHERE: "spheres",
    Feature.FLAT: "rectangles and disks",
    Feature.CUBE: "cubes",
    Feature.HEIGHT_FIELD: "height fields",
    Feature.MOTION: "poses at each ray's own time",
    Feature.LENS: "thin lens",
    Feature.PARALLEL: "parallel projection",
    Feature.PANORAMA: "view of the whole sphere",
    Feature.IMAGE: "image textures",
    Feature.CHECKERBOARD: "checkerboards",
    Feature.HIGHLIGHT: "Phong highlights",
    Feature.MIRROR: "mirrored rays",
    Feature.GLOSSY: "rays spread about a perfect direction",
    Feature.GLASS: "refraction",
    Feature.MANY_RAYS: "several rays at the first glossy surface",
    Feature.SKY: "a background",
    Feature.POINT: "point lights",
    Feature.DIRECTIONAL: "directional lights",
    Feature.SUN_DISC: "directional lights with an angle",
    Feature.SPOT: "spot lights",
    Feature.QUAD: "rectangles that give light",
    Feature.SPHERE_LIGHT: "spheres that give light",
    Feature.ENVIRONMENT: "light from the environment map",
    Feature.ALL_CELLS: "a shadow ray to every cell of a light",
    Feature.WARP_TREES: "Warp's own trees over meshes, as on a GPU",
    Feature.PATHS: "light between surfaces, along paths",
    Feature.FACETS: "surfaces of facets: rough metal and glass, coats",
    Feature.PASSING: "holes, and panes that shadow rays pass",
    Feature.BENT: "normal and bump maps",
}
