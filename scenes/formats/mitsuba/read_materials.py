"""Materials of Mitsuba 0.5, converted to the canonical scene.

Source: Mitsuba 0.5 documentation, sections on scattering models and textures.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from scenes.arithmetic import arctan
from scenes.canonical import (
    Bumped,
    ConstantTexture,
    Glass,
    Glossy,
    Masked,
    Material,
    Matte,
    Metal,
    MixMaterial,
    NormalMapped,
    Phong,
    Plastic,
    SceneError,
    Translucent,
)
from scenes.canonical.facets import Distribution
from scenes.formats.appearance.coats import without_bounces
from scenes.formats.appearance.facets import Facets, facets_of
from scenes.formats.appearance.folding import mean_of
from scenes.formats.appearance.mixtures import NOTHING, plastic_of
from scenes.formats.appearance.spectra import grey, metal
from scenes.formats.mitsuba.principled import principled
from scenes.formats.mitsuba.properties import Properties, ior
from scenes.formats.mitsuba.read_textures import MitsubaTextures
from scenes.formats.text.xml_tree import XmlNode

_NESTED_MAX = 32
_ONE_SIDED = ("diffuse", "roughdiffuse", "conductor", "roughconductor", "plastic", "roughplastic", "phong", "ward")
_AROUND = ("mask", "blendbsdf", "mixturebsdf", "bump", "bumpmap", "coating", "roughcoating", "normalmap")


@dataclass
class MitsubaSurfaces(MitsubaTextures):
    """Creates textures and materials from elements."""

    made: dict[int, Material] = field(default_factory=dict)
    _sides: dict[int, bool] = field(default_factory=dict)
    _deep: int = 0

    def material(self, node: XmlNode) -> Material:
        """The material of an element, created once; an unknown kind is reported."""
        if id(node) in self.made:
            return self.made[id(node)]
        makers = {
            "diffuse": self._diffuse, "roughdiffuse": self._diffuse, "dielectric": self._dielectric,
            "thindielectric": self._dielectric, "roughdielectric": self._dielectric, "conductor": self._conductor,
            "roughconductor": self._conductor, "plastic": self._plastic, "roughplastic": self._plastic,
            "phong": self._phong, "ward": self._ward, "difftrans": self._difftrans, "twosided": self._twosided,
            "mask": self._mask, "blendbsdf": self._blend, "mixturebsdf": self._mixture, "bump": self._bump,
            "bumpmap": self._bump, "coating": self._coating, "roughcoating": self._coating,
            "normalmap": self._normal_map, "principled": lambda found: principled(found, self),
        }  # fmt: skip
        kind, properties = node.get("type"), Properties(node, self.report)
        self._deep += 1
        if self._deep > _NESTED_MAX:
            raise SceneError(f"{node.place}: expected at most {_NESTED_MAX} materials inside each other")
        if kind in makers:
            made = makers[kind](properties)
            properties.left_over()
        elif kind == "null":
            made = NOTHING
        elif kind in ("hk", "irawan", "sssbrdf", "rmbrdf", "dipole", "measured", "hair", "pplastic"):
            self.report.add(properties.where, f"material {kind!r}", "grey, matte")
            made = Matte(ConstantTexture(grey(0.5)))
        else:
            self.report.unknown(properties.where, "material", kind, "grey, matte")
            made = Matte(ConstantTexture(grey(0.5)))
        self._deep -= 1
        self.made[id(node)] = made
        return made

    def one_sided(self, node: XmlNode, deep: int = 0) -> bool:
        """Whether the material of an element is black on the back: opaque materials are one-sided in Mitsuba unless
        stated otherwise."""
        if id(node) not in self._sides:
            self._sides[id(node)] = self._one_sided(node, deep)
        return self._sides[id(node)]

    def _one_sided(self, node: XmlNode, deep: int) -> bool:
        if node.get("type") in _ONE_SIDED:
            return True
        if node.get("type") not in _AROUND or deep > _NESTED_MAX:
            return False
        parts = [self.find(child) if child.tag == "ref" else child for child in node.children if child.tag != "alias"]
        return all(self.one_sided(part, deep + 1) for part in parts if part.tag == "bsdf")

    def inner(self, properties: Properties) -> list[Material]:
        """Materials nested in a material, given as elements or references."""
        found = []
        for child in properties.rest:
            node = self.find(child) if child.tag == "ref" else child
            if node.tag == "bsdf":
                found.append(self.material(node))
        return found

    def one_inner(self, properties: Properties) -> Material:
        """The nested material; of two, the first.

        Raises:
            SceneError: there is no nested material, or more than two.
        """
        found = self.inner(properties)
        if len(found) not in (1, 2):
            raise SceneError(f"{properties.where}: expected a bsdf inside, got {len(found)}")
        return found[0]

    def _scalar(self, properties: Properties, name: str, default: float) -> float:
        """A number; a texture that is not constant becomes its mean, which is reported."""
        if not _is_texture(properties, name):
            return properties.number(name, default)
        found = self.texture(properties, name, grey(default))
        value = sum(mean_of(found)) / 3.0
        if not isinstance(found, ConstantTexture):
            self.report.add(properties.where, f"{name}: a texture", f"its mean, {value:g}")
        return value

    def _facets(self, properties: Properties) -> Facets:
        """The roughness: a texture if ``alpha`` is one and the two axes have no own."""
        if not any(child.get("name") in ("alphaU", "alphaV") for child in properties.node.children):
            given = self.texture(properties, "alpha", grey(0.1)) if _is_texture(properties, "alpha") else None
            found = None if given is None else facets_of(given)
            if found is not None:
                return found
        return Facets(self._alphas(properties))

    def _alphas(self, properties: Properties) -> tuple[float, float]:
        even = self._scalar(properties, "alpha", 0.1)
        pair = self._scalar(properties, "alphaU", even), self._scalar(properties, "alphaV", even)
        if min(pair) < 0.0:
            raise SceneError(f"{properties.where}: alpha: expected no negative number, got {min(pair):g}")
        return pair

    def _distribution(self, properties: Properties) -> Distribution:
        found = properties.text("distribution", "beckmann")
        if found not in ("beckmann", "ggx"):
            self.report.add(properties.where, f"the distribution {found!r} of facets", "beckmann")
        return "ggx" if found == "ggx" else "beckmann"

    def _diffuse(self, properties: Properties) -> Material:
        name = "diffuseReflectance" if "diffuseReflectance" in properties else "reflectance"
        sigma = 0.0
        if properties.node.get("type") == "roughdiffuse":
            # alpha is sqrt(2) times the slopes' standard deviation, the tangent of sigma
            sigma = math.degrees(arctan(self._scalar(properties, "alpha", 0.2) / math.sqrt(2.0)))
            properties.truth("useFastApprox", False)
        return Matte(self.texture(properties, name, grey(0.5)), sigma)

    def _dielectric(self, properties: Properties) -> Material:
        kind = properties.node.get("type")
        index = ior(properties, "intIOR", "bk7") / ior(properties, "extIOR", "air")
        parts = (
            self.texture(properties, "specularReflectance", grey(1.0)),
            self.texture(properties, "specularTransmittance", grey(1.0)),
        )
        if kind == "roughdielectric":
            facets, distribution = self._facets(properties), self._distribution(properties)
            return Glass(*parts, index, facets.roughness, alpha=facets.alpha, distribution=distribution)
        return Glass(*parts, index, thin=kind == "thindielectric")

    def _conductor(self, properties: Properties) -> Material:
        name = properties.text("material", "Cu")
        known = metal(name)
        if known is None and name != "none":
            if "eta" not in properties:
                self.report.add(properties.where, f"the metal {name!r}, which is not known", "copper")
            known = metal("Cu")
        outside = ior(properties, "extEta", "air") if "extEta" in properties else 1.0
        if known is None:  # a perfect mirror
            known = grey(0.0), grey(1.0)
        index = [
            tuple(np.array(properties.color(part, value)) / outside)
            for part, value in zip(("eta", "k"), known, strict=True)
        ]
        scale = self.texture(properties, "specularReflectance", grey(1.0))
        if properties.node.get("type") == "conductor":
            return Metal(index[0], index[1], (0.0, 0.0), scale)
        kind, facets = self._distribution(properties), self._facets(properties)
        return Metal(index[0], index[1], facets.roughness, scale, kind, facets.alpha)

    def _plastic(self, properties: Properties) -> Material:
        index = ior(properties, "intIOR", "polypropylene") / ior(properties, "extIOR", "air")
        parts = (
            self.texture(properties, "diffuseReflectance", grey(0.5)),
            self.texture(properties, "specularReflectance", grey(1.0)),
        )
        if properties.truth("nonlinear", False):
            parts = without_bounces(parts[0], index, properties.where, self.report), parts[1]
        alpha, facets = 0.0, Facets((0.0, 0.0))
        kind: Distribution = "ggx"
        if properties.node.get("type") == "roughplastic":
            facets = self._facets(properties)
            alphas = facets.roughness
            alpha = math.sqrt(alphas[0] * alphas[1])
            if alphas[0] != alphas[1]:
                self.report.add(properties.where, "a coat of two roughnesses", f"one of alpha {alpha:.3g}")
            kind = self._distribution(properties)
        return Plastic(*parts, index, alpha, alpha=facets.alpha, distribution=kind)

    def _phong(self, properties: Properties) -> Material:
        specular = mean_of(self.texture(properties, "specularReflectance", grey(0.2)))
        diffuse = self.texture(properties, "diffuseReflectance", grey(0.5))
        exponent = properties.number("exponent", 30.0)
        if exponent < 1.0:
            self.report.add(properties.where, f"an exponent of {exponent:g}", "1")
        return Phong(diffuse, specular, max(exponent, 1.0))

    def _ward(self, properties: Properties) -> Material:
        self.report.add(properties.where, "material 'ward'", "glossy")
        properties.text("variant", "balanced")
        parts = (
            self.texture(properties, "diffuseReflectance", grey(0.5)),
            self.texture(properties, "specularReflectance", grey(0.2)),
        )
        facets = self._facets(properties)
        return Glossy(*parts, facets.roughness, facets.alpha)

    def _difftrans(self, properties: Properties) -> Material:
        return Translucent(ConstantTexture(grey(0.0)), self.texture(properties, "transmittance", grey(0.5)))

    def _twosided(self, properties: Properties) -> Material:
        if len(self.inner(properties)) > 1:
            self.report.add(properties.where, "another material on the back", "that of the front")
        return self.one_inner(properties)

    def _mask(self, properties: Properties) -> Material:
        return Masked(self.one_inner(properties), self.texture(properties, "opacity", grey(0.5)))

    def _blend(self, properties: Properties) -> Material:
        parts = self.inner(properties)
        if len(parts) != 2:
            raise SceneError(f"{properties.where}: blendbsdf: expected two bsdfs inside, got {len(parts)}")
        return plastic_of(MixMaterial(parts[0], parts[1], self.texture(properties, "weight", grey(0.5))))

    def _mixture(self, properties: Properties) -> Material:
        parts = self.inner(properties)
        words = properties.text("weights", "").replace(",", " ").split()
        try:
            weights = [float(word) for word in words]
        except ValueError:
            weights = []
        if not parts or len(weights) != len(parts) or not all(0.0 <= weight <= 1e6 for weight in weights):
            raise SceneError(f"{properties.where}: mixturebsdf: expected as many weights as bsdfs")
        total, made = weights[0], parts[0]
        for weight, part in zip(weights[1:], parts[1:], strict=True):
            total += weight
            made = MixMaterial(made, part, ConstantTexture(grey(weight / total if total > 0.0 else 0.0)))
        if abs(total - 1.0) > 1e-6:
            self.report.add(properties.where, f"weights of a mixture that sum to {total:g}", "1")
        return made

    def _bump(self, properties: Properties) -> Material:
        maps = [child for child in properties.rest if child.tag in ("texture", "ref")]
        nodes = [self.find(child) if child.tag == "ref" else child for child in maps]
        properties.asked.update(child.get("name") for child in maps)
        heights = [node for node in nodes if node.tag == "texture"]
        if not heights:
            raise SceneError(f"{properties.where}: bump: expected a texture inside")
        return Bumped(self.one_inner(properties), self.made_texture(heights[0]), properties.number("scale", 1.0))

    def _normal_map(self, properties: Properties) -> Material:
        normals = self.texture(properties, "normalmap", (0.5, 0.5, 1.0))
        return NormalMapped(self.one_inner(properties), normals)

    def _coating(self, properties: Properties) -> Material:
        properties.asked.update(properties.given)
        properties.asked.update(child.get("name") for child in properties.rest)
        self.report.add(properties.where, f"{properties.node.get('type')} over a material", "the material alone")
        return self.one_inner(properties)


def _is_texture(properties: Properties, name: str) -> bool:
    return any(child.tag in ("texture", "ref") and child.get("name") == name for child in properties.rest)
