"""Mixtures of materials, and metals that reflect less as mixtures with black."""

from __future__ import annotations

import dataclasses

from scenes.canonical import ConstantTexture, Material, Matte, Metal, MixMaterial, Texture
from scenes.canonical.textures import WHITE
from scenes.formats.appearance.spectra import grey

BLACK = Matte(ConstantTexture(grey(0.0)))


def mixture_of(first: Material, second: Material, amount: Texture) -> Material:
    """A mixture, ``amount`` of it the second material; a metal mixed with black is a metal that reflects less."""
    black = isinstance(first, Matte) and first.reflectance == BLACK.reflectance
    if black and isinstance(second, Metal) and second.reflectance_scale == WHITE:
        return dataclasses.replace(second, reflectance_scale=amount)
    return MixMaterial(first, second, amount)


def dimmed(material: Metal) -> MixMaterial:
    """A metal whose reflection is multiplied by a factor, as a mixture with black: undoes :func:`mixture_of`."""
    bright = dataclasses.replace(material, reflectance_scale=WHITE)
    return MixMaterial(BLACK, bright, material.reflectance_scale)
