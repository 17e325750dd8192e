"""Materials of the canonical scene; conventions as in :mod:`scenes.canonical`."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scenes.canonical.facets import Distribution, Glossy, Metal, MetallicRough, Plastic
from scenes.canonical.textures import WHITE, Texture
from scenes.canonical.values import Rgb, SceneError


def _check_spread(name: str, spread_deg: float) -> None:
    """Raises SceneError unless the cone's angle is in [0, 180] degrees."""
    if not 0.0 <= spread_deg <= 180.0:
        raise SceneError(f"{name}: expected an angle in [0, 180], got {spread_deg}")


@dataclass(frozen=True)
class Phong:
    """Phong reflection with a Fresnel-weighted mirror term: the material of the driving scenes.

    Outgoing radiance is ``ambient * diffuse``, plus the sum over all lights of
    ``(diffuse / π * cos + specular * (e + 2) / 2π * cos^e)`` times the incident irradiance, plus
    ``F * mirrored radiance`` with ``F = fresnel_min + (fresnel_max - fresnel_min) * (1 - cos)^fresnel_exponent``; the
    diffuse part is scaled by ``1 - F``.

    Attributes:
        diffuse: albedo.
        specular: colour of the highlight.
        exponent: exponent of the highlight, at least 1.
        ambient: weight of the constant ambient term, whose radiance the scene defines.
        fresnel_min, fresnel_max: mirror reflectance at normal and at grazing incidence, in [0, 1].
        fresnel_exponent: exponent of the mirror reflectance; 5 is Schlick's.
        mirror_tint: colour of the mirrored part (metals).
        mirror_spread_deg: full angle of the cone that mirrored rays fill uniformly, zero for a sharp mirror image.
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
    """Specular reflection: perfect, or uniform over a cone of full angle ``spread_deg`` about the mirrored ray."""

    reflectance: Texture = WHITE
    spread_deg: float = 0.0

    def __post_init__(self) -> None:
        _check_spread("Mirror.spread_deg", self.spread_deg)


@dataclass(frozen=True)
class Glass:
    """Dielectric.

    Attributes:
        reflectance, transmittance: factors of the Fresnel reflectance and transmittance.
        ior: refractive index of the inside over that of the outside, positive.
        roughness: microfacet alpha per tangent axis, zero for smooth.
        thin: whether it is a pane without thickness: light passes undeflected, and reflections between its faces are
            summed.
        spread_deg: full angle of the cone about the perfect reflection and refraction that rays fill uniformly.
        alpha: texture of the microfacet alpha, of which ``roughness`` is the mean; the renderer uses the mean.
        distribution: distribution of the facets of rough glass.
        front_only: whether only the front of a pane reflects, once, and lets the rest through (architectural glass of
            LuxCore). The renderer does not support it; it is kept for conversion.
    """

    reflectance: Texture = WHITE
    transmittance: Texture = WHITE
    ior: float = 1.5
    roughness: tuple[float, float] = (0.0, 0.0)
    thin: bool = False
    spread_deg: float = 0.0
    alpha: Texture | None = None
    distribution: Distribution = "ggx"
    front_only: bool = False

    def __post_init__(self) -> None:
        _check_spread("Glass.spread_deg", self.spread_deg)
        if not 0.0 < self.ior < float("inf"):
            raise SceneError(f"Glass.ior: expected a positive number, got {self.ior}")


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
    opacity: Texture = WHITE
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
    the relief through its sides continue, so its silhouette is that of the relief.

    Attributes:
        base: material of the relief.
        height: ``(h, w)`` or ``(h, w, 3)`` float32 in [0, 1], of which the first channel is used; stretched over the
            rectangle, interpolated bilinearly, row 0 at the top (``v = 1``).
        depth: depth of the relief in object space, positive.
        steps: number of equal steps of a ray through the whole relief, at least 2, before the secant search.
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
    """A surface that only emits, with constant radiance on both sides."""

    radiance: Rgb


@dataclass(frozen=True)
class Masked:
    """A material with holes: it covers the share ``opacity`` of the surface; the rest transmits light undeflected.

    Attributes:
        base: material with the holes.
        opacity: opacity in the red channel.
        cutoff: the material is opaque where the opacity is at least this, and absent elsewhere; None to use ``opacity``
            as it is.
    """

    base: Material
    opacity: Texture
    cutoff: float | None = None


@dataclass(frozen=True)
class NormalMapped:
    """A material whose shading normal is given by a texture.

    Attributes:
        base: material whose normal is perturbed.
        normals: vectors ``2 c - 1`` in the frame of increasing u, increasing v and the normal, not encoded.
        scale: factor of their first two components.
    """

    base: Material
    normals: Texture
    scale: float = 1.0


@dataclass(frozen=True)
class Bumped:
    """A material whose shading normal follows a height field.

    Attributes:
        base: material whose normal is perturbed.
        height: displacement along the normal, the mean of the channels.
        scale: factor of the height, scene units.
    """

    base: Material
    height: Texture
    scale: float = 1.0


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
    | Masked
    | Bumped
    | NormalMapped
    | MetallicRough
)
