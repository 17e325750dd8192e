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

Rgb = tuple[float, float, float]
Matrix = NDArray[np.float64]


def identity() -> Matrix:
    """The ``(4, 4)`` identity transform."""
    return np.eye(4)


class SceneError(ValueError):
    """A scene description that cannot be used; the message says what was expected, what arrived, and where."""


# --- animation -------------------------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class RigidTrack:
    """A rigid motion sampled at uniform key times; between keys, translation is linear and rotation is slerped.

    Before the first and after the last key the pose is held.

    Attributes:
        start_s: time of the first key, seconds.
        interval_s: time between keys, seconds, positive.
        translation: ``(keys, 3)`` float64, scene units.
        rotation: ``(keys, 4)`` float64 unit quaternions ``(x, y, z, w)``; neighbouring keys less than half a turn apart
            and of the same sign (non-negative dot product).
    """

    start_s: float
    interval_s: float
    translation: NDArray[np.float64]
    rotation: NDArray[np.float64]

    def __post_init__(self) -> None:
        t, q = self.translation, self.rotation
        if not self.interval_s > 0.0:
            raise SceneError(f"RigidTrack.interval_s: expected a positive time, got {self.interval_s}")
        if t.ndim != 2 or t.shape[1] != 3 or q.shape != (t.shape[0], 4) or t.shape[0] < 1:
            raise SceneError(f"RigidTrack: expected translation (k, 3), rotation (k, 4), got {t.shape} and {q.shape}")
        if not (np.isfinite(t).all() and np.isfinite(q).all()):
            raise SceneError("RigidTrack: keys hold non-finite values")
        if not np.allclose(np.linalg.norm(q, axis=1), 1.0, atol=1e-6):
            raise SceneError("RigidTrack.rotation: expected unit quaternions")
        if (np.einsum("ij,ij->i", q[1:], q[:-1]) < 0.0).any():
            raise SceneError("RigidTrack.rotation: neighbouring keys must have the same sign")


# --- textures --------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class ConstantTexture:
    """One colour everywhere."""

    value: Rgb


@dataclass(frozen=True, eq=False)
class ImageTexture:
    """An image looked up at ``uv * uv_scale + uv_offset``.

    Attributes:
        image: ``(height, width, 3)`` float32, linear RGB, row 0 at the top (``v = 1``).
        wrap: what lies outside ``[0, 1]``.
        filter: ``mipmap`` is bilinear within a level chosen by the ray's footprint.
        source: the file it came from, for export and for messages.
    """

    image: NDArray[np.float32]
    uv_scale: tuple[float, float] = (1.0, 1.0)
    uv_offset: tuple[float, float] = (0.0, 0.0)
    wrap: Literal["repeat", "clamp", "black"] = "repeat"
    filter: Literal["nearest", "bilinear", "mipmap"] = "mipmap"
    source: str = ""

    def __post_init__(self) -> None:
        if self.image.ndim != 3 or self.image.shape[2] != 3 or min(self.image.shape[:2]) < 1:
            raise SceneError(f"ImageTexture {self.source!r}: expected (h, w, 3) with h, w >= 1, got {self.image.shape}")
        if not np.isfinite(self.image).all():
            raise SceneError(f"ImageTexture {self.source!r}: holds non-finite values")


@dataclass(frozen=True)
class CheckerboardTexture:
    """Two textures in alternating unit squares of ``uv * uv_scale``."""

    even: Texture
    odd: Texture
    uv_scale: tuple[float, float] = (1.0, 1.0)


@dataclass(frozen=True)
class ScaleTexture:
    """The product of two textures."""

    first: Texture
    second: Texture


@dataclass(frozen=True)
class MixTexture:
    """``(1 - amount) * first + amount * second``."""

    first: Texture
    second: Texture
    amount: float = 0.5


Texture = ConstantTexture | ImageTexture | CheckerboardTexture | ScaleTexture | MixTexture


def _check_spread(name: str, spread_deg: float) -> None:
    """Raises SceneError unless a cone of rays fits above a surface."""
    if not 0.0 <= spread_deg <= 180.0:
        raise SceneError(f"{name}: expected an angle in [0, 180], got {spread_deg}")


