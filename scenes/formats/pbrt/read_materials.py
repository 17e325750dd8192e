"""Textures and materials of PBRT v3, converted to the canonical scene.

Source: PBRT v3 file format (https://www.pbrt.org/fileformat-v3), sections on materials and textures; Pharr, Jakob and
Humphreys 2016, ch. 8 to 10.
"""

from __future__ import annotations

import numpy as np

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
    SceneError,
    Texture,
    Translucent,
    Uber,
)
from scenes.formats.appearance.folding import mean_of, product_of
from scenes.formats.appearance.mixtures import NOTHING, mixture_of
from scenes.formats.appearance.spectra import METALS, grey
from scenes.formats.directives.surfaces import Maker, SurfaceFactory
from scenes.formats.directives.syntax import Parameters
from scenes.formats.directives.textures import Pair


def alpha_of_roughness(roughness: float) -> float:
    """Microfacet alpha of PBRT's perceptual roughness ``r``, a polynomial of fourth degree in ``ln r``.

    Source: ``RoughnessToAlpha``, Pharr et al. 2016, sec. 8.4.2.
    """
    x = log(max(roughness, 1e-3))
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

    def _alphas(self, parameters: Parameters, default: float) -> tuple[float, float]:
        even = self.scalar(parameters, "roughness", default)
        pair = self.scalar(parameters, "uroughness", even), self.scalar(parameters, "vroughness", even)
        if min(pair) < 0.0:
            raise SceneError(f"{parameters.place}: roughness: expected no negative number, got {min(pair):g}")
        if not parameters.truth("remaproughness", True):
            return pair
        return alpha_of_roughness(pair[0]), alpha_of_roughness(pair[1])

    def _mirror(self, parameters: Parameters) -> Material:
        return Mirror(self.texture(parameters, "Kr", grey(0.9)))

    def _glass(self, parameters: Parameters) -> Material:
        ior = self._ior(parameters)
        parts = self.texture(parameters, "Kr", grey(1.0)), self.texture(parameters, "Kt", grey(1.0))
        rough = any(name in parameters for name in ("uroughness", "vroughness", "roughness"))
        remapped = self._alphas(parameters, 0.0)
        smooth = all(self.scalar(parameters, name, 0.0) == 0.0 for name in ("uroughness", "vroughness", "roughness"))
        return Glass(*parts, ior, remapped if rough and not smooth else (0.0, 0.0))

    def _ior(self, parameters: Parameters) -> float:
        """The refractive index: ``eta``, or ``index`` in older files."""
        return self.scalar(parameters, "eta", self.scalar(parameters, "index", 1.5))

    def _metal(self, parameters: Parameters) -> Material:
        eta, k = METALS["Cu"]
        index = self.color(parameters, "eta", eta), self.color(parameters, "k", k)
        return Metal(*index, self._alphas(parameters, 0.01))

    def _substrate(self, parameters: Parameters) -> Material:
        parts = self.texture(parameters, "Kd", grey(0.5)), self.texture(parameters, "Ks", grey(0.5))
        return Glossy(*parts, self._alphas(parameters, 0.1))

    def _plastic(self, parameters: Parameters) -> Material:
        parts = self.texture(parameters, "Kd", grey(0.25)), self.texture(parameters, "Ks", grey(0.25))
        return Plastic(*parts, 1.5, self._alphas(parameters, 0.1)[0], layered=False)

    def _translucent(self, parameters: Parameters) -> Material:
        base = self.texture(parameters, "Kd", grey(0.25))
        sides = [self.texture(parameters, name, grey(0.5)) for name in ("reflect", "transmit")]
        glossy = self.texture(parameters, "Ks", grey(0.25))
        self._alphas(parameters, 0.1)
        if mean_of(glossy) != (0.0, 0.0, 0.0):
            self.report.add(str(parameters.place), "the glossy part of translucent", "left out")
        return Translucent(*(product_of(base, side) for side in sides))

    def _uber(self, parameters: Parameters) -> Material:
        ior = self._ior(parameters)
        names = (("Kd", 0.25), ("Ks", 0.25), ("Kr", 0.0), ("Kt", 0.0), ("opacity", 1.0))
        parts = [self.texture(parameters, name, grey(value)) for name, value in names]
        return Uber(*parts, ior=ior, roughness=self._alphas(parameters, 0.1))

    def _mix(self, parameters: Parameters) -> Material:
        first, second = self.mixed(parameters)
        # PBRT's amount is the share of the first material
        return mixture_of(second, first, self.texture(parameters, "amount", grey(0.5)))
