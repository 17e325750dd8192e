"""Textures and materials of LuxRender 1.x, into the canonical scene's; what differs from PBRT's.

Source: LuxRender scene file format 1.0 (wiki of LuxRender), sections on materials and textures.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from scenes import loading
from scenes.arithmetic import power
from scenes.canonical import (
    ConstantTexture,
    Glass,
    Glossy,
    ImageTexture,
    Masked,
    Material,
    Matte,
    Metal,
    Mirror,
    Rgb,
    SceneError,
    Texture,
    Translucent,
)
from scenes.formats.appearance.spectra import blackbody_rgb, grey, metal, rgb
from scenes.formats.pbrt.read_materials import Surfaces, encoded_again, mean_of, mixture, product
from scenes.formats.text.directives import Parameters


@dataclass
class LuxSurfaces(Surfaces):
    """Textures and materials of LuxRender; ``fresnel`` are its textures of complex indices."""

    fresnel: dict[str, tuple[Rgb, Rgb]] = dataclasses.field(default_factory=dict)

    def _image(self, parameters: Parameters, scale: tuple[float, float], offset: tuple[float, float]) -> Texture:
        where = str(parameters.place)
        path = self.files.path(parameters.text("filename", ""), where)
        wrap = parameters.text("wrap", "repeat")
        if wrap not in ("repeat", "clamp", "black"):
            raise SceneError(f"{where}: wrap: expected repeat, clamp or black, got {wrap!r}")
        image = lux_image(path, parameters.number("gamma", 2.2), parameters.number("gain", 1.0), where)
        kind = parameters.text("filtertype", "bilinear")
        kinds = {"nearest": "nearest", "bilinear": "bilinear", "mipmap_trilinear": "mipmap", "mipmap_ewa": "mipmap"}
        if kind not in kinds:
            raise SceneError(f"{where}: filtertype: expected one of {', '.join(kinds)}, got {kind!r}")
        # the first row is at v = 0 here, and at v = 1 in the canonical scene
        size, start = (scale[0], -scale[1]), (offset[0], 1.0 - offset[1])
        return ImageTexture(image, size, start, wrap, kinds[kind], str(path))  # type: ignore[arg-type]

    def made_texture(self, kind: str, parameters: Parameters) -> Texture:
        """The spectra of lamps are textures here."""
        if kind == "blackbody":
            return ConstantTexture(blackbody_rgb(min(max(parameters.number("temperature", 6500.0), 100.0), 1e6), 1.0))
        if kind == "equalenergy":
            return ConstantTexture(grey(parameters.number("energy", 1.0)))
        return super().made_texture(kind, parameters)

    def make_fresnel(self, kind: str, parameters: Parameters) -> tuple[Rgb, Rgb]:
        """Index of refraction of a fresnel texture."""
        where = str(parameters.place)
        if kind == "preset":
            name = parameters.text("name", "")
            found = metal(name)
            if found is None:
                self.report.add(where, f"the metal {name!r}, which is not known", "aluminium")
                found = metal("Al")
            assert found is not None
            return found
        if kind == "fresnelcolor":
            return index_of_reflectance(self.color(parameters, "Kr", grey(0.5)))
        if kind in ("constant", "cauchy"):
            name = "value" if kind == "constant" else "index"
            return grey(parameters.number(name, 1.5)), grey(0.0)
        parameters.asked.update(parameters.given)
        self.report.add(where, f"fresnel texture {kind!r}", "aluminium")
        found = metal("Al")
        assert found is not None
        return found

    def material(self, kind: str, parameters: Parameters) -> Material:
        makers = {
            "matte": self._matte, "mirror": self._mirror, "glass": self._glass, "glass2": self._glass,
            "roughglass": self._glass, "metal": self._named_metal, "metal2": self._metal, "glossy": self._glossy,
            "shinymetal": self._glossy, "mix": self._mix, "mattetranslucent": self._mattetranslucent,
        }  # fmt: skip
        where = str(parameters.place)
        parameters.text("type", kind)
        if kind in makers:
            made = makers[kind](parameters)
        elif kind == "null":
            made = Masked(Matte(ConstantTexture(grey(0.0))), ConstantTexture(grey(0.0)))
        elif kind in ("carpaint", "velvet", "cloth", "glossytranslucent", "scatter", "layered", "glossycoating",
                      "doubleside"):  # fmt: skip
            base = self.texture(parameters, "Kd", grey(0.5))
            parameters.asked.update(parameters.given)
            self.report.add(where, f"material {kind!r}", "matte of its base colour")
            made = Matte(base)
        else:
            made = self.unknown_material(kind, parameters)
        return made

    def _mirror(self, parameters: Parameters) -> Material:
        return Mirror(self.texture(parameters, "Kr", grey(1.0)))

    def _alphas(self, parameters: Parameters, default: float) -> tuple[float, float]:
        return self.scalar(parameters, "uroughness", default), self.scalar(parameters, "vroughness", default)

    def _glass(self, parameters: Parameters) -> Material:
        parts = self.texture(parameters, "Kr", grey(1.0)), self.texture(parameters, "Kt", grey(1.0))
        rough = parameters.text("type", "glass") == "roughglass"
        alphas = self._alphas(parameters, 0.001) if rough else (0.0, 0.0)
        if parameters.number("cauchyb", 0.0):
            self.report.add(str(parameters.place), "dispersion (cauchyb)", "one index for all colours")
        thin = parameters.truth("architectural", False)
        return Glass(*parts, self.scalar(parameters, "index", 1.5), alphas, thin)

    def _named_metal(self, parameters: Parameters) -> Material:
        name = parameters.text("name", "aluminium")
        index = metal(name)
        if index is None:
            self.report.add(str(parameters.place), f"the metal {name!r}, which is not known", "aluminium")
            index = metal("Al")
        assert index is not None
        return Metal(*index, self._alphas(parameters, 0.001))

    def _metal(self, parameters: Parameters) -> Material:
        name = parameters.text("fresnel", "")
        index = self.fresnel.get(name)
        if index is None:
            self.report.add(str(parameters.place), f"fresnel texture {name!r}, which nothing defines", "aluminium")
            index = metal("Al")
        assert index is not None
        return Metal(*index, self._alphas(parameters, 0.001))

    def _glossy(self, parameters: Parameters) -> Material:
        parts = self.texture(parameters, "Kd", grey(0.5)), self.texture(parameters, "Ks", grey(0.5))
        if mean_of(self.texture(parameters, "Ka", grey(0.0))) != grey(0.0):
            self.report.add(str(parameters.place), "absorption in the coat (Ka)")
            parameters.asked.add("d")
        if parameters.truth("multibounce", False):
            self.report.add(str(parameters.place), "bounces between the facets of the coat (multibounce)", "one")
        return Glossy(*parts, self._alphas(parameters, 0.1))

    def _mix(self, parameters: Parameters) -> Material:
        first, second = self.mixed(parameters)
        amount = self.texture(parameters, "amount", grey(0.5))
        return Masked(second, amount) if _nothing(first) else mixture(first, second, amount)

    def _mattetranslucent(self, parameters: Parameters) -> Material:
        sides = self.texture(parameters, "Kr", grey(1.0)), self.texture(parameters, "Kt", grey(1.0))
        if not parameters.truth("energyconserving", False):
            return Translucent(*sides)
        if isinstance(sides[0], ConstantTexture):
            return Translucent(sides[0], product(sides[1], ConstantTexture(rgb(1.0 - np.array(sides[0].value)))))
        self.report.add(str(parameters.place), "energyconserving with a texture", "its mean")
        rest = ConstantTexture(rgb(1.0 - np.array(mean_of(sides[0]))))
        return Translucent(sides[0], product(sides[1], rest))


def _nothing(material: Material) -> bool:
    """Whether a surface is not there."""
    return isinstance(material, Masked) and material.opacity == ConstantTexture(grey(0.0))


def index_of_reflectance(reflectance: Rgb) -> tuple[Rgb, Rgb]:
    """The real index that reflects so much at normal incidence: ``(1 + √r) / (1 - √r)``."""
    root = np.sqrt(np.clip(reflectance, 0.0, 0.9999))
    return rgb((1.0 + root) / (1.0 - root)), grey(0.0)


def reflectance_of_index(eta: Rgb, k: Rgb) -> Rgb:
    """What a conductor reflects at normal incidence (Fresnel's equations)."""
    n, absorbed = np.array(eta), np.array(k)
    return rgb(((n - 1.0) ** 2 + absorbed**2) / ((n + 1.0) ** 2 + absorbed**2))


def lux_image(path: Path, gamma: float, gain: float, where: str) -> np.ndarray:
    """An image by LuxRender's rule: values to the power of ``gamma``; 1 takes them as they are."""
    if not 0.1 <= gamma <= 10.0:
        raise SceneError(f"{where}: gamma: expected 0.1 to 10, got {gamma:g}")
    image = loading.read_image(path)
    encoded = image if path.suffix.lower() == ".exr" else encoded_again(image)
    if gamma == 1.0 and gain == 1.0 and path.suffix.lower() == ".exr":
        return image
    return np.float32(gain) * power(np.maximum(encoded, 0.0), np.float32(gamma)).astype(np.float32)
