"""Writer of textures and materials of PBRT v4 files.

Source: PBRT v4 file format (https://www.pbrt.org/fileformat-v4), sections on materials and textures.
"""

from __future__ import annotations

import math

import numpy as np

from scenes.canonical import (
    Bumped,
    ConstantTexture,
    Emissive,
    Glass,
    Glossy,
    ImageTexture,
    Masked,
    Material,
    Matte,
    Metal,
    Mirror,
    MixMaterial,
    Phong,
    Plastic,
    ScaleTexture,
    Texture,
    Translucent,
    Uber,
)
from scenes.canonical.textures import WHITE
from scenes.canonical.values import Rgb
from scenes.formats.appearance.coats import with_bounces
from scenes.formats.appearance.facets import Facets
from scenes.formats.appearance.folding import folded, mean_of, within_one
from scenes.formats.appearance.glass import lose_rays
from scenes.formats.appearance.mixtures import added_metal, dimmed, lobes_of
from scenes.formats.appearance.spectra import grey
from scenes.formats.directives.surface_writer import Kind, plain_line
from scenes.formats.pbrt.write_materials import PICTURES, PbrtSurfaceWriter
from scenes.formats.text.numbers import number

V4_PICTURES = (*PICTURES, ".hdr", ".qoi")
"""Endings of image files that PBRT v4 reads."""

_MIRROR = grey(0.0), grey(1.0)


class PbrtV4SurfaceWriter(PbrtSurfaceWriter):
    """Collects the lines of textures and materials."""

    def image_line(self, texture: ImageTexture) -> str:
        file = self.output.picture(texture.image, texture.source, V4_PICTURES)
        kind = {"bilinear": "bilinear", "nearest": "point", "mipmap": "trilinear"}[texture.filter]
        more = f'"string filter" [ "{kind}" ] '
        return self.placed_image(file, texture, more, texture.uv_scale, texture.uv_offset)

    def constant(self, name: str, value: Rgb, kind: Kind = "color") -> str:
        """A constant parameter; PBRT v4 refuses reflectances above 1."""
        bounded = kind == "color" and name not in ("eta", "k")
        return super().constant(name, within_one(value, name, self.report) if bounded else value, kind)

    def texture_line(self, texture: Texture, kind: Kind) -> str:
        plain = folded(texture)
        if isinstance(plain, ScaleTexture):
            self.report.add("texture", "a product of two textures", "the first times the mean of the second")
            factor = f'"float scale" [ {number(float(np.mean(mean_of(plain.second))))} ]'
            return f'"scale" {self.texture(plain.first, "tex", kind)} {factor}'
        if isinstance(plain, ConstantTexture):
            return f'"constant" {self.constant("value", plain.value, kind)}'
        return super().texture_line(plain, kind)

    def material_line(self, material: Material, name: str) -> str:
        where = f"material {name!r}"
        if isinstance(material, Bumped):
            return self.bumped_line(material, name, "displacement")
        if isinstance(material, Uber):
            return self.material_line(lobes_of(material, where, self.report), name)
        if isinstance(material, Plastic) and not material.layered:
            return self.material_line(added_metal(material, where, self.report), name)
        if isinstance(material, Metal) and material.reflectance_scale != WHITE:
            if (material.eta, material.k) == _MIRROR:
                return plain_line(*self.plain_material(material, where))
            material = dimmed(material)
        if isinstance(material, MixMaterial):
            names = " ".join(f'"{self.material(part)}"' for part in (material.first, material.second))
            amount = self.texture(material.amount, "amount", "float")
            if isinstance(material.amount, ConstantTexture) and len(set(material.amount.value)) > 1:
                self.report.add(where, "a mixture with a share for each colour", "by their mean")
            return f'"string type" [ "mix" ] "string materials" [ {names} ] {amount}'
        return super().material_line(material, name)

    def plain_material(self, material: Material, where: str) -> tuple[str, list[str]]:
        if isinstance(material, Matte | Emissive):
            color = material.reflectance if isinstance(material, Matte) else ConstantTexture(grey(0.0))
            if isinstance(material, Matte) and material.sigma_deg:
                self.report.add(where, f"a roughness of {material.sigma_deg:g} degrees", "smooth")
            return "diffuse", [self.texture(color, "reflectance")]
        if isinstance(material, Mirror):
            if material.spread_deg:
                self.report.add(where, "rays spread about the mirrored one", "a sharp mirror")
            return self._mirror(material.reflectance, Facets((0.0, 0.0)), where)
        if isinstance(material, Metal):
            if (material.eta, material.k) == _MIRROR:
                return self._mirror(material.reflectance_scale, material, where)
            index = [self.constant("eta", material.eta), self.constant("k", material.k)]
            return "conductor", [*index, self.unmapped(material)]
        if isinstance(material, Glass):
            return self._glass(material, where)
        if isinstance(material, Translucent):
            sides = (material.reflectance, "reflectance"), (material.transmittance, "transmittance")
            return "diffusetransmission", [self.texture(part, name) for part, name in sides]
        assert not isinstance(material, Masked | Bumped | MixMaterial | Uber)
        return self._coated(material, where)

    def _mirror(self, reflectance: Texture, facets: Facets | Metal, where: str) -> tuple[str, list[str]]:
        """A metal given by its reflectance at normal incidence, which becomes white at grazing angles."""
        if mean_of(reflectance) != (1.0, 1.0, 1.0):
            self.report.add(where, "a mirror of one colour", "a metal of that colour, white at the edge")
        return "conductor", [self.texture(reflectance, "reflectance"), self.unmapped(facets)]

    def _glass(self, material: Glass, where: str) -> tuple[str, list[str]]:
        lose_rays(material, where, self.report)
        if material.reflectance != WHITE or material.transmittance != WHITE:
            self.report.add(where, "coloured glass", "clear glass")
        index = f'"float eta" [ {number(material.ior)} ]'
        if material.thin:
            if material.roughness != (0.0, 0.0):
                self.report.add(where, "a rough pane", "a clear one")
            return "thindielectric", [index]
        return "dielectric", [index, self.unmapped(material)]

    def _coated(self, material: Material, where: str) -> tuple[str, list[str]]:
        """A base under a coat, or the closest approximation of a material that PBRT v4 lacks."""
        if isinstance(material, Plastic):
            base, ior, alpha = material.diffuse, material.ior, material.roughness
            if material.specular != WHITE:
                self.report.add(where, "a coat that reflects less than its index says", "as its index says")
        elif isinstance(material, Glossy):
            alpha = math.sqrt(material.roughness[0] * material.roughness[1])
            most = math.sqrt(float(np.clip(np.mean(mean_of(material.specular)), 1e-4, 0.25)))
            base, ior = material.diffuse, (1.0 + most) / (1.0 - most)
            self.report.add(where, "glossy", f"coated diffuse of alpha {alpha:.3g}, index {ior:.3g}")
        else:
            assert isinstance(material, Phong)
            alpha, base, ior = math.sqrt(2.0 / (material.exponent + 2.0)), material.diffuse, 1.5
            self.report.add(where, "Phong reflection with a Fresnel-weighted mirror", f"a coat of alpha {alpha:.3g}")
        ior = max(ior, 1.0001)
        color = with_bounces(base, ior, where, self.report)
        parts = [self.texture(color, "reflectance"), f'"float eta" [ {number(ior)} ]']
        rough = material.alpha if isinstance(material, Plastic | Glossy) else None
        return "coateddiffuse", [*parts, self.unmapped(Facets((alpha, alpha), rough))]
