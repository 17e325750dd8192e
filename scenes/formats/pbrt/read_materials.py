"""Textures and materials of PBRT v3, converted to the canonical scene.

Source: PBRT v3 file format (https://www.pbrt.org/fileformat-v3), sections on materials and textures; Pharr, Jakob and
Humphreys 2016, ch. 8 to 10.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from scenes import loading
from scenes.arithmetic import log
from scenes.canonical import (
    ConstantTexture,
    Glass,
    Glossy,
    ImageTexture,
    Material,
    Metal,
    Mirror,
    Plastic,
    Texture,
    Translucent,
    Uber,
)
from scenes.formats.appearance.facets import Facets
from scenes.formats.appearance.folding import mean_of, product_of
from scenes.formats.appearance.mixtures import NOTHING, mixture_of
from scenes.formats.appearance.spectra import METALS, grey
from scenes.formats.directives.surfaces import Maker, SurfaceFactory
from scenes.formats.directives.syntax import Parameters
from scenes.formats.directives.textures import Pair

_ROUGHNESS = ("roughness", "uroughness", "vroughness")


def alpha_of_roughness(roughness: NDArray[np.float64]) -> NDArray[np.float64]:
    """Microfacet alphas of PBRT's perceptual roughness ``r``, a polynomial of fourth degree in ``ln r``.

    Source: ``RoughnessToAlpha``, Pharr et al. 2016, sec. 8.4.2.
    """
    x = log(np.maximum(roughness, 1e-3))
    return 1.62142 + x * (0.819955 + x * (0.1734 + x * (0.0171201 + x * 0.000640711)))


class PbrtSurfaces(SurfaceFactory):
    """Creates the textures and materials of PBRT."""

    def image(self, parameters: Parameters, scale: Pair, offset: Pair) -> Texture:
        path, wrap = self.image_path(parameters)
        if path is None:
            return ConstantTexture(grey(0.5))
        image = loading.read_image(path)
        encoded = not loading.is_linear(path)
        if not parameters.truth("gamma", encoded) and encoded:
            image = loading.encoded_srgb(image)
        factor = parameters.number("scale", 1.0)
        picture = image if factor == 1.0 else (image * np.float32(factor)).astype(np.float32)
        parameters.number("maxanisotropy", 8.0)
        parameters.truth("trilinear", False)
        return ImageTexture(picture, scale, offset, wrap, "mipmap", str(path))  # type: ignore[arg-type]

    def makers(self) -> dict[str, Maker]:
        return {
            "matte": self.matte, "mirror": self._mirror, "glass": self._glass, "metal": self._metal,
            "substrate": self._substrate, "plastic": self._plastic, "translucent": self._translucent,
            "uber": self._uber, "mix": self._mix, "": lambda _: NOTHING,
            "none": lambda _: NOTHING,
        }  # fmt: skip

    def base_colors(self) -> dict[str, str]:
        return {"disney": "color", **dict.fromkeys(("fourier", "hair", "kdsubsurface", "subsurface"), "Kd")}

    def _facets(self, parameters: Parameters, default: float) -> Facets:
        remapped = parameters.truth("remaproughness", True)
        return self.facets(parameters, _ROUGHNESS, default, alpha_of_roughness if remapped else None)

    def _mirror(self, parameters: Parameters) -> Material:
        return Mirror(self.texture(parameters, "Kr", grey(0.9)))

    def _glass(self, parameters: Parameters) -> Material:
        ior = self._ior(parameters)
        parts = self.texture(parameters, "Kr", grey(1.0)), self.texture(parameters, "Kt", grey(1.0))
        facets = self._facets(parameters, 0.0)
        given = [name for name in _ROUGHNESS if name in parameters]
        smooth = facets.alpha is None and all(self.scalar(parameters, name, 0.0) == 0.0 for name in given)
        return Glass(*parts, ior, (0.0, 0.0) if smooth else facets.roughness, alpha=facets.alpha)

    def _ior(self, parameters: Parameters) -> float:
        """The refractive index: ``eta``, or ``index`` in older files."""
        return self.scalar(parameters, "eta", self.scalar(parameters, "index", 1.5))

    def _metal(self, parameters: Parameters) -> Material:
        eta, k = METALS["Cu"]
        index = self.color(parameters, "eta", eta), self.color(parameters, "k", k)
        facets = self._facets(parameters, 0.01)
        return Metal(*index, facets.roughness, alpha=facets.alpha)

    def _substrate(self, parameters: Parameters) -> Material:
        parts = self.texture(parameters, "Kd", grey(0.5)), self.texture(parameters, "Ks", grey(0.5))
        facets = self._facets(parameters, 0.1)
        return Glossy(*parts, facets.roughness, facets.alpha)

    def _plastic(self, parameters: Parameters) -> Material:
        parts = self.texture(parameters, "Kd", grey(0.25)), self.texture(parameters, "Ks", grey(0.25))
        facets = self._facets(parameters, 0.1)
        return Plastic(*parts, 1.5, facets.roughness[0], layered=False, alpha=facets.alpha)

    def _translucent(self, parameters: Parameters) -> Material:
        base = self.texture(parameters, "Kd", grey(0.25))
        sides = [self.texture(parameters, name, grey(0.5)) for name in ("reflect", "transmit")]
        glossy = self.texture(parameters, "Ks", grey(0.25))
        self._facets(parameters, 0.1)
        if mean_of(glossy) != (0.0, 0.0, 0.0):
            self.report.add(str(parameters.place), "the glossy part of translucent", "left out")
        return Translucent(*(product_of(base, side) for side in sides))

    def _uber(self, parameters: Parameters) -> Material:
        ior = self._ior(parameters)
        names = (("Kd", 0.25), ("Ks", 0.25), ("Kr", 0.0), ("Kt", 0.0), ("opacity", 1.0))
        parts = [self.texture(parameters, name, grey(value)) for name, value in names]
        facets = self._facets(parameters, 0.1)
        if facets.alpha is not None:
            self.report.add(str(parameters.place), "a texture of the roughness", f"its mean, {facets.roughness[0]:.3g}")
        return Uber(*parts, ior=ior, roughness=facets.roughness)

    def _mix(self, parameters: Parameters) -> Material:
        first, second = self.mixed(parameters)
        # PBRT's amount is the share of the first material
        return mixture_of(second, first, self.texture(parameters, "amount", grey(0.5)))
