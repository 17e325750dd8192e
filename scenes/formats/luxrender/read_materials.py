"""Textures and materials of LuxRender 1.x, converted to the canonical scene.

Source: LuxRender scene file format 1.0 (wiki of LuxRender), sections on materials and textures.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from scenes import loading
from scenes.arithmetic import log, power
from scenes.canonical import (
    ConstantTexture,
    Glass,
    Glossy,
    ImageTexture,
    Masked,
    Material,
    Metal,
    Mirror,
    Rgb,
    SceneError,
    Texture,
    Translucent,
)
from scenes.formats.appearance.facets import Facets
from scenes.formats.appearance.folding import mean_of, product_of
from scenes.formats.appearance.indices import index_of_reflectance
from scenes.formats.appearance.mixtures import NOTHING, is_nothing, mixture_of
from scenes.formats.appearance.spectra import blackbody_rgb, grey, metal, rgb
from scenes.formats.directives.names import Names, Of
from scenes.formats.directives.surfaces import Maker, SurfaceFactory
from scenes.formats.directives.syntax import Parameters
from scenes.formats.directives.textures import Pair
from scenes.formats.geometry.conventions import first_row_below
from scenes.formats.losses import LossReport
from scenes.formats.text.scene_files import SceneFiles

_DARKEST = 1e-9  # share of light beyond a colordepth texture, as in LuxCore


class LuxSurfaces(SurfaceFactory):
    """Reader of textures and materials of LuxRender.

    Attributes:
        of_volumes: glasses whose refractive index is that of the volumes on both sides, by their ``id``.
    """

    def __init__(self, files: SceneFiles, report: LossReport, names: Names) -> None:
        super().__init__(files, report, names)
        self.of_volumes: dict[int, Material] = {}

    def image(self, parameters: Parameters, scale: Pair, offset: Pair) -> Texture:
        where = str(parameters.place)
        path, wrap = self.image_path(parameters)
        if path is None:
            return ConstantTexture(grey(0.5))
        image = lux_image(path, parameters.number("gamma", 2.2), parameters.number("gain", 1.0), where)
        kind = parameters.text("filtertype", "bilinear")
        kinds = {"nearest": "nearest", "bilinear": "bilinear", "mipmap_trilinear": "mipmap", "mipmap_ewa": "mipmap"}
        if kind not in kinds:
            raise SceneError(f"{where}: filtertype: expected one of {', '.join(kinds)}, got {kind!r}")
        size, start = first_row_below(scale, offset)
        return ImageTexture(image, size, start, wrap, kinds[kind], str(path))  # type: ignore[arg-type]

    def made_texture(self, kind: str, parameters: Parameters, of: Of) -> Texture:
        """A texture; in LuxRender the spectra of lamps are textures as well."""
        if kind == "blackbody":
            return ConstantTexture(blackbody_rgb(min(max(parameters.number("temperature", 6500.0), 100.0), 1e6), 1.0))
        if kind == "equalenergy":
            return ConstantTexture(grey(parameters.number("energy", 1.0)))
        if kind == "colordepth":
            share = np.clip(self.color(parameters, "Kt", grey(0.0)), _DARKEST, 1.0)
            depth = parameters.number("depth", 1.0)
            if not depth > 0.0:
                raise SceneError(f"{parameters.place}: depth: expected a positive number, got {depth:g}")
            return ConstantTexture(rgb(np.maximum(-log(share), 0.0) / depth))
        return super().made_texture(kind, parameters, of)

    def make_fresnel(self, kind: str, parameters: Parameters) -> tuple[Rgb, Rgb]:
        """Refractive index of a fresnel texture."""
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

    def makers(self) -> dict[str, Maker]:
        return {
            "matte": self.matte, "mirror": self._mirror, "glass": self._glass, "glass2": self._glass_of_volumes,
            "roughglass": self._glass, "metal": self._named_metal, "metal2": self._metal, "glossy": self._glossy,
            "shinymetal": self._glossy, "mix": self._mix, "mattetranslucent": self._mattetranslucent,
            "null": lambda _: NOTHING,
        }  # fmt: skip

    def base_colors(self) -> dict[str, str]:
        kinds = ("carpaint", "velvet", "cloth", "glossytranslucent", "scatter", "layered", "glossycoating")
        return dict.fromkeys((*kinds, "doubleside"), "Kd")

    def _mirror(self, parameters: Parameters) -> Material:
        return Mirror(self.texture(parameters, "Kr", grey(1.0)))

    def _facets(self, parameters: Parameters, default: float) -> Facets:
        return self.facets(parameters, ("", "uroughness", "vroughness"), default)

    def _glass(self, parameters: Parameters) -> Material:
        parts = self.texture(parameters, "Kr", grey(1.0)), self.texture(parameters, "Kt", grey(1.0))
        rough = parameters.text("type", "glass") == "roughglass"
        facets = self._facets(parameters, 0.001) if rough else Facets((0.0, 0.0))
        if "cauchyb" in parameters and self.scalar(parameters, "cauchyb", 0.0):
            self.report.add(str(parameters.place), "dispersion (cauchyb)", "one index for all colours")
        thin, index = parameters.truth("architectural", False), self.scalar(parameters, "index", 1.5)
        return Glass(*parts, index, facets.roughness, thin, alpha=facets.alpha, front_only=thin)

    def _glass_of_volumes(self, parameters: Parameters) -> Material:
        made = self._glass(parameters)
        self.of_volumes[id(made)] = made
        return made

    def _named_metal(self, parameters: Parameters) -> Material:
        name = parameters.text("name", "aluminium")
        index = metal(name)
        if index is None:
            self.report.add(str(parameters.place), f"the metal {name!r}, which is not known", "aluminium")
            index = metal("Al")
        assert index is not None
        facets = self._facets(parameters, 0.001)
        return Metal(*index, facets.roughness, alpha=facets.alpha)

    def _metal(self, parameters: Parameters) -> Material:
        name = parameters.text("fresnel", "")
        index = self.names.indices.get(name)
        if index is None:
            self.report.add(str(parameters.place), f"fresnel texture {name!r}, which is not defined", "aluminium")
            index = metal("Al")
        assert index is not None
        facets = self._facets(parameters, 0.001)
        return Metal(*index, facets.roughness, alpha=facets.alpha)

    def _glossy(self, parameters: Parameters) -> Material:
        parts = self.texture(parameters, "Kd", grey(0.5)), self.texture(parameters, "Ks", grey(0.5))
        if mean_of(self.texture(parameters, "Ka", grey(0.0))) != grey(0.0):
            self.report.add(str(parameters.place), "absorption in the coat (Ka)")
            parameters.asked.add("d")
        if parameters.truth("multibounce", False):
            self.report.add(str(parameters.place), "bounces between the facets of the coat (multibounce)", "one")
        facets = self._facets(parameters, 0.1)
        return Glossy(*parts, facets.roughness, facets.alpha)

    def _mix(self, parameters: Parameters) -> Material:
        first, second = self.mixed(parameters)
        amount = self.texture(parameters, "amount", grey(0.5), "float")
        return Masked(second, amount) if is_nothing(first) else mixture_of(first, second, amount)

    def _mattetranslucent(self, parameters: Parameters) -> Material:
        sides = self.texture(parameters, "Kr", grey(1.0)), self.texture(parameters, "Kt", grey(1.0))
        if not parameters.truth("energyconserving", False):
            return Translucent(*sides)
        if isinstance(sides[0], ConstantTexture):
            return Translucent(sides[0], product_of(sides[1], ConstantTexture(rgb(1.0 - np.array(sides[0].value)))))
        self.report.add(str(parameters.place), "energyconserving with a texture", "its mean")
        rest = ConstantTexture(rgb(1.0 - np.array(mean_of(sides[0]))))
        return Translucent(sides[0], product_of(sides[1], rest))


def lux_image(path: Path, gamma: float, gain: float, where: str) -> np.ndarray:
    """An image by LuxRender's rule: encoded values raised to ``gamma``, times ``gain``."""
    if not 0.1 <= gamma <= 10.0:
        raise SceneError(f"{where}: gamma: expected 0.1 to 10, got {gamma:g}")
    image = loading.read_image(path)
    linear = loading.is_linear(path)
    encoded = image if linear else loading.encoded_srgb(image)
    if gamma == 1.0 and gain == 1.0 and linear:
        return image
    return np.float32(gain) * power(np.maximum(encoded, 0.0), np.float32(gamma)).astype(np.float32)
