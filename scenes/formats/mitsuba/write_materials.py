"""Writer of textures and materials of Mitsuba files.

Source: Mitsuba 0.5 documentation; Mitsuba 3 documentation, plugin reference; Hagemann 2018, ch. 4.
"""

from __future__ import annotations

import dataclasses
import math
import re
import xml.etree.ElementTree as ElementTree
from dataclasses import dataclass, field

import numpy as np

from scenes.arithmetic import tan
from scenes.canonical import (
    Bumped,
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
    MetallicRough,
    Mirror,
    MixMaterial,
    NormalMapped,
    Phong,
    Plastic,
    Translucent,
    Uber,
)
from scenes.canonical.textures import WHITE
from scenes.formats.appearance.coats import STRONGEST, under_rough_coat
from scenes.formats.appearance.facets import with_even_facets
from scenes.formats.appearance.folding import height_of, mean_of
from scenes.formats.appearance.glass import lose_rays
from scenes.formats.appearance.mixtures import added_metal, is_nothing, lobes_of
from scenes.formats.appearance.normals import is_flat, map_of, scaled_normals
from scenes.formats.appearance.simpler import simpler
from scenes.formats.appearance.spectra import rgb
from scenes.formats.mitsuba.principled import write_principled
from scenes.formats.mitsuba.write_elements import Element, ElementWriter
from scenes.formats.text.numbers import number

BLUNT = 0.002
"""Alpha that replaces perfect mirrors in mixtures for Mitsuba 3."""


