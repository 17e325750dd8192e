"""The canonical scene: one typed description that built-in scenes and importers fill and the renderer reads.

Conventions, fixed here once:

* World space is right-handed; lengths are in scene units (metres in the built-in scenes). No axis is "up".
* A transform is a ``(4, 4)`` float64 matrix acting on column vectors, object (or camera) to world.
* A camera looks along its local ``-z`` with ``+x`` to the right and ``+y`` up; image coordinates run from the top left
  corner ``(0, 0)`` to the bottom right ``(1, 1)``.
* An untransformed environment map gives direction ``(sin 2πu sin θ, cos θ, -cos 2πu sin θ)`` the texel at ``u`` from
  the left and polar angle ``θ`` from the top row.
* Colours and radiances are linear RGB with Rec. 709 primaries, float32.
* Texture coordinates have ``v = 0`` at the bottom row of the image.

Source: Hagemann 2018, sec. 4.2 and table 4.1 (which constructs a common scene must hold).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from scenes.canonical.lights import DirectionalLight, EnvironmentLight, Light, PointLight, SpotLight, SunSky
from scenes.canonical.materials import (
    Bumped,
    CheckerboardTexture,
    ConstantTexture,
    Emissive,
    Glass,
    Glossy,
    HeightField,
    ImageTexture,
    Masked,
    Material,
    Matte,
    Metal,
    Mirror,
    MixMaterial,
    MixTexture,
    Phong,
    Plastic,
    ScaleTexture,
    Texture,
    Translucent,
    Uber,
)
from scenes.canonical.values import Matrix, Rgb, RigidTrack, SceneError, identity

__all__ = [
    "Bumped",
    "Camera",
    "CheckerboardTexture",
    "ConstantTexture",
    "Cube",
    "DirectionalLight",
    "Disk",
    "Emissive",
    "EnvironmentCamera",
    "EnvironmentLight",
    "Film",
    "Glass",
    "Glossy",
    "HeightField",
    "ImageTexture",
    "Instance",
    "Integrator",
    "Light",
    "Masked",
    "Material",
    "Matrix",
    "Matte",
    "Mesh",
    "Metal",
    "Mirror",
    "MixMaterial",
    "MixTexture",
    "OrthographicCamera",
    "PerspectiveCamera",
    "Phong",
    "Plastic",
    "PointLight",
    "RealisticCamera",
    "Rectangle",
    "Rgb",
    "RigidTrack",
    "Sampler",
    "ScaleTexture",
    "Scene",
    "SceneError",
    "Shape",
    "Sphere",
    "SpotLight",
    "SunSky",
    "Texture",
    "Translucent",
    "Uber",
    "identity",
]

# --- shapes and instances --------------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class Mesh:
    """An indexed triangle mesh in object space.

    Attributes:
        vertices: ``(v, 3)`` float32, or float64 where they are far from their origin.
        faces: ``(f, 3)`` int32, counter-clockwise seen from outside.
        normals: ``(v, 3)`` float32 unit shading normals, or None for face normals.
        uvs: ``(v, 2)`` float32, or None for zero.
    """

    vertices: NDArray[np.floating]
    faces: NDArray[np.int32]
    normals: NDArray[np.float32] | None = None
    uvs: NDArray[np.float32] | None = None
    source: str = ""

    def __post_init__(self) -> None:
        count = self.vertices.shape[0]
        if self.vertices.ndim != 2 or self.vertices.shape[1] != 3 or self.faces.ndim != 2 or self.faces.shape[1] != 3:
            raise SceneError(
                f"Mesh {self.source!r}: expected vertices (v, 3) and faces (f, 3), got {self.vertices.shape} "
                f"and {self.faces.shape}"
            )
        if self.faces.shape[0] == 0:
            raise SceneError(f"Mesh {self.source!r}: expected at least one face, got none")
        if not np.isfinite(self.vertices).all():
            raise SceneError(f"Mesh {self.source!r}: vertices hold non-finite values")
        if self.faces.min() < 0 or self.faces.max() >= count:
            raise SceneError(f"Mesh {self.source!r}: a face refers to a vertex outside 0..{count - 1}")
        for name, array, width in (("normals", self.normals, 3), ("uvs", self.uvs, 2)):
            if array is not None and array.shape != (count, width):
                raise SceneError(f"Mesh {self.source!r}: expected {name} ({count}, {width}), got {array.shape}")


@dataclass(frozen=True)
class Sphere:
    """A sphere about the object-space origin."""

    radius: float = 1.0


@dataclass(frozen=True)
class Disk:
    """A disk in the object-space plane ``z = 0``, normal ``+z``."""

    radius: float = 1.0


@dataclass(frozen=True)
class Rectangle:
    """The square ``[-1, 1]²`` in the object-space plane ``z = 0``, normal ``+z``, uv from (0, 0) to (1, 1)."""


@dataclass(frozen=True)
class Cube:
    """The cube ``[-1, 1]³`` in object space."""


Shape = Mesh | Sphere | Disk | Rectangle | Cube


@dataclass(frozen=True, eq=False)
class Instance:
    """A shape with a material, placed by ``track(t) @ to_world`` (the track is the outer, rigid motion).

    Attributes:
        shape: shared between instances where it is the same object.
        material: what it is made of.
        to_world: ``(4, 4)`` float64, non-singular.
        track: rigid animation, or None for a static instance.
        name: for messages and reports.
        emission: radiance of an area light, linear RGB, or None. It leaves the side that the normal points to, of a
            :class:`Rectangle` or :class:`Sphere`.
    """

    shape: Shape
    material: Material
    to_world: Matrix = field(default_factory=identity)
    track: RigidTrack | None = None
    name: str = ""
    emission: Rgb | None = None

    def __post_init__(self) -> None:
        if self.to_world.shape != (4, 4) or not np.isfinite(self.to_world).all():
            raise SceneError(f"Instance {self.name!r}: to_world must be a finite (4, 4) matrix")
        if abs(np.linalg.det(self.to_world[:3, :3])) == 0.0:
            raise SceneError(f"Instance {self.name!r}: to_world is singular")


# --- camera, film, sampler, integrator -------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class PerspectiveCamera:
    """Pinhole, or thin lens where ``lens_radius`` is positive.

    Attributes:
        to_world: ``(4, 4)`` camera-to-world; a negative determinant (a mirrored picture) is kept, not repaired.
        fov_deg: full angle of the *shorter* image axis, in (0, 180).
        track: rigid animation applied outside ``to_world``.
        lens_radius: of the aperture, scene units.
        focal_distance: from the lens to the plane in focus, along the viewing direction, positive.
        shutter_s: ``(open, close)`` offsets from the frame's time.
    """

    to_world: Matrix = field(default_factory=identity)
    fov_deg: float = 45.0
    lens_radius: float = 0.0
    focal_distance: float = 1.0
    track: RigidTrack | None = None
    shutter_s: tuple[float, float] = (0.0, 0.0)

    def __post_init__(self) -> None:
        if not 0.0 < self.fov_deg < 180.0:
            raise SceneError(f"PerspectiveCamera.fov_deg: expected in (0, 180), got {self.fov_deg}")
        if self.lens_radius < 0.0:
            raise SceneError(f"PerspectiveCamera.lens_radius: expected non-negative, got {self.lens_radius}")
        if not 0.0 < self.focal_distance < float("inf"):
            raise SceneError(f"PerspectiveCamera.focal_distance: expected a positive number, got {self.focal_distance}")
        opening, closing = self.shutter_s
        if not -float("inf") < opening <= closing < float("inf"):
            raise SceneError(f"PerspectiveCamera.shutter_s: expected open <= close, got {self.shutter_s}")


@dataclass(frozen=True, eq=False)
class OrthographicCamera:
    """Parallel projection of ``[-1, 1]`` (scaled by ``half_width``) along the shorter axis."""

    to_world: Matrix = field(default_factory=identity)
    half_width: float = 1.0
    track: RigidTrack | None = None


@dataclass(frozen=True, eq=False)
class EnvironmentCamera:
    """Latitude–longitude view of the whole sphere."""

    to_world: Matrix = field(default_factory=identity)


@dataclass(frozen=True, eq=False)
class RealisticCamera:
    """A lens system read from a file; kept for conversion."""

    to_world: Matrix = field(default_factory=identity)
    lens_file: str = ""
    aperture_diameter: float = 1.0
    focus_distance: float = 10.0


Camera = PerspectiveCamera | OrthographicCamera | EnvironmentCamera | RealisticCamera


@dataclass(frozen=True)
class Film:
    """Output size in pixels and reconstruction filter."""

    width_px: int = 512
    height_px: int = 512
    filter: Literal["box", "tent", "gaussian", "mitchell", "sinc"] = "box"
    filter_radius_px: float = 0.5
    filename: str = ""


@dataclass(frozen=True)
class Sampler:
    """How pixels are sampled by the renderer the file was written for."""

    kind: Literal["independent", "stratified", "sobol", "halton", "hammersley"] = "independent"
    samples_per_pixel: int = 1


@dataclass(frozen=True)
class Integrator:
    """Light transport asked for.

    Attributes:
        depth: greatest number of bounces, -1 for no limit.
        shadow_rays: towards each light that has an extent, ``one`` per shaded point, samples sharing the light out
            among them, or ``all``: one to a random point of each of its cells.
        light_cells: cells along each of the two axes of such a light, for ``all``.
        reflection_rays, refraction_rays: spread about the perfect direction at the first glossy surface a camera ray
            meets; deeper ones send one.

    Source: Olszewski, "Distribution Ray Tracing" (sections on soft shadows and on diffuse reflection).
    """

    kind: Literal["whitted", "direct", "path", "bidirectional", "photonmap", "metropolis"] = "whitted"
    depth: int = 4
    shadow_rays: Literal["one", "all"] = "one"
    light_cells: int = 4
    reflection_rays: int = 1
    refraction_rays: int = 1

    def __post_init__(self) -> None:
        for name in ("light_cells", "reflection_rays", "refraction_rays"):
            if not 1 <= getattr(self, name) <= 256:
                raise SceneError(f"Integrator.{name}: expected 1 to 256, got {getattr(self, name)}")


@dataclass(frozen=True, eq=False)
class Scene:
    """A whole scene.

    Attributes:
        ambient: constant ambient radiance that Phong materials weigh by their ``ambient``.
        materials: named materials, kept for round trips; instances hold theirs directly.
        duration_s: length of the animation; 0 for a still.
        background: what primary and mirror rays that hit nothing see; None means the environment light.
    """

    camera: Camera
    instances: tuple[Instance, ...]
    lights: tuple[Light, ...] = ()
    film: Film = Film()
    sampler: Sampler = Sampler()
    integrator: Integrator = Integrator()
    ambient: Rgb = (0.0, 0.0, 0.0)
    materials: Mapping[str, Material] = field(default_factory=dict)
    name: str = ""
    duration_s: float = 0.0
    background: EnvironmentLight | None = None
