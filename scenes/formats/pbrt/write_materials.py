"""Textures and materials of the canonical scene as lines of a PBRT v3 file.

Source: PBRT v3 file format (https://www.pbrt.org/fileformat-v3); Hagemann 2018, ch. 4.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Literal

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
    Rgb,
    ScaleTexture,
    Texture,
    Translucent,
    Uber,
)
from scenes.formats.appearance.spectra import rgb
from scenes.formats.losses import LossReport
from scenes.formats.text.output import Output

Kind = Literal["color", "float"]

PICTURES = (".exr", ".png", ".tga", ".pfm")
"""Endings of pictures that PBRT v3 reads."""


def number(value: float) -> str:
    """A number with what float32 holds, and more where it is needed."""
    return f"{float(value):.9g}"


def listed(values: Iterable[float]) -> str:
    """Numbers in brackets."""
    return f"[ {' '.join(number(value) for value in values)} ]"


WHITE = ConstantTexture((1.0, 1.0, 1.0))
_BLACK = Matte(ConstantTexture((0.0, 0.0, 0.0)))


def dimmed(material: Metal) -> MixMaterial:
    """A metal whose reflection is multiplied by a factor, as a mixture with black."""
    bright = dataclasses.replace(material, reflectance_scale=WHITE)
    return MixMaterial(_BLACK, bright, material.reflectance_scale)


@dataclass
class PbrtSurfaceWriter:
    """Lines of a scene, as they are made, and the names of what they define."""

    output: Output
    report: LossReport
    lines: list[str] = field(default_factory=list)
    color_kind: str = "spectrum"
    _textures: dict[tuple[int, str], tuple[Texture, str]] = field(default_factory=dict)
    _materials: dict[int, tuple[Material, str]] = field(default_factory=dict)
    _taken: set[str] = field(default_factory=set)

    def texture(self, texture: Texture, name: str, kind: Kind = "color") -> str:
        """A parameter of a material or texture, its texture written before; of numbers where the kind is ``float``."""
        if isinstance(texture, ConstantTexture):
            return self.constant(name, texture.value, kind)
        key = id(texture), kind
        if key not in self._textures:
            made = self._texture_line(texture, kind)
            label = self._label("t", "")
            self._textures[key] = texture, label
            self.lines.append(f'\tTexture "{label}" "{self.color_kind if kind == "color" else kind}" {made}')
        return f'"texture {name}" [ "{self._textures[key][1]}" ]'

    def constant(self, name: str, value: Rgb, kind: Kind) -> str:
        """A colour, or its mean as a number."""
        if kind == "float":
            return f'"float {name}" [ {number(sum(value) / 3.0)} ]'
        return f'"rgb {name}" {listed(value)}'

    def _texture_line(self, texture: Texture, kind: Kind) -> str:
        if isinstance(texture, ImageTexture):
            file = self.output.picture(texture.image, texture.source, PICTURES)
            scale, offset = texture.uv_scale, texture.uv_offset
            if texture.filter != "mipmap":
                self.report.add(f"texture {file}", f"the filter {texture.filter}", "levels of detail")
            return (
                f'"imagemap" "string filename" [ "{file}" ] "string wrap" [ "{texture.wrap}" ] '
                f'"float uscale" [ {number(scale[0])} ] "float vscale" [ {number(scale[1])} ] '
                f'"float udelta" [ {number(offset[0])} ] "float vdelta" [ {number(offset[1])} ]'
            )
        if isinstance(texture, CheckerboardTexture):
            parts = f"{self.texture(texture.even, 'tex1', kind)} {self.texture(texture.odd, 'tex2', kind)}"
            scale = texture.uv_scale
            return f'"checkerboard" {parts} "float uscale" [ {number(scale[0])} ] "float vscale" [ {number(scale[1])} ]'
        assert isinstance(texture, MixTexture | ScaleTexture)
        parts = f"{self.texture(texture.first, 'tex1', kind)} {self.texture(texture.second, 'tex2', kind)}"
        if isinstance(texture, MixTexture):
            return f'"mix" {parts} "float amount" [ {number(texture.amount)} ]'
        return f'"scale" {parts}'

    def _label(self, prefix: str, wanted: str) -> str:
        """A name that nothing has yet."""
        label, count = wanted or f"{prefix}1", 1
        while label in self._taken or '"' in label or "\\" in label or "\n" in label:
            count += 1
            label = f"{prefix}{count}"
        self._taken.add(label)
        return label

    def material(self, material: Material, name: str = "") -> str:
        """Name of a material, written before where it is new."""
        if id(material) not in self._materials:
            made = self._material_line(material, name or type(material).__name__)
            label = self._label("m", name)
            self._materials[id(material)] = material, label
            self.lines.append(f'\tMakeNamedMaterial "{label}" {made}')
        return self._materials[id(material)][1]

    def _material_line(self, material: Material, name: str) -> str:
        where = f"material {name!r}"
        if isinstance(material, Bumped):
            if material.scale != 1.0:
                self.report.add(where, "the scale of a bump map", "1")
            bump = self.texture(material.height, "bumpmap", "float")
            return f"{self._material_line(material.base, name)} {bump}"
        if isinstance(material, Masked):
            self.report.add(where, "holes in a material", "those of the shapes that have it")
            return self._material_line(material.base, name)
        if isinstance(material, HeightField):
            self.report.add(where, "a height field", "its material, flat")
            return self._material_line(material.base, name)
        if isinstance(material, MixMaterial):
            parts = f'"string namedmaterial1" [ "{self.material(material.second)}" ]'
            parts += f' "string namedmaterial2" [ "{self.material(material.first)}" ]'
            return f'"string type" [ "mix" ] {parts} {self.texture(material.amount, "amount")}'
        if isinstance(material, Metal) and material.reflectance_scale != WHITE:
            return self._material_line(dimmed(material), name)
        kind, parameters = self._plain_material(material, where)
        return f'"string type" [ "{kind}" ] {" ".join(parameters)}'

    def _plain_material(self, material: Material, where: str) -> tuple[str, list[str]]:
        if isinstance(material, Matte):
            sigma = [f'"float sigma" [ {number(material.sigma_deg)} ]'] if material.sigma_deg else []
            return "matte", [self.texture(material.reflectance, "Kd"), *sigma]
        if isinstance(material, Mirror):
            if material.spread_deg:
                self.report.add(where, "rays spread about the mirrored one", "a sharp mirror")
            return "mirror", [self.texture(material.reflectance, "Kr")]
        if isinstance(material, Glass):
            if material.thin:
                self.report.add(where, "a pane without thickness", "clear glass")
            if material.spread_deg:
                self.report.add(where, "rays spread about the perfect ones", "clear glass")
            parts = [self.texture(material.reflectance, "Kr"), self.texture(material.transmittance, "Kt")]
            parts.append(f'"float eta" [ {number(material.ior)} ]')
            return "glass", parts + (_roughness(material.roughness) if material.roughness != (0.0, 0.0) else [])
        if isinstance(material, Metal):
            if material.distribution != "ggx":
                self.report.add(where, f"the distribution {material.distribution} of facets", "Trowbridge–Reitz (ggx)")
            index = [f'"rgb eta" {listed(material.eta)}', f'"rgb k" {listed(material.k)}']
            return "metal", index + _roughness(material.roughness)
        if isinstance(material, Glossy):
            parts = [self.texture(material.diffuse, "Kd"), self.texture(material.specular, "Ks")]
            return "substrate", parts + _roughness(material.roughness)
        if isinstance(material, Plastic):
            if material.ior != 1.5:
                self.report.add(where, f"the index {material.ior:g} of a plastic", "1.5")
            parts = [self.texture(material.diffuse, "Kd"), self.texture(material.specular, "Ks")]
            rough = f'"float roughness" [ {number(material.roughness)} ] "bool remaproughness" [ "false" ]'
            return "plastic", [*parts, rough]
        if isinstance(material, Translucent):
            white, black = f'"rgb Kd" {listed((1.0, 1.0, 1.0))}', f'"rgb Ks" {listed((0.0, 0.0, 0.0))}'
            sides = [self.texture(material.reflectance, "reflect"), self.texture(material.transmittance, "transmit")]
            return "translucent", [white, black, *sides]
        if isinstance(material, Uber):
            names = ("diffuse", "Kd"), ("specular", "Ks"), ("reflectance", "Kr"), ("transmittance", "Kt")
            parts = [self.texture(getattr(material, ours), theirs) for ours, theirs in names]
            parts += [self.texture(material.opacity, "opacity"), f'"float eta" [ {number(material.ior)} ]']
            return "uber", parts + _roughness(material.roughness)
        if isinstance(material, Phong):
            return self._phong(material, where)
        assert isinstance(material, Emissive)
        return "matte", [f'"rgb Kd" {listed((0.0, 0.0, 0.0))}']

    def _phong(self, material: Phong, where: str) -> tuple[str, list[str]]:
        """Highlights as wide: alpha² = 2 / (exponent + 2) (Walter et al. 2007, sec. 5.2)."""
        alpha = math.sqrt(2.0 / (material.exponent + 2.0))
        became = f"uber with a highlight of alpha {alpha:.3g}"
        self.report.add(where, "Phong reflection with a Fresnel-weighted mirror", became)
        black = listed((0.0, 0.0, 0.0))
        parts = [self.texture(material.diffuse, "Kd"), f'"rgb Ks" {listed(material.specular)}']
        mirrored = rgb(material.fresnel_min * np.array(material.mirror_tint))
        return "uber", [*parts, f'"rgb Kr" {listed(mirrored)}', f'"rgb Kt" {black}', *_roughness((alpha, alpha))]


def _roughness(alphas: tuple[float, float]) -> list[str]:
    pair = f'"float uroughness" [ {number(alphas[0])} ] "float vroughness" [ {number(alphas[1])} ]'
    return [f'{pair} "bool remaproughness" [ "false" ]']
