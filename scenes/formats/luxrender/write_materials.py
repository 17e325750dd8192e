"""Textures and materials of the canonical scene as lines of a LuxRender 1.x file; what differs from PBRT's.

Source: LuxRender scene file format 1.0 (wiki of LuxRender); Hagemann 2018, ch. 4.
"""

from __future__ import annotations

import math

import numpy as np

from scenes.canonical import (
    Bumped,
    CheckerboardTexture,
    ConstantTexture,
    Emissive,
    Glass,
    Glossy,
    HeightField,
    ImageTexture,
    Masked,
    Material,
    Matte,
    Metal,
    Mirror,
    MixMaterial,
    MixTexture,
    Phong,
    Plastic,
    ScaleTexture,
    Texture,
    Translucent,
    Uber,
)
from scenes.canonical.values import Rgb
from scenes.formats.appearance.spectra import METALS, rgb
from scenes.formats.luxrender.read_materials import reflectance_of_index
from scenes.formats.pbrt.read_materials import mean_of, product
from scenes.formats.pbrt.write_materials import Kind, PbrtSurfaceWriter, dimmed, listed, number

_METAL_NAMES = {"Ag": "silver", "Al": "aluminium", "Au": "gold", "Cu": "copper"}


class LuxSurfaceWriter(PbrtSurfaceWriter):
    """Lines of textures and materials."""

    color_kind: str = "color"
    _null: Matte | None = None

    def constant(self, name: str, value: Rgb, kind: Kind) -> str:
        if kind == "float":
            return super().constant(name, value, kind)
        return f'"color {name}" {listed(value)}'

    def _texture_line(self, texture: Texture, kind: Kind) -> str:
        if isinstance(texture, ImageTexture):
            file = self.output.picture(texture.image, texture.source, (".exr",))
            # the first row is at v = 0 here
            size, start = (
                (texture.uv_scale[0], -texture.uv_scale[1]),
                (texture.uv_offset[0], 1.0 - texture.uv_offset[1]),
            )
            levels = {"nearest": "nearest", "bilinear": "bilinear", "mipmap": "mipmap_ewa"}[texture.filter]
            return (
                f'"imagemap" "string filename" [ "{file}" ] "string wrap" [ "{texture.wrap}" ] '
                f'"string filtertype" [ "{levels}" ] "float gamma" [ 1 ] '
                f'"float uscale" [ {number(size[0])} ] "float vscale" [ {number(size[1])} ] '
                f'"float udelta" [ {number(start[0])} ] "float vdelta" [ {number(start[1])} ]'
            )
        if isinstance(texture, CheckerboardTexture):
            return f'{super()._texture_line(texture, kind)} "integer dimension" [ 2 ] "string mapping" [ "uv" ]'
        assert isinstance(texture, MixTexture | ScaleTexture)
        return super()._texture_line(texture, kind)

    def _material_line(self, material: Material, name: str) -> str:
        where = f"material {name!r}"
        if isinstance(material, Bumped):
            if material.scale != 1.0:
                self.report.add(where, "the scale of a bump map", "1")
            return f"{self._material_line(material.base, name)} {self.texture(material.height, 'bumpmap', 'float')}"
        if isinstance(material, MixMaterial):
            parts = f'"string namedmaterial1" [ "{self.material(material.first)}" ]'
            parts += f' "string namedmaterial2" [ "{self.material(material.second)}" ]'
            if isinstance(material.amount, ConstantTexture) and len(set(material.amount.value)) > 1:
                self.report.add(where, "a mixture of each colour by itself", "by their mean")
            return f'"string type" [ "mix" ] {parts} {self.texture(material.amount, "amount", "float")}'
        if isinstance(material, Masked):
            return self._material_line(MixMaterial(self._nothing(), material.base, material.opacity), name)
        if isinstance(material, Metal) and _even(material.reflectance_scale):
            return self._material_line(dimmed(material), name)
        if isinstance(material, HeightField):
            return super()._material_line(material, name)
        kind, parameters = self._plain_material(material, where)
        return f'"string type" [ "{kind}" ] {" ".join(parameters)}'

    def _nothing(self) -> Material:
        """A surface that is not there."""
        if self._null is None:
            self._null = Matte(ConstantTexture((0.0, 0.0, 0.0)))
            label = self._label("m", "nothing")
            self._materials[id(self._null)] = self._null, label
            self.lines.append(f'\tMakeNamedMaterial "{label}" "string type" [ "null" ]')
        return self._null

    def _plain_material(self, material: Material, where: str) -> tuple[str, list[str]]:
        if isinstance(material, Matte):
            sigma = [f'"float sigma" [ {number(material.sigma_deg)} ]'] if material.sigma_deg else []
            return "matte", [self.texture(material.reflectance, "Kd"), *sigma]
        if isinstance(material, Mirror):
            if material.spread_deg:
                self.report.add(where, "rays spread about the mirrored one", "a sharp mirror")
            return "mirror", [self.texture(material.reflectance, "Kr")]
        if isinstance(material, Glass):
            return self._glass(material, where)
        if isinstance(material, Metal):
            return self._metal(material, where)
        if isinstance(material, Translucent):
            # LuxCore takes it for energy conserving whatever the file says
            kept = 1.0 - np.array(mean_of(material.reflectance))
            if isinstance(material.reflectance, ConstantTexture) and (kept > 1e-6).all():
                through = product(material.transmittance, ConstantTexture(rgb(1.0 / kept)))
            else:
                through = material.transmittance
                self.report.add(where, "what a textured translucent surface lets through", "less what it reflects")
            sides = [self.texture(material.reflectance, "Kr"), self.texture(through, "Kt")]
            return "mattetranslucent", [*sides, '"bool energyconserving" [ "true" ]']
        if isinstance(material, Emissive):
            return "matte", [f'"color Kd" {listed((0.0, 0.0, 0.0))}']
        return self._coated(material, where)

    def _coated(self, material: Material, where: str) -> tuple[str, list[str]]:
        """What is a coat over a diffuse base, or becomes one."""
        if isinstance(material, Glossy):
            parts = material.diffuse, material.specular, material.roughness
        elif isinstance(material, Plastic):
            fresnel = ((material.ior - 1.0) / (material.ior + 1.0)) ** 2
            coat = ConstantTexture(rgb(fresnel * np.array(mean_of(material.specular))))
            parts = material.diffuse, coat, (max(material.roughness, 1e-3),) * 2
            self.report.add(
                where, "plastic", f"glossy that reflects {fresnel:.3g} of its highlight at normal incidence"
            )
        elif isinstance(material, Phong):
            alpha = math.sqrt(2.0 / (material.exponent + 2.0))
            mirror = np.array(material.specular) + material.fresnel_min * np.array(material.mirror_tint)
            parts = material.diffuse, ConstantTexture(rgb(mirror)), (alpha, alpha)
            self.report.add(where, "Phong reflection with a Fresnel-weighted mirror", f"glossy of alpha {alpha:.3g}")
        else:
            assert isinstance(material, Uber)
            parts = material.diffuse, material.specular, material.roughness
            self.report.add(where, "uber", "glossy, without its mirror, transmission and opacity")
        textures = [self.texture(parts[0], "Kd"), self.texture(parts[1], "Ks"), *_roughness(parts[2])]
        return "glossy", [*textures, '"bool multibounce" [ "false" ]']

    def _glass(self, material: Glass, where: str) -> tuple[str, list[str]]:
        if material.spread_deg:
            self.report.add(where, "rays spread about the perfect ones", "clear glass")
        parts = [self.texture(material.reflectance, "Kr"), self.texture(material.transmittance, "Kt")]
        parts.append(f'"float index" [ {number(material.ior)} ]')
        if material.roughness != (0.0, 0.0):
            return "roughglass", parts + _roughness(material.roughness)
        return "glass", [*parts, f'"bool architectural" [ "{str(material.thin).lower()}" ]']

    def _metal(self, material: Metal, where: str) -> tuple[str, list[str]]:
        """A preset where the metal is one, else the colour that it reflects at normal incidence."""
        label = self._label("t", "")
        known = (_METAL_NAMES.get(name) for name, index in METALS.items() if index == (material.eta, material.k))
        preset, plain = next(known, ""), mean_of(material.reflectance_scale) == (1.0, 1.0, 1.0)
        if material.distribution != "ggx":
            self.report.add(where, f"the distribution {material.distribution} of facets", "LuxRender's own")
        if preset and plain:
            self.lines.append(f'\tTexture "{label}" "fresnel" "preset" "string name" [ "{preset}" ]')
        else:
            color = np.array(reflectance_of_index(material.eta, material.k)) * mean_of(material.reflectance_scale)
            self.lines.append(f'\tTexture "{label}" "fresnel" "fresnelcolor" "color Kr" {listed(color)}')
            if material.k != (0.0, 0.0, 0.0) or not plain:
                self.report.add(where, "the complex index of a metal", "its colour at normal incidence")
        return "metal2", [f'"texture fresnel" [ "{label}" ]', *_roughness(material.roughness)]


def _even(scale: Texture) -> bool:
    """Whether a factor is less than one and the same for all colours."""
    return isinstance(scale, ConstantTexture) and len(set(scale.value)) == 1 and scale.value[0] < 1.0


def _roughness(alphas: tuple[float, ...]) -> list[str]:
    return [f'"float uroughness" [ {number(alphas[0])} ]', f'"float vroughness" [ {number(alphas[1])} ]']
