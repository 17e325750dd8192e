"""Two scenes after the two images of the ray-tracer report, with as many polygons and the same effects.

The report shows a model over a box under an area light, with soft shadows and diffuse reflections; in its second image
the model is also refractive. The report does not name its models; a knotted tube replaces them here.

Source: Olszewski, "Distribution Ray Tracing", section "Results".
"""

from __future__ import annotations

import numpy as np

from scenes.animation import camera_to_world
from scenes.arithmetic import cos, sin
from scenes.canonical import (
    CheckerboardTexture,
    ConstantTexture,
    Cube,
    EnvironmentLight,
    Film,
    Glass,
    Instance,
    Integrator,
    Material,
    Mesh,
    PerspectiveCamera,
    Phong,
    Rectangle,
    Scene,
    SceneError,
)
from scenes.driving import sky
from scenes.effects.stage import facing_down, placed

IMAGES = ("report-one", "report-two")
"""Names of the scenes."""

SAMPLES = 32
"""Number of samples per pixel of both images."""

_BOX_FACES = 12 + 2  # triangles of the box and the floor, if they were meshes


def knotted_tube(around: int, along: int) -> Mesh:
    """A round tube along a trefoil knot: ``2 * around * along`` triangles with smooth normals, within 3 units of the
    origin."""
    t = np.linspace(0.0, 2.0 * np.pi, along, endpoint=False)
    center = np.stack(
        [
            sin(t) + 2.0 * sin(2.0 * t),
            cos(t) - 2.0 * cos(2.0 * t),
            -sin(3.0 * t),
        ],
        axis=1,
    )
    tangent = np.stack(
        [
            cos(t) + 4.0 * cos(2.0 * t),
            -sin(t) + 4.0 * sin(2.0 * t),
            -3.0 * cos(3.0 * t),
        ],
        axis=1,
    )
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    # the knot winds about the z axis, so that the radial direction is never along it
    side = center - (center * tangent).sum(axis=1, keepdims=True) * tangent
    side /= np.linalg.norm(side, axis=1, keepdims=True)
    turn = np.linspace(0.0, 2.0 * np.pi, around, endpoint=False)[None, :, None]
    normal = cos(turn) * side[:, None] + sin(turn) * np.cross(tangent, side)[:, None]
    vertices = center[:, None] + 0.42 * normal
    i, j = (part.ravel() for part in np.meshgrid(np.arange(along), np.arange(around), indexing="ij"))
    a, b = i * around + j, (i + 1) % along * around + j
    c, d = (i + 1) % along * around + (j + 1) % around, i * around + (j + 1) % around
    faces = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
    return Mesh(
        vertices.reshape(-1, 3).astype(np.float32),
        faces.astype(np.int32),
        normal.reshape(-1, 3).astype(np.float32),
        source="knot",
    )


def _scene(name: str, model: Mesh, material: Material, size_px: tuple[int, int], refraction_rays: int) -> Scene:
    squares = CheckerboardTexture(ConstantTexture((0.7, 0.66, 0.6)), ConstantTexture((0.32, 0.36, 0.42)), (20.0, 20.0))
    box = Phong(
        ConstantTexture((0.45, 0.36, 0.26)), fresnel_min=0.25, fresnel_max=0.7, ambient=0.6, mirror_spread_deg=14.0
    )
    heights = np.linspace(1.0, -1.0, 64)[:, None, None]
    haze = np.array([0.62, 0.68, 0.75]) + np.clip(heights, 0.0, 1.0) * np.array([-0.45, -0.4, -0.25])
    lamp = facing_down((-4.0, -5.0, 9.0), 1.6, 1.6)
    eye, target = np.array((2.4, -10.5, 4.6)), np.array((0.0, 0.0, 1.7))
    return Scene(
        PerspectiveCamera(camera_to_world(eye, target), 38.0, lens_radius=0.06, focal_distance=10.0),
        (
            Instance(Rectangle(), Phong(squares), placed((0, 6, -1.2), (24, 24, 1)), name="floor"),
            Instance(Cube(), box, placed((0, 0, -0.6), (3.6, 3.0, 0.6)), name="box"),
            Instance(model, material, placed((0, 0, 2.15), (0.82, 0.82, 1.45)), name="knot"),
            Instance(Rectangle(), Phong(ConstantTexture((0.5, 0.5, 0.5))), lamp, None, "lamp", (52.0, 49.0, 44.0)),
        ),
        film=Film(*size_px),
        integrator=Integrator(depth=4, reflection_rays=8, refraction_rays=refraction_rays),
        ambient=(0.12, 0.13, 0.15),
        background=EnvironmentLight(haze.astype(np.float32), sky.sky().to_world),
        name=name,
    )


def load(name: str) -> Scene:
    """One of the two scenes; its film has the size of the report's image.

    Raises:
        SceneError: no image has this name.
    """
    if name == "report-one":  # about 10,100 polygons; soft shadows, diffuse reflections, depth of field
        paint = Phong(
            ConstantTexture((0.55, 0.13, 0.1)),
            (0.35, 0.35, 0.35),
            60.0,
            fresnel_min=0.05,
            fresnel_max=0.6,
            mirror_spread_deg=8.0,
        )
        return _scene(name, knotted_tube(18, 280), paint, (1000, 800), 1)
    if name == "report-two":  # about 5,500 polygons; refraction in addition
        return _scene(name, knotted_tube(14, 196), Glass(ior=1.4, spread_deg=4.0), (800, 600), 8)
    raise SceneError(f"image: expected one of {', '.join(IMAGES)}, got {name!r}")


def polygon_count(scene: Scene) -> int:
    """Number of triangles of the meshes, and of those that would form the box and the floor."""
    meshes = [instance.shape for instance in scene.instances if isinstance(instance.shape, Mesh)]
    return sum(len(mesh.faces) for mesh in meshes) + _BOX_FACES
