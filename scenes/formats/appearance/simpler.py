"""Materials that no format of scene files has, in terms of those that some have."""

from __future__ import annotations

import numpy as np

from scenes.canonical import (
    ConstantTexture,
    HeightField,
    ImageTexture,
    Material,
    Metal,
    MetallicRough,
    MixMaterial,
    NormalMapped,
    Plastic,
    Texture,
)
from scenes.formats.appearance.facets import Facets, facets_of
from scenes.formats.appearance.folding import changed, folded, greatest_of, mean_of
from scenes.formats.appearance.indices import index_of_reflectance
from scenes.formats.appearance.normals import is_flat
from scenes.formats.appearance.spectra import grey, rgb
from scenes.formats.losses import LossReport

ALPHA_MIN = 1e-3
"""Least alpha of facets that stand for a roughness of zero."""


def simpler(material: HeightField | NormalMapped | MetallicRough, where: str, report: LossReport) -> Material:
    """The material below a height field or a normal map, or plastic and metal for a metallic-roughness surface."""
    if isinstance(material, HeightField):
        report.add(where, "a height field", "its material, flat")
        return material.base
    if isinstance(material, NormalMapped):
        if not is_flat(material):
            report.add(where, "a normal map", "the normals of the shape")
        return material.base
    report.add(where, "a metallic-roughness surface", "plastic and metal of its parameters")
    if material.coat > 0.0:
        report.add(where, "a clear coat")
    if max(material.emission) > 0.0:
        report.add(where, "the light of a surface that also reflects")
    least = max(material.roughness**2, ALPHA_MIN)
    rough = Facets((least, least))
    share: Texture = ConstantTexture(grey(material.metallic))
    if material.parts is not None:
        rough, share = _of_parts(material, material.parts, where, report)
    plastic = Plastic(material.base, ior=material.ior, roughness=rough.roughness[0], layered=False, alpha=rough.alpha)
    return plastic if greatest_of(share) == 0.0 else mixed(plastic, metal_of(material.base, rough), share)


def _of_parts(material: MetallicRough, parts: Texture, where: str, report: LossReport) -> tuple[Facets, Texture]:
    """The roughness and the metallic share of a surface with a texture of both."""

    def alpha(values: np.ndarray) -> np.ndarray:
        return np.repeat(np.maximum((material.roughness * values[..., 1:2]) ** 2, ALPHA_MIN), 3, axis=-1)

    def metal(values: np.ndarray) -> np.ndarray:
        return np.repeat(np.clip(material.metallic * values[..., 2:3], 0.0, 1.0), 3, axis=-1)

    made = [changed(folded(parts), change) for change in (alpha, metal)]
    if made[0] is None or made[1] is None:
        report.add(where, "textures of metallic and roughness", "their means")
        made = [ConstantTexture(rgb(change(np.array(mean_of(parts))))) for change in (alpha, metal)]
    facets = facets_of(_plain(made[0]))
    assert facets is not None
    return facets, _plain(made[1])


def _plain(texture: Texture | None) -> Texture:
    """A texture, or its colour if it is the same everywhere."""
    assert texture is not None
    if isinstance(texture, ImageTexture) and np.ptp(texture.image) == 0.0:
        return ConstantTexture(rgb(texture.image[0, 0]))
    return texture


def metal_of(base: Texture, facets: Facets) -> Metal:
    """A metal with a colour at normal incidence; with a texture, the colour is the same at all angles."""
    if isinstance(base, ConstantTexture):
        return Metal(*index_of_reflectance(base.value), facets.roughness, alpha=facets.alpha)
    return Metal(grey(0.0), grey(1.0), facets.roughness, base, alpha=facets.alpha)


def mixed(first: Material, second: Material, amount: Texture) -> Material:
    """A mixture with a share of the second material, or the second alone."""
    return second if amount == ConstantTexture(grey(1.0)) else MixMaterial(first, second, amount)
