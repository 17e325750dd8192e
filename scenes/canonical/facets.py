"""Microfacet materials and coats of the canonical scene; conventions as in :mod:`scenes.canonical`.

A material with an ``alpha`` has the alpha of its microfacets, along both tangent axes, from that texture; its
``roughness`` is the mean. The renderer uses the mean.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from scenes.canonical.textures import WHITE, Texture
from scenes.canonical.values import Rgb, SceneError

Distribution = Literal["beckmann", "ggx"]
"""Distribution of the normals of microfacets."""


@dataclass(frozen=True)
class Metal:
    """Conductor with the complex refractive index ``eta + i k`` in RGB; ``roughness`` is the microfacet alpha."""

    eta: Rgb
    k: Rgb
    roughness: tuple[float, float] = (0.0, 0.0)
    reflectance_scale: Texture = WHITE
    distribution: Distribution = "ggx"
    alpha: Texture | None = None


@dataclass(frozen=True)
class Glossy:
    """A glossy coat over a diffuse base (PBRT ``substrate``, LuxRender ``glossy``)."""

    diffuse: Texture
    specular: Texture
    roughness: tuple[float, float] = (0.1, 0.1)
    alpha: Texture | None = None


@dataclass(frozen=True)
class Plastic:
    """A dielectric coat of index ``ior`` over a diffuse base.

    Attributes:
        diffuse: albedo of the base without the coat.
        specular: factor of the Fresnel reflectance.
        roughness: microfacet alpha of the coat.
        layered: whether the coat attenuates light to and from the base (Mitsuba); otherwise the reflection of the coat
            is added to the base (PBRT).
        alpha: texture of the microfacet alpha, of which ``roughness`` is the mean.
        distribution: distribution of the facets of a rough coat.
    """

    diffuse: Texture
    specular: Texture = WHITE
    ior: float = 1.5
    roughness: float = 0.0
    layered: bool = True
    alpha: Texture | None = None
    distribution: Distribution = "ggx"


@dataclass(frozen=True)
class MetallicRough:
    """The metallic-roughness surface of glTF: microfacets over a diffuse base, in part metallic, under a clear coat.

    Attributes:
        base: colour of the diffuse part and of the metal.
        metallic, roughness: in [0, 1]; the alpha of the facets is the roughness squared.
        parts: texture whose green channel multiplies ``roughness`` and whose blue channel multiplies ``metallic``; None
            for none.
        ior: refractive index of the dielectric part.
        coat, coat_roughness: strength and roughness of the clear coat, in [0, 1].
        emission: radiance.
        glow: texture that multiplies the emission; None for none.
    """

    base: Texture
    metallic: float = 1.0
    roughness: float = 1.0
    parts: Texture | None = None
    ior: float = 1.5
    coat: float = 0.0
    coat_roughness: float = 0.0
    emission: Rgb = (0.0, 0.0, 0.0)
    glow: Texture | None = None

    def __post_init__(self) -> None:
        for name in ("metallic", "roughness", "coat", "coat_roughness"):
            if not 0.0 <= getattr(self, name) <= 1.0:
                raise SceneError(f"MetallicRough.{name}: expected 0 to 1, got {getattr(self, name)}")
        if not 1.0 <= self.ior < float("inf"):
            raise SceneError(f"MetallicRough.ior: expected at least 1, got {self.ior}")
