"""The principled material of Mitsuba 3 as a metallic-roughness surface, and such a surface as the material.

Both have the same base colour, metallic share, roughness and index. The diffuse part of the material is Disney's, which
is darker at the edges than a matte one and brighter at grazing angles, and its clear coat is another.

Source: Mitsuba 3 documentation, plugin reference, "principled"; Burley 2012, "Physically based shading at Disney", for
the meaning of its parameters.
"""

from __future__ import annotations

import math

import numpy as np

from scenes.canonical import (
    ConstantTexture,
    Glass,
    ImageTexture,
    Material,
    MetallicRough,
    MixTexture,
    Plastic,
    SceneError,
    Texture,
)
from scenes.formats.appearance.facets import Facets
from scenes.formats.appearance.folding import changed, folded, mean_of
from scenes.formats.appearance.simpler import ALPHA_MIN, metal_of, mixed
from scenes.formats.appearance.spectra import grey
from scenes.formats.mitsuba.properties import Properties
from scenes.formats.mitsuba.read_textures import MitsubaTextures
from scenes.formats.mitsuba.write_elements import Element, ElementWriter
from scenes.formats.text.numbers import number

_PLAIN = ("anisotropic", "specTint", "sheen", "sheenTint", "flatness", "diffTrans")
_COAT = 0.1, 0.099
"""Alpha of a clear coat without gloss, and how much a gloss of 1 takes from it."""


def principled(properties: Properties, textures: MitsubaTextures) -> Material:
    """A metallic-roughness surface; with a transmissive share, a mixture of plastic, glass and metal.

    Sheen, tint and flatness are left out, which is reported if they are given.
    """
    base = textures.texture(properties, "baseColor", grey(0.5))
    specular = _mean(properties, textures, "specular", 0.5)
    root = math.sqrt(0.08 * specular)
    ior = properties.number("eta", (1.0 + root) / (1.0 - root))
    if not 1.0 <= ior < 1e3:
        raise SceneError(f"{properties.where}: eta: expected at least 1, got {ior:g}")
    for name in _PLAIN:
        if _mean(properties, textures, name, 0.0) != 0.0 and name != "sheenTint":
            textures.report.add(properties.where, f"{name} of the material 'principled'")
    coat, gloss = _mean(properties, textures, "clearcoat", 0.0), _mean(properties, textures, "clearcoatGloss", 0.0)
    through = _amount(properties, textures, "specTrans")
    if through is None:
        textures.report.add(properties.where, "material 'principled'", "a metallic-roughness surface, matte below")
        return _surface(properties, textures, base, ior, (coat, gloss))
    if coat != 0.0:
        textures.report.add(properties.where, "clearcoat of the material 'principled'")
    roughness = _mean(properties, textures, "roughness", 0.5)
    alpha = max(roughness * roughness, ALPHA_MIN)
    made: Material = Plastic(base, ior=ior, roughness=alpha, layered=False)
    made = mixed(made, Glass(transmittance=base, ior=ior, roughness=(alpha, alpha)), through)
    metallic = _amount(properties, textures, "metallic")
    if metallic is not None:
        made = mixed(made, metal_of(base, Facets((alpha, alpha))), metallic)
    textures.report.add(properties.where, "material 'principled'", "plastic, metal and glass of its parameters")
    return made


def _surface(
    properties: Properties, textures: MitsubaTextures, base: Texture, ior: float, coat: tuple[float, float]
) -> MetallicRough:
    given = [textures.texture(properties, name, grey(value)) for name, value in (("roughness", 0.5), ("metallic", 0.0))]
    factors, parts = [1.0, 1.0], _joined(*given)
    if parts is None:
        factors = [_mean(properties, textures, "roughness", 0.5), _mean(properties, textures, "metallic", 0.0)]
    strength = float(np.clip(coat[0], 0.0, 1.0))
    rough = math.sqrt(max(_COAT[0] - _COAT[1] * coat[1], 0.0)) if strength > 0.0 else 0.0
    roughness, metallic = (float(np.clip(factor, 0.0, 1.0)) for factor in factors)
    return MetallicRough(base, metallic, roughness, parts, ior, strength, min(rough, 1.0))


def _joined(roughness: Texture, metallic: Texture) -> Texture | None:
    """A picture with the roughness in its green and the metallic share in its blue channel; None if one constant
    each or two other textures have to do."""
    channels = (roughness, (0.0, 1.0, 0.0)), (metallic, (0.0, 0.0, 1.0))
    if isinstance(roughness, ConstantTexture) and isinstance(metallic, ConstantTexture):
        return None
    made = [
        changed(folded(part), lambda values, at=at: np.clip(values.mean(axis=-1, keepdims=True), 0.0, 1.0) * at)
        for part, at in channels
    ]
    if made[0] is None or made[1] is None:
        return None
    whole = folded(MixTexture(made[0], made[1], 0.5))
    return None if isinstance(whole, MixTexture) else changed(whole, lambda values: 2.0 * values)


def write_principled(material: MetallicRough, where: str, writer: ElementWriter) -> Element:
    """The element of a metallic-roughness surface; its emission is that of its shape."""
    report = writer.report
    report.add(where, "a metallic-roughness surface", "a principled one, whose diffuse part is Disney's")
    if max(material.emission) > 0.0:
        report.add(where, "the light of a surface that also reflects")
    made = writer.plugin("bsdf", "principled")
    writer.texture(made, material.base, "baseColor")
    for name, factor, channel in (("roughness", material.roughness, 1), ("metallic", material.metallic, 2)):
        part = None if material.parts is None else _channel(material.parts, factor, channel)
        if isinstance(part, ImageTexture):
            writer.numbers(made, part, name)
            continue
        if material.parts is not None:
            factor *= mean_of(material.parts)[channel]
            report.add(where, f"a texture of the {name}", f"its mean, {factor:.3g}")
        writer.put(made, "float", name, number(factor))
    writer.put(made, "float", "eta", number(max(material.ior, 1.0001)))
    if material.coat > 0.0:
        _write_coat(material, made, where, writer)
    return made


def _channel(parts: Texture, factor: float, channel: int) -> Texture | None:
    return changed(folded(parts), lambda values: np.repeat(factor * values[..., channel : channel + 1], 3, axis=-1))


def _write_coat(material: MetallicRough, made: Element, where: str, writer: ElementWriter) -> None:
    gloss = float(np.clip((_COAT[0] - material.coat_roughness**2) / _COAT[1], 0.0, 1.0))
    writer.report.add(where, "a clear coat", f"Disney's clear coat of gloss {gloss:.3g}")
    writer.put(made, "float", "clearcoat", number(material.coat))
    writer.put(made, "float", "clearcoatGloss", number(gloss))


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
