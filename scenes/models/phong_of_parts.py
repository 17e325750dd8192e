"""Conversion of the materials of models to those of the renderer."""

from __future__ import annotations

import dataclasses

import numpy as np

from scenes.arithmetic import power
from scenes.canonical import ConstantTexture, Emissive, Glass, ImageTexture, Material, Phong, Rgb, Texture
from scenes.formats.appearance.folding import mean_of
from scenes.formats.appearance.spectra import rgb
from scenes.formats.losses import LossReport

EXPONENT_MAX = 1.0e4
_SMOOTH = 0.2  # roughness below which metal is a mirror
_CLEAR = 0.5  # opacity below which a surface is a pane


def scaled(texture: Texture, factor: float) -> Texture:
    """A constant or an image times a number."""
    if isinstance(texture, ImageTexture):
        return texture if factor == 1.0 else dataclasses.replace(texture, image=texture.image * np.float32(factor))
    assert isinstance(texture, ConstantTexture)
    return ConstantTexture(rgb(np.multiply(texture.value, factor)))


def _scattered(roughness: float) -> float:
    """The diffuse share of the reflection of rough metal: its alpha, or 0 if it is a mirror."""
    return roughness * roughness if roughness >= _SMOOTH else 0.0


def diffuse_share(metallic: float, roughness: float) -> float:
    """The diffuse share of a surface's base colour."""
    return 1.0 - metallic * (1.0 - _scattered(roughness))


def metallic_rough(base: Texture, diffuse: Texture, metallic: float, roughness: float) -> Phong:
    """The Phong material of a metallic-roughness surface.

    The highlight is 4 % of white, or the base colour for metal, with the exponent ``2 / roughness⁴ - 2``; below a
    roughness of 0.2 metal is a mirror.

    Deviation: the reflection of rough metal is divided into a diffuse part, with the share of its alpha
    (``roughness²``), and the highlight, because the highlight has one colour and the metal may have a texture.

    Args:
        base: colour of the surface, of which the mean is used.
        diffuse: diffuse part of the colour, see :func:`diffuse_share`.
        metallic, roughness: means of both, 0 to 1.
    """
    color = np.clip(mean_of(base), 0.0, 1.0)
    mirror = metallic if roughness < _SMOOTH else 0.0
    return Phong(
        diffuse,
        specular=rgb((0.04 * (1.0 - metallic) + color * metallic * (1.0 - _scattered(roughness))) * (1.0 - mirror)),
        exponent=float(np.clip(2.0 / float(power(max(roughness, 1e-3), 4)) - 2.0, 1.0, EXPONENT_MAX)),
        fresnel_min=mirror,
        fresnel_max=mirror,
        mirror_tint=rgb(color),
    )


def seen_through(material: Phong, opacity: float, where: str, report: LossReport) -> Material:
    """A surface of constant opacity: a clear pane of its colour below 1/2, else opaque."""
    if opacity >= 1.0:
        return material
    if opacity < _CLEAR:
        tint = opacity * np.clip(mean_of(material.diffuse), 0.0, 1.0) + (1.0 - opacity)
        report.add(where, f"an opacity of {opacity:.3g}", "a thin clear pane of its colour")
        return Glass(transmittance=ConstantTexture(rgb(tint)), thin=True)
    report.add(where, f"an opacity of {opacity:.3g}", "opaque")
    return material


def glowing(material: Material, radiance: Rgb, where: str, report: LossReport) -> Material:
    """A surface with uniform emission, which replaces its other properties."""
    if max(radiance) <= 0.0:
        return material
    became = "a surface that glows and lights nothing"
    if isinstance(material, Phong) and max(mean_of(material.diffuse)) > 0.0:
        became += ", without its other colours"
    report.add(where, "emission", became)
    return Emissive(radiance)