# --- materials -------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Phong:
    """Phong reflection with a Fresnel-weighted mirror term: the material of the driving scenes.

    Outgoing radiance is ``ambient * diffuse``, plus over all lights the sum of
    ``(diffuse / π * cos + specular * (e + 2) / 2π * cos^e)`` times the arriving irradiance, plus
    ``F * mirrored radiance`` with ``F = fresnel_min + (fresnel_max - fresnel_min) * (1 - cos)^fresnel_exponent``; the
    diffuse part is scaled by ``1 - F``.

    Attributes:
        diffuse: albedo.
        specular: colour of the highlight.
        exponent: of the highlight, at least 1.
        ambient: weight of the constant ambient term, of which the world supplies the radiance.
        fresnel_min, fresnel_max: mirror reflectance at normal and at grazing incidence, in [0, 1].
        fresnel_exponent: 5 is Schlick's.
        mirror_tint: colour of the mirrored part (metals).
        mirror_spread_deg: full angle of the cone that mirrored rays fill evenly, zero for a sharp mirror image.
    """

    diffuse: Texture
    specular: Rgb = (0.0, 0.0, 0.0)
    exponent: float = 32.0
    ambient: float = 1.0
    fresnel_min: float = 0.0
    fresnel_max: float = 0.0
    fresnel_exponent: float = 5.0
    mirror_tint: Rgb = (1.0, 1.0, 1.0)
    mirror_spread_deg: float = 0.0

    def __post_init__(self) -> None:
        _check_spread("Phong.mirror_spread_deg", self.mirror_spread_deg)
        if self.exponent < 1.0:
            raise SceneError(f"Phong.exponent: expected at least 1, got {self.exponent}")
        if not 0.0 <= self.fresnel_min <= self.fresnel_max <= 1.0:
            raise SceneError(
                f"Phong: expected 0 <= fresnel_min <= fresnel_max <= 1, got {self.fresnel_min}, {self.fresnel_max}"
            )


@dataclass(frozen=True)
class Matte:
    """Lambertian, or Oren–Nayar where ``sigma_deg`` is positive."""

    reflectance: Texture
    sigma_deg: float = 0.0


@dataclass(frozen=True)
class Mirror:
    """Specular reflection: perfect, or glossy over an even cone of full angle ``spread_deg`` about the mirrored ray."""

    reflectance: Texture = ConstantTexture((1.0, 1.0, 1.0))
    spread_deg: float = 0.0

    def __post_init__(self) -> None:
        _check_spread("Mirror.spread_deg", self.spread_deg)


@dataclass(frozen=True)
class Glass:
    """Dielectric.

    Attributes:
        reflectance, transmittance: multiply what Fresnel's equations send each way.
        ior: index of refraction of the inside over the outside, positive.
        roughness: microfacet alpha per tangent axis, zero for smooth.
        thin: a pane without thickness: light passes unbent, and reflections between its faces are summed.
        spread_deg: full angle of the cone about the perfect reflection and refraction that rays fill evenly.
    """

    reflectance: Texture = ConstantTexture((1.0, 1.0, 1.0))
    transmittance: Texture = ConstantTexture((1.0, 1.0, 1.0))
    ior: float = 1.5
    roughness: tuple[float, float] = (0.0, 0.0)
    thin: bool = False
    spread_deg: float = 0.0

    def __post_init__(self) -> None:
        _check_spread("Glass.spread_deg", self.spread_deg)
        if not 0.0 < self.ior < float("inf"):
            raise SceneError(f"Glass.ior: expected a positive number, got {self.ior}")


@dataclass(frozen=True)
class Metal:
    """Conductor with complex index ``eta + i k`` in RGB; ``roughness`` is the microfacet alpha."""

    eta: Rgb
    k: Rgb
    roughness: tuple[float, float] = (0.0, 0.0)
    reflectance_scale: Texture = ConstantTexture((1.0, 1.0, 1.0))
    distribution: Literal["beckmann", "ggx"] = "ggx"


@dataclass(frozen=True)
class Glossy:
    """A glossy coat over a diffuse base (PBRT ``substrate``, LuxRender ``glossy``)."""

    diffuse: Texture
    specular: Texture
    roughness: tuple[float, float] = (0.1, 0.1)


@dataclass(frozen=True)
class Plastic:
    """A dielectric coat of index ``ior`` over a diffuse base."""

    diffuse: Texture
    specular: Texture = ConstantTexture((1.0, 1.0, 1.0))
    ior: float = 1.5
    roughness: float = 0.0


@dataclass(frozen=True)
class Translucent:
    """Diffuse reflection and diffuse transmission."""

    reflectance: Texture
    transmittance: Texture


