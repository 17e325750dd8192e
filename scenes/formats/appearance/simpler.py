"""Materials that no format of scene files has, in terms of those that some have."""

from __future__ import annotations

from scenes.canonical import (
    ConstantTexture,
    HeightField,
    Material,
    Metal,
    MetallicRough,
    MixMaterial,
    NormalMapped,
    Plastic,
    Texture,
)
from scenes.formats.appearance.folding import mean_of
from scenes.formats.appearance.indices import index_of_reflectance
from scenes.formats.appearance.spectra import grey
from scenes.formats.losses import LossReport

ALPHA_MIN = 1e-3
"""Least alpha of facets that stand for a roughness of zero."""


def simpler(material: HeightField | NormalMapped | MetallicRough, where: str, report: LossReport) -> Material:
    """The material below a height field or a normal map, or plastic and metal for a metallic-roughness surface."""
    if isinstance(material, HeightField):
        report.add(where, "a height field", "its material, flat")
        return material.base
    if isinstance(material, NormalMapped):
        report.add(where, "a normal map", "the normals of the shape")
        return material.base
    report.add(where, "a metallic-roughness surface", "plastic and metal of its parameters")
    _, roughness, metallic = (1.0, 1.0, 1.0) if material.parts is None else mean_of(material.parts)
    if material.parts is not None:
        report.add(where, "textures of metallic and roughness", "their means")
    if material.coat > 0.0:
        report.add(where, "a clear coat")
    if max(material.emission) > 0.0:
        report.add(where, "the light of a surface that also reflects")
    alpha = max((material.roughness * roughness) ** 2, ALPHA_MIN)
    plastic = Plastic(material.base, ior=material.ior, roughness=alpha, layered=False)
    share = min(material.metallic * metallic, 1.0)
    return plastic if share == 0.0 else mixed(plastic, metal_of(material.base, alpha), ConstantTexture(grey(share)))


def metal_of(base: Texture, alpha: float) -> Metal:
    """A metal with a colour at normal incidence; with a texture, the colour is the same at all angles."""
    if isinstance(base, ConstantTexture):
        return Metal(*index_of_reflectance(base.value), (alpha, alpha))
    return Metal(grey(0.0), grey(1.0), (alpha, alpha), base)


def mixed(first: Material, second: Material, amount: Texture) -> Material:
    """A mixture with a share of the second material, or the second alone."""
    return second if amount == ConstantTexture(grey(1.0)) else MixMaterial(first, second, amount)
