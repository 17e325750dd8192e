"""Writer of textures and materials of PBRT v3 files.

Source: PBRT v3 file format (https://www.pbrt.org/fileformat-v3); Hagemann 2018, ch. 4.
"""

from __future__ import annotations

import math
from typing import ClassVar

import numpy as np

from scenes.canonical import (
    Bumped,
    ConstantTexture,
    Glass,
    Glossy,
    ImageTexture,
    Masked,
    Material,
    Metal,
    MixMaterial,
    Phong,
    Plastic,
    Translucent,
    Uber,
)
from scenes.canonical.textures import WHITE
from scenes.formats.appearance.facets import Facets
from scenes.formats.appearance.folding import folded, product_of
from scenes.formats.appearance.glass import lose_rays
from scenes.formats.appearance.indices import mean_reflectance
from scenes.formats.appearance.mixtures import dimmed, is_nothing
from scenes.formats.appearance.spectra import grey, rgb
from scenes.formats.directives.surface_writer import SurfaceWriter, mixture_line
from scenes.formats.text.numbers import number

_UNMAPPED = '"bool remaproughness" [ "false" ]'

PICTURES = (".exr", ".png", ".tga", ".pfm")
"""Endings of image files that PBRT v3 reads."""


class PbrtSurfaceWriter(SurfaceWriter):
    """Collects the lines of textures and materials.

    Attributes:
        nothing: kind of an invisible material.
    """

    nothing: ClassVar[str] = "none"
    color_texture = "spectrum"
    color = "rgb"

    def image_line(self, texture: ImageTexture) -> str:
        file = self.output.picture(texture.image, texture.source, PICTURES)
        if texture.filter != "mipmap":
            self.report.add(f"texture {file}", f"the filter {texture.filter}", "levels of detail")
        return self.placed_image(file, texture, "", texture.uv_scale, texture.uv_offset)

    def material_line(self, material: Material, name: str) -> str:
        where = f"material {name!r}"
        if isinstance(material, Bumped):
            return self.bumped_line(material, name, "bumpmap")
        if is_nothing(material):
            return f'"string type" [ "{self.nothing}" ]'
        if isinstance(material, Masked):
            self.report.add(where, "holes in a material", "those of the shapes that have it")
            return self.material_line(material.base, name)
        if isinstance(material, Metal) and material.reflectance_scale != WHITE:
            material = dimmed(material)
        if isinstance(material, MixMaterial):
            first, second = self.material(material.second), self.material(material.first)
            return mixture_line(first, second, self.texture(material.amount, "amount"))
        return super().material_line(material, name)

    def plain_material(self, material: Material, where: str) -> tuple[str, list[str]]:
        if isinstance(material, Glass):
            return self._glass(material, where)
        if isinstance(material, Metal):
            index = [self.constant("eta", material.eta), self.constant("k", material.k)]
            return "metal", [*index, self.unmapped(material)]
        if isinstance(material, Glossy):
            parts = [self.texture(material.diffuse, "Kd"), self.texture(material.specular, "Ks")]
            return "substrate", [*parts, self.unmapped(material)]
        if isinstance(material, Plastic):
            return self._plastic(material, where)
        if isinstance(material, Translucent):
            coat = [self.constant("Kd", grey(1.0)), self.constant("Ks", grey(0.0))]
            sides = [self.texture(material.reflectance, "reflect"), self.texture(material.transmittance, "transmit")]
            return "translucent", [*coat, *sides]
        if isinstance(material, Uber):
            names = ("diffuse", "Kd"), ("specular", "Ks"), ("reflectance", "Kr"), ("transmittance", "Kt")
            parts = [self.texture(getattr(material, ours), theirs) for ours, theirs in names]
            parts += [self.texture(material.opacity, "opacity"), f'"float eta" [ {number(material.ior)} ]']
            return "uber", [*parts, self.unmapped(Facets(material.roughness))]
        if isinstance(material, Phong):
            return self._phong(material, where)
        return super().plain_material(material, where)

    def _plastic(self, material: Plastic, where: str) -> tuple[str, list[str]]:
        """A plastic. PBRT adds the coat to the base; ``uber`` supports indices other than 1.5 and smooth coats."""
        diffuse = material.diffuse
        if material.layered and material.ior > 1.0:
            kept = 1.0 - mean_reflectance(material.ior)
            diffuse = folded(product_of(diffuse, ConstantTexture(grey(kept))))
            self.report.add(where, "a base under a coat", f"{kept:.3g} of it beside the coat")
        rough = f'"float roughness" [ {number(material.roughness)} ] {_UNMAPPED}'
        if material.alpha is not None:
            rough = f"{self.texture(material.alpha, 'roughness', 'float')} {_UNMAPPED}"
        if material.ior == 1.5 and material.roughness > 0.0:
            return "plastic", [self.texture(diffuse, "Kd"), self.texture(material.specular, "Ks"), rough]
        smooth = material.roughness == 0.0
        parts = [self.texture(diffuse, "Kd"), self.texture(material.specular, "Kr" if smooth else "Ks")]
        parts += [self.constant("Ks" if smooth else "Kr", grey(0.0)), f'"float eta" [ {number(material.ior)} ]']
        return "uber", parts if smooth else [*parts, rough]

    def _glass(self, material: Glass, where: str) -> tuple[str, list[str]]:
        if material.thin:
            self.report.add(where, "a pane without thickness", "clear glass")
        lose_rays(material, where, self.report)
        parts = [self.texture(material.reflectance, "Kr"), self.texture(material.transmittance, "Kt")]
        parts.append(f'"float eta" [ {number(material.ior)} ]')
        return "glass", parts + ([self.unmapped(material)] if material.roughness != (0.0, 0.0) else [])

    def _phong(self, material: Phong, where: str) -> tuple[str, list[str]]:
        """Phong as ``uber`` with a highlight of equal width: ``alpha² = 2 / (exponent + 2)`` (Walter et al. 2007, sec.
        5.2)."""
        alpha = math.sqrt(2.0 / (material.exponent + 2.0))
        became = f"uber with a highlight of alpha {alpha:.3g}"
        self.report.add(where, "Phong reflection with a Fresnel-weighted mirror", became)
        mirrored = rgb(material.fresnel_min * np.array(material.mirror_tint))
        parts = [self.texture(material.diffuse, "Kd"), self.constant("Ks", material.specular)]
        parts += [self.constant("Kr", mirrored), self.constant("Kt", grey(0.0))]
        return "uber", [*parts, self.unmapped(Facets((alpha, alpha)))]

    def unmapped(self, facets: Facets | Metal | Glass | Glossy) -> str:
        """Parameters of the alphas along both directions of a surface, without remapping."""
        return f"{self.facets(facets)} {_UNMAPPED}"