@dataclass(frozen=True)
class Uber:
    """PBRT's all-in-one: diffuse, glossy, mirrored and transmitted parts under an opacity."""

    diffuse: Texture
    specular: Texture
    reflectance: Texture
    transmittance: Texture
    opacity: Texture = ConstantTexture((1.0, 1.0, 1.0))
    ior: float = 1.5
    roughness: tuple[float, float] = (0.1, 0.1)


@dataclass(frozen=True)
class MixMaterial:
    """``(1 - amount)`` of the first and ``amount`` of the second material."""

    first: Material
    second: Material
    amount: Texture


@dataclass(frozen=True, eq=False)
class HeightField:
    """Relief on a :class:`Rectangle`, carved into it.

    Height 1 lies in the plane of the rectangle, height 0 lies ``depth`` below it (against its normal). Rays that leave
    the relief through its sides pass on, so its silhouette is that of the relief.

    Attributes:
        base: what the relief is made of.
        height: ``(h, w)`` or ``(h, w, 3)`` float32 in [0, 1], of which the first channel counts; stretched over the
            rectangle, bilinear, row 0 at the top (``v = 1``).
        depth: in object space, positive.
        steps: even steps that a ray takes through the whole relief, at least 2, before the secant search.
    """

    base: Material
    height: NDArray[np.float32]
    depth: float
    steps: int = 64

    def __post_init__(self) -> None:
        if self.height.ndim not in (2, 3) or min(self.height.shape) < 1:
            raise SceneError(f"HeightField.height: expected (h, w) or (h, w, 3), got {self.height.shape}")
        if not (np.isfinite(self.height).all() and self.height.min() >= 0.0 and self.height.max() <= 1.0):
            raise SceneError("HeightField.height: expected finite values in [0, 1]")
        if not 0.0 < self.depth < float("inf"):
            raise SceneError(f"HeightField.depth: expected a positive number, got {self.depth}")
        if self.steps < 2:
            raise SceneError(f"HeightField.steps: expected at least 2, got {self.steps}")


@dataclass(frozen=True)
class Emissive:
    """A surface that only emits, two-sided, constant radiance."""

    radiance: Rgb


Material = (
    Phong
    | Matte
    | Mirror
    | Glass
    | Metal
    | Glossy
    | Plastic
    | Translucent
    | Uber
    | MixMaterial
    | HeightField
    | Emissive
)


# --- shapes and instances --------------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class Mesh:
    """An indexed triangle mesh in object space.

    Attributes:
        vertices: ``(v, 3)`` float32.
        faces: ``(f, 3)`` int32, counter-clockwise seen from outside.
        normals: ``(v, 3)`` float32 unit shading normals, or None for face normals.
        uvs: ``(v, 2)`` float32, or None for zero.
    """

    vertices: NDArray[np.float32]
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


# --- lights ----------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class PointLight:
    """Radiant intensity (per steradian) at a position."""

    position: Rgb
    intensity: Rgb


@dataclass(frozen=True)
class DirectionalLight:
    """Parallel light that travels along ``direction``; ``irradiance`` on a surface facing it.

    Attributes:
        direction: of travel, from the light into the scene; need not be unit.
        angle_deg: full angle of the cone the light fills (the sun's disk is 0.53), zero for a hard shadow.
    """

    direction: Rgb
    irradiance: Rgb
    angle_deg: float = 0.0


@dataclass(frozen=True)
class SpotLight:
    """Intensity within a cone, falling off smoothly from ``inner_deg`` to ``outer_deg`` (half angles)."""

    position: Rgb
    target: Rgb
    intensity: Rgb
    inner_deg: float
    outer_deg: float


@dataclass(frozen=True, eq=False)
class EnvironmentLight:
    """Radiance from infinity: an image, or a constant where the image is one texel.

    Among a scene's lights it lights surfaces and is seen; as a scene's background it is seen only.

    Attributes:
        image: ``(height, width, 3)`` float32 linear RGB, latitude–longitude.
        to_world: rotation of the map, ``(4, 4)``.
        scale: multiplies the image.
    """

    image: NDArray[np.float32]
    to_world: Matrix = field(default_factory=identity)
    scale: float = 1.0
    source: str = ""


@dataclass(frozen=True)
class SunSky:
    """Analytic daylight: direction towards the sun and turbidity."""

    sun_direction: Rgb
    turbidity: float = 3.0
    scale: float = 1.0
    part: Literal["sun", "sky", "both"] = "both"


Light = PointLight | DirectionalLight | SpotLight | EnvironmentLight | SunSky


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
