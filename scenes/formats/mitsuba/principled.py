"""The principled material of Mitsuba 3, as mixtures of materials of the canonical scene.

Source: Mitsuba 3 documentation, plugin reference, "principled"; Burley 2012, "Physically based shading at Disney", for
the meaning of its parameters.
"""

from __future__ import annotations

import math

from scenes.canonical import ConstantTexture, Glass, Material, Plastic, SceneError, Texture
from scenes.formats.appearance.folding import mean_of
from scenes.formats.appearance.simpler import ALPHA_MIN, metal_of, mixed
from scenes.formats.appearance.spectra import grey
from scenes.formats.mitsuba.properties import Properties
from scenes.formats.mitsuba.read_textures import MitsubaTextures

_PLAIN = ("anisotropic", "specTint", "sheen", "sheenTint", "flatness", "clearcoat", "clearcoatGloss", "diffTrans")


def principled(properties: Properties, textures: MitsubaTextures) -> Material:
    """A mixture of a base with an added coat, metal for the metallic share, and glass for the transmissive share.

    Deviation: the coat follows Fresnel's equations and its facets have one roughness. Sheen, tint, clear coat and
    flatness are left out, which is reported if they are given.
    """
    base = textures.texture(properties, "baseColor", grey(0.5))
    roughness = _mean(properties, textures, "roughness", 0.5)
    alpha = max(roughness * roughness, ALPHA_MIN)
    specular = _mean(properties, textures, "specular", 0.5)
    root = math.sqrt(0.08 * specular)
    ior = properties.number("eta", (1.0 + root) / (1.0 - root))
    if not 1.0 <= ior < 1e3:
        raise SceneError(f"{properties.where}: eta: expected at least 1, got {ior:g}")
    for name in _PLAIN:
        if _mean(properties, textures, name, 0.0) != 0.0 and name not in ("sheenTint", "clearcoatGloss"):
            textures.report.add(properties.where, f"{name} of the material 'principled'")
    made: Material = Plastic(base, ior=ior, roughness=alpha, layered=False)
    through = _amount(properties, textures, "specTrans")
    if through is not None:
        made = mixed(made, Glass(transmittance=base, ior=ior, roughness=(alpha, alpha)), through)
    metallic = _amount(properties, textures, "metallic")
    if metallic is not None:
        made = mixed(made, metal_of(base, alpha), metallic)
    textures.report.add(properties.where, "material 'principled'", "plastic, metal and glass of its parameters")
    return made


def _amount(properties: Properties, textures: MitsubaTextures, name: str) -> Texture | None:
    """The share of a part, None if it is absent."""
    found = textures.texture(properties, name, grey(0.0))
    return None if found == ConstantTexture(grey(0.0)) else found


def _mean(properties: Properties, textures: MitsubaTextures, name: str, default: float) -> float:
    """A number; a texture becomes its mean, which is reported."""
    found = textures.texture(properties, name, grey(default))
    value = sum(mean_of(found)) / 3.0
    if not isinstance(found, ConstantTexture):
        textures.report.add(properties.where, f"{name}: a texture", f"its mean, {value:g}")
    return value