@dataclass
class MitsubaSurfaceWriter(ElementWriter):
    """Collects the elements of textures and materials."""

    _materials: dict[tuple[int, bool], tuple[Material, str]] = field(default_factory=dict)
    _one_sided: bool = False

    def material(self, material: Material, name: str = "", one_sided: bool = False) -> str:
        """The identifier of a material; a new one is written first."""
        key = id(material), one_sided
        if key not in self._materials:
            label = self.label(re.sub(r"[^\w.-]", "_", name) or "m")
            before, self._one_sided = self._one_sided, one_sided
            made = self.bsdf(material, f"material {name or type(material).__name__!r}")
            self._one_sided = before
            made.set("id", label)
            self.root.append(made)
            self._materials[key] = material, label
        return self._materials[key][1]

    def bsdf(self, material: Material, where: str) -> Element:
        """The element of a material; opaque ones are two-sided unless an instance is one-sided."""
        if is_nothing(material):
            return self.plugin("bsdf", "null")
        if isinstance(material, Masked):
            made = self.plugin("bsdf", "mask")
            self.texture(made, material.opacity, "opacity")
            made.append(self.bsdf(material.base, where))
            return made
        if isinstance(material, Plastic) and not material.layered:
            return self.bsdf(added_metal(material, where, self.report), where)
        if isinstance(material, Uber):
            return self.bsdf(lobes_of(material, where, self.report), where)
        if isinstance(material, MixMaterial):
            made = self.plugin("bsdf", "blendbsdf")
            amount = material.amount
            if isinstance(amount, ConstantTexture):  # a number, because Mitsuba 0.5 accepts no colour here
                if len(set(amount.value)) > 1:
                    self.report.add(where, "a mixture with a share for each colour", "by their mean")
                self.put(made, "float", "weight", number(float(np.mean(amount.value))))
            else:
                self.texture(made, amount, "weight")
            for part in (material.first, material.second):
                if isinstance(part, MixMaterial):  # by name, as it may have been written before
                    ElementTree.SubElement(made, "ref", {"id": self.material(part, "", self._one_sided)})
                else:
                    made.append(self.bsdf(self._blunt(part, where) if self.modern else part, where))
            return made
        if isinstance(material, Bumped):
            made = self.plugin("bsdf", "bumpmap" if self.modern else "bump")
            self.texture(made, height_of(material), "map")
            if isinstance(material.height, ConstantTexture):
                return self.bsdf(material.base, where)
            made.append(self.bsdf(material.base, where))
            return made
        if isinstance(material, NormalMapped) and self.modern:
            return self._normal_mapped(material, where)
        if isinstance(material, HeightField | NormalMapped) or (
            isinstance(material, MetallicRough) and not self.modern
        ):
            return self.bsdf(simpler(material, where, self.report), where)
        if isinstance(material, Glass):
            return self._glass(material, where)
        if isinstance(material, Translucent):
            return self._translucent(material, where)
        if self._one_sided:
            return self._opaque(material, where)
        both = self.plugin("bsdf", "twosided")
        both.append(self._opaque(material, where))
        return both

    def _normal_mapped(self, material: NormalMapped, where: str) -> Element:
        if is_flat(material):
            return self.bsdf(material.base, where)
        normals = map_of(scaled_normals(material.normals, material.scale, where, self.report))
        if not isinstance(normals, ImageTexture):
            self.report.add(where, "a normal map", "the normals of the shape")
            return self.bsdf(material.base, where)
        made, base = self.plugin("bsdf", "normalmap"), self.bsdf(material.base, where)
        self.numbers(made, normals, "normalmap")
        if base.get("type") != "twosided":
            made.append(base)
            return made
        made.append(base[0])
        base[:] = [made]
        return base

    def _blunt(self, material: Material, where: str) -> Material:
        """A perfect mirror or glass, replaced by facets of a small alpha, because Mitsuba 3.9's blend with a perfect
        one loses light."""
        made = material
        if isinstance(material, Mirror):
            made = Metal((0.0, 0.0, 0.0), (1.0, 1.0, 1.0), (BLUNT, BLUNT), material.reflectance)
        elif isinstance(material, Metal | Glass) and material.roughness == (0.0, 0.0):
            made = dataclasses.replace(material, roughness=(BLUNT, BLUNT))
        if made is not material:
            self.report.add(where, "a perfect mirror or glass in a mixture", f"one of alpha {BLUNT:g}")
        return made

    def _opaque(self, material: Material, where: str) -> Element:
        if isinstance(material, MetallicRough):
            return write_principled(material, where, self)
        if isinstance(material, Matte):
            rough = material.sigma_deg > 0.0 and not self.modern
            made = self.plugin("bsdf", "roughdiffuse" if rough else "diffuse")
            self.texture(made, material.reflectance, "reflectance")
            if rough:
                self.put(made, "float", "alpha", number(tan(math.radians(material.sigma_deg)) * math.sqrt(2.0)))
            elif material.sigma_deg:
                self.report.add(where, f"a roughness of {material.sigma_deg:g} degrees", "smooth")
            return made
        if isinstance(material, Mirror):
            if material.spread_deg:
                self.report.add(where, "rays spread about the mirrored one", "a sharp mirror")
            made = self.plugin("bsdf", "conductor")
            self.put(made, "string", "material", "none")
            self.texture(made, material.reflectance, "specularReflectance")
            return made
        if isinstance(material, Metal):
            smooth = material.roughness == (0.0, 0.0)
            made = self.plugin("bsdf", "conductor" if smooth else "roughconductor")
            self.color(made, "eta", material.eta)
            self.color(made, "k", material.k)
            if not self.modern:
                self.put(made, "float", "extEta", "1")
            if material.reflectance_scale != WHITE:
                self.texture(made, material.reflectance_scale, "specularReflectance")
            if not smooth:
                self.put(made, "string", "distribution", material.distribution)
                self._facets(made, material)
            return made
        if isinstance(material, Emissive):
            made = self.plugin("bsdf", "diffuse")
            self.color(made, "reflectance", (0.0, 0.0, 0.0))
            return made
        if isinstance(material, Phong) and not self.modern:
            if material.fresnel_max > 0.0:
                self.report.add(where, "the mirror of Phong reflection", "left out")
            made = self.plugin("bsdf", "phong")
            self.texture(made, material.diffuse, "diffuseReflectance")
            self.color(made, "specularReflectance", material.specular)
            self.put(made, "float", "exponent", number(material.exponent))
            return made
        return self._plastic(material, where)

    def _plastic(self, material: Material, where: str) -> Element:
        """A dielectric coat over a diffuse base, or its closest approximation; it has one alpha in Mitsuba 3."""
        rough = None
        if isinstance(material, Plastic | Glossy):
            material = with_even_facets(material, where, self.report) if self.modern else material
            rough = material.alpha
        if isinstance(material, Plastic):
            parts = material.diffuse, material.specular, material.ior, material.roughness
        elif isinstance(material, Glossy):
            # the index whose Fresnel reflectance at normal incidence is that of the coat
            alpha = math.sqrt(material.roughness[0] * material.roughness[1])
            coat = np.array(mean_of(material.specular))
            most = float(np.clip(coat.max(), 1e-4, STRONGEST))
            if coat.max() > most:
                became = f"one that reflects {most:.3g}; the matte base reflects the rest"
                self.report.add(where, f"a coat that reflects {coat.max():.3g}", became)
            index = (1.0 + math.sqrt(most)) / (1.0 - math.sqrt(most))
            base = under_rough_coat(material.diffuse, rgb(coat), most, alpha, where, self.report)
            parts = base, ConstantTexture(rgb(np.minimum(coat / most, 1.0))), index, alpha
            self.report.add(where, "glossy", f"rough plastic of alpha {alpha:.3g}")
        else:
            assert isinstance(material, Phong)
            alpha = math.sqrt(2.0 / (material.exponent + 2.0))
            parts = material.diffuse, WHITE, 1.5, alpha
            self.report.add(where, "Phong reflection", f"rough plastic of alpha {alpha:.3g}")
        made = self.plugin("bsdf", "roughplastic" if parts[3] > 0.0 else "plastic")
        self.texture(made, parts[0], "diffuseReflectance")
        self.texture(made, parts[1], "specularReflectance")
        self.put(made, "float", "intIOR", number(parts[2]))
        self.put(made, "float", "extIOR", "1")
        if isinstance(material, Plastic) and (rough is not None or parts[3] > 0.0):
            self.put(made, "string", "distribution", material.distribution)
        if rough is not None:
            self.numbers(made, rough, "alpha")
        elif parts[3] > 0.0:
            self.put(made, "float", "alpha", number(parts[3]))
        return made

    def _facets(self, made: Element, material: Metal | Glass) -> None:
        alphas = material.roughness
        if material.alpha is not None:
            self.numbers(made, material.alpha, "alpha")
        elif alphas[0] == alphas[1]:
            self.put(made, "float", "alpha", number(alphas[0]))
        else:
            self.put(made, "float", "alphaU", number(alphas[0]))
            self.put(made, "float", "alphaV", number(alphas[1]))

    def _glass(self, material: Glass, where: str) -> Element:
        lose_rays(material, where, self.report)
        rough = material.roughness != (0.0, 0.0)
        if rough and material.thin:
            self.report.add(where, "a rough pane", "a clear one")
        kind = "thindielectric" if material.thin else "roughdielectric" if rough else "dielectric"
        made = self.plugin("bsdf", kind)
        self.put(made, "float", "intIOR", number(material.ior))
        self.put(made, "float", "extIOR", "1")
        for texture, name in (
            (material.reflectance, "specularReflectance"),
            (material.transmittance, "specularTransmittance"),
        ):
            if texture != WHITE:
                self.texture(made, texture, name)
        if kind == "roughdielectric":
            self.put(made, "string", "distribution", material.distribution)
            self._facets(made, material)
        return made

    def _translucent(self, material: Translucent, where: str) -> Element:
        if self.modern:
            self.report.add(where, "diffuse transmission", "diffuse reflection alone")
        if self.modern or mean_of(material.transmittance) == (0.0, 0.0, 0.0):
            both = self.plugin("bsdf", "twosided")
            self.texture(self.plugin("bsdf", "diffuse", both), material.reflectance, "reflectance")
            return both
        if mean_of(material.reflectance) == (0.0, 0.0, 0.0):
            made = self.plugin("bsdf", "difftrans")
            self.texture(made, material.transmittance, "transmittance")
            return made
        self.report.add(where, "diffuse reflection and transmission", "a mixture of both")
        made = self.plugin("bsdf", "mixturebsdf")
        self.put(made, "string", "weights", "0.5, 0.5")
        both = self.plugin("bsdf", "twosided", made)
        twice = [
            ConstantTexture(rgb(2.0 * np.array(mean_of(part))))
            for part in (material.reflectance, material.transmittance)
        ]
        self.texture(self.plugin("bsdf", "diffuse", both), twice[0], "reflectance")
        self.texture(self.plugin("bsdf", "difftrans", made), twice[1], "transmittance")
        return made
