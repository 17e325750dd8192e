"""Textures and materials of the canonical scene as directives, as far as PBRT and LuxRender share them.

Source: PBRT v3 file format (https://www.pbrt.org/fileformat-v3); Hagemann 2018, ch. 4.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import ClassVar, Literal

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
    Material,
    Matte,
    Metal,
    MetallicRough,
    Mirror,
    MixTexture,
    NormalMapped,
    Plastic,
    Rgb,
    ScaleTexture,
    Texture,
)
from scenes.formats.appearance.facets import Facets
from scenes.formats.appearance.folding import folded, height_of
from scenes.formats.appearance.simpler import simpler
from scenes.formats.directives.textures import Pair
from scenes.formats.losses import LossReport
from scenes.formats.text.numbers import listed, number
from scenes.formats.text.output import Output

Kind = Literal["color", "float"]


@dataclass
class SurfaceWriter:
    """Collects the lines of a scene, and the names that they define.

    Attributes:
        definitions: lines of textures and materials; those of the scene unless they have a file of their own.
        color_texture: type of colour textures.
        color: type of colour parameters.
        checkerboard_end: additional parameters of every checkerboard.
        distribution: the distribution of facets, for messages.
    """

    color_texture: ClassVar[str]
    color: ClassVar[str]
    checkerboard_end: ClassVar[str] = ""
    distribution: ClassVar[str] = "Trowbridge–Reitz (ggx)"

    output: Output
    report: LossReport
    lines: list[str] = field(default_factory=list)
    definitions: list[str] = field(init=False)
    _textures: dict[tuple[int, str], tuple[Texture, str]] = field(default_factory=dict)
    _materials: dict[int, tuple[Material, str]] = field(default_factory=dict)
    _taken: set[str] = field(default_factory=set)
    _counts: dict[str, int] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.definitions = self.lines

    # --- textures ------------------------------------------------------------------------------------------------

    def texture(self, texture: Texture, name: str, kind: Kind = "color") -> str:
        """A parameter of a material or texture; its texture is written first.

        Args:
            texture: texture to write.
            name: name of the parameter.
            kind: whether its values are colours or numbers.
        """
        if isinstance(texture, ConstantTexture):
            return self.constant(name, texture.value, kind)
        key = id(texture), kind
        if key not in self._textures:
            made = self.texture_line(texture, kind)
            label = self.label("t", "")
            self._textures[key] = texture, label
            self.definitions.append(f'\tTexture "{label}" "{self.color_texture if kind == "color" else kind}" {made}')
        return f'"texture {name}" [ "{self._textures[key][1]}" ]'

    def constant(self, name: str, value: Rgb, kind: Kind = "color") -> str:
        """A parameter with a constant colour, or with its mean as a number."""
        if kind == "float":
            return f'"float {name}" [ {number(sum(value) / 3.0)} ]'
        return f'"{self.color} {name}" {listed(value)}'

    def texture_line(self, texture: Texture, kind: Kind) -> str:
        if isinstance(texture, ImageTexture):
            return self.image_line(texture)
        if isinstance(texture, CheckerboardTexture):
            parts = f"{self.texture(texture.even, 'tex1', kind)} {self.texture(texture.odd, 'tex2', kind)}"
            u, v = (number(value) for value in texture.uv_scale)
            return f'"checkerboard" {parts} "float uscale" [ {u} ] "float vscale" [ {v} ]{self.checkerboard_end}'
        assert isinstance(texture, MixTexture | ScaleTexture)
        parts = f"{self.texture(texture.first, 'tex1', kind)} {self.texture(texture.second, 'tex2', kind)}"
        if isinstance(texture, MixTexture):
            return f'"mix" {parts} "float amount" [ {number(texture.amount)} ]'
        return f'"scale" {parts}'

    def image_line(self, texture: ImageTexture) -> str:
        """The directive of an image texture, by the rules of the dialect."""
        raise NotImplementedError

    def placed_image(self, file: str, texture: ImageTexture, more: str, scale: Pair, offset: Pair) -> str:
        """The directive of an image texture; ``more`` holds the parameters that are specific to the dialect."""
        return (
            f'"imagemap" "string filename" [ "{file}" ] "string wrap" [ "{texture.wrap}" ] {more}'
            f'"float uscale" [ {number(scale[0])} ] "float vscale" [ {number(scale[1])} ] '
            f'"float udelta" [ {number(offset[0])} ] "float vdelta" [ {number(offset[1])} ]'
        )

    # --- materials -----------------------------------------------------------------------------------------------

    def label(self, prefix: str, wanted: str = "") -> str:
        """An unused name: the wanted one if it is free and can be written."""
        label, count = wanted or f"{prefix}1", self._counts.get(prefix, 1)  # lower numbers are taken
        while label in self._taken or '"' in label or "\\" in label or "\n" in label:
            count += 1
            label = f"{prefix}{count}"
        self._taken.add(label)
        self._counts[prefix] = count
        return label

    def material(self, material: Material, name: str = "") -> str:
        """The name of a material; a new one is written first."""
        if id(material) not in self._materials:
            made = self.material_line(material, name or type(material).__name__)
            self.define(material, self.label("m", name), made)
        return self._materials[id(material)][1]

    def define(self, material: Material, label: str, line: str) -> None:
        """Writes a material under a name."""
        self._materials[id(material)] = material, label
        self.definitions.append(f'\tMakeNamedMaterial "{label}" {line}')

    def material_line(self, material: Material, name: str) -> str:
        """The definition of a material without its name; dialects override it for their own materials."""
        where = f"material {name!r}"
        if isinstance(material, HeightField | NormalMapped | MetallicRough):
            return self.material_line(simpler(material, where, self.report), name)
        if isinstance(material, Metal | Glass | Plastic) and np.max(material.roughness) > 0.0:
            if material.distribution != "ggx":
                self.report.add(where, f"the distribution {material.distribution} of facets", self.distribution)
        return plain_line(*self.plain_material(material, where))

    def bumped_line(self, material: Bumped, name: str, parameter: str) -> str:
        """The definition of a material with its height; an even height, which LuxCore refuses, has no effect."""
        line, height = self.material_line(material.base, name), folded(height_of(material))
        return line if isinstance(height, ConstantTexture) else f"{line} {self.texture(height, parameter, 'float')}"

    def facets(self, facets: Facets | Metal | Glass | Glossy) -> str:
        """Parameters of the roughness along both directions of a surface, or of its texture."""
        if facets.alpha is None:
            return roughness_pair(facets.roughness)
        return " ".join(self.texture(facets.alpha, name, "float") for name in ("uroughness", "vroughness"))

    def plain_material(self, material: Material, where: str) -> tuple[str, list[str]]:
        """Kind and parameters of a material that contains no other material."""
        if isinstance(material, Matte):
            sigma = [f'"float sigma" [ {number(material.sigma_deg)} ]'] if material.sigma_deg else []
            return "matte", [self.texture(material.reflectance, "Kd"), *sigma]
        if isinstance(material, Mirror):
            if material.spread_deg:
                self.report.add(where, "rays spread about the mirrored one", "a sharp mirror")
            return "mirror", [self.texture(material.reflectance, "Kr")]
        assert isinstance(material, Emissive)
        return "matte", [self.constant("Kd", (0.0, 0.0, 0.0))]


def plain_line(kind: str, parameters: list[str]) -> str:
    """The definition of a material that contains no other material."""
    return f'"string type" [ "{kind}" ] {" ".join(parameters)}'


def mixture_line(first: str, second: str, amount: str) -> str:
    """The definition of a mixture of two materials, given by name."""
    return (
        f'"string type" [ "mix" ] "string namedmaterial1" [ "{first}" ] "string namedmaterial2" [ "{second}" ] {amount}'
    )


def roughness_pair(alphas: Pair) -> str:
    """Parameters of the constant roughness along both directions of a surface."""
    return f'"float uroughness" [ {number(alphas[0])} ] "float vroughness" [ {number(alphas[1])} ]'
