"""Materials, textures and spectra of PBRT v4, converted to the canonical scene.

Source: PBRT v4 file format (https://www.pbrt.org/fileformat-v4), sections on materials, textures and spectra; Pharr,
Jakob and Humphreys 2023, ch. 9 and 10.
"""

from __future__ import annotations

import math

import numpy as np

from scenes import loading
from scenes.arithmetic import power, product
from scenes.canonical import (
    Bumped,
    ConstantTexture,
    Glass,
    ImageTexture,
    Material,
    Matte,
    Metal,
    MixMaterial,
    Plastic,
    Rgb,
    SceneError,
    Texture,
    Translucent,
)
from scenes.formats.appearance.coats import without_bounces
from scenes.formats.appearance.facets import Facets
from scenes.formats.appearance.folding import product_of
from scenes.formats.appearance.mixtures import NOTHING, mixture_of, plastic_of
from scenes.formats.appearance.spectra import METALS, blackbody_rgb, grey, rgb
from scenes.formats.directives.names import Of
from scenes.formats.directives.surfaces import Maker
from scenes.formats.directives.syntax import Parameters
from scenes.formats.directives.textures import Pair
from scenes.formats.pbrt.read_materials import PbrtSurfaces

PBRT_LUMINANCE = np.array([0.2126729, 0.7151522, 0.0721750])
"""Luminance weights of linear Rec. 709."""

_GLASSES = {"BK7": 1.5168, "BAF10": 1.67003, "FK51A": 1.48656, "LASF9": 1.85025, "F5": 1.60342, "SF5": 1.6727,
            "SF10": 1.72825, "SF11": 1.78472}  # fmt: skip
"""Refractive indices at 587.6 nm, from Schott's catalogue of optical glass."""

_FILTERS = {"bilinear": "bilinear", "point": "nearest", "trilinear": "mipmap", "ewa": "mipmap", "EWA": "mipmap"}


class PbrtV4Surfaces(PbrtSurfaces):
    """Creates the textures and materials of PBRT v4."""

    def makers(self) -> dict[str, Maker]:
        return {
            "diffuse": self._diffuse, "coateddiffuse": self._coated, "conductor": self._conductor,
            "coatedconductor": self._coated_metal, "dielectric": self._dielectric, "thindielectric": self._pane,
            "diffusetransmission": self._translucent_v4, "mix": self._mix_v4,
            **dict.fromkeys(("interface", "", "none"), lambda _: NOTHING),
        }  # fmt: skip

    def base_colors(self) -> dict[str, str]:
        return dict.fromkeys(("hair", "measured", "subsurface"), "reflectance")

    def material(self, kind: str, parameters: Parameters) -> Material:
        made = self._plain(kind, parameters)
        if "normalmap" in parameters:
            parameters.asked.add("normalmap")
            self.report.add(str(parameters.place), "a normal map", "none")
        if parameters.types.get("displacement") == "texture":
            return Bumped(made, self.texture(parameters, "displacement", grey(0.0), "float"))
        return made

    # --- spectra -------------------------------------------------------------------------------------------------

    def light(self, parameters: Parameters, name: str) -> Rgb:
        """The colour of a light: unchanged if it is given in RGB, else that of its spectrum normalised to luminance 1.

        Source: PBRT v4, ``SpectrumToPhotometric``: lights are divided by the luminance of their spectrum.
        """
        given = parameters.given.get(name)
        if parameters.types.get(name) == "blackbody":
            values = parameters.numbers(name, 1)
            assert values is not None
            if not 100.0 <= values[0] <= 1e6:
                raise SceneError(f"{parameters.place}: {name}: expected 100 to 1000000 K, got {values[0]:g}")
            return self._bright(blackbody_rgb(float(values[0]), 1.0))
        if isinstance(given, tuple) and parameters.types.get(name) == "spectrum" and given[0].startswith("stdillum"):
            parameters.asked.add(name)
            if given[0] == "stdillum-A":
                return self._bright(blackbody_rgb(2856.0, 1.0))
            if not given[0].startswith("stdillum-D"):
                self.report.add(str(parameters.place), f"the spectrum {given[0]!r}", "white")
            return grey(1.0)
        found = self.color(parameters, name, grey(1.0))
        return self._bright(found) if parameters.types.get(name) == "spectrum" else found

    @staticmethod
    def _bright(color: Rgb) -> Rgb:
        luminance = float(product(PBRT_LUMINANCE, color))
        return rgb(np.array(color) / luminance) if luminance > 0.0 else color

    def _index(self, parameters: Parameters, name: str = "eta") -> float:
        """A refractive index, as a number or by the name of a glass."""
        given = parameters.given.get(name)
        if isinstance(given, tuple) and parameters.types.get(name) == "spectrum":
            glass = parameters.text(name, "").removeprefix("glass-")
            self.report.add(str(parameters.place), f"dispersion of {glass!r}", "its index at 587.6 nm")
            return _GLASSES.get(glass, 1.5)
        if parameters.types.get(name) == "spectrum":
            return float(np.mean(self.color(parameters, name, grey(1.5))))
        return self.scalar(parameters, name, 1.5)

    # --- materials -----------------------------------------------------------------------------------------------

    def facets_v4(self, parameters: Parameters, prefix: str = "") -> Facets:
        """Facets whose alphas are the square roots of the roughness, unless it is not remapped."""
        names = f"{prefix}roughness", f"{prefix}uroughness", f"{prefix}vroughness"
        remapped = parameters.truth("remaproughness", True)
        return self.facets(parameters, names, 0.0, np.sqrt if remapped else None)

    def _diffuse(self, parameters: Parameters) -> Material:
        return Matte(self.texture(parameters, "reflectance", grey(0.5)))

    def _layers(self, parameters: Parameters, prefix: str, thickness: float) -> None:
        """Reads the parameters of the random walk between two layers, and reports those of the medium between them."""
        parameters.number(f"{prefix}thickness", thickness)
        for name, default in (("maxdepth", 10.0), ("nsamples", 1.0)):
            if parameters.number(name, default) != default:
                self.report.hint(str(parameters.place), f"{name} of layers", "all bounces")
        for name in ("albedo", "g"):
            if name in parameters:
                parameters.asked.add(name)
                self.report.add(str(parameters.place), f"{name} of the medium between layers", "clear")

    def _coated(self, parameters: Parameters) -> Material:
        where, ior = str(parameters.place), self._index(parameters)
        facets = self.facets_v4(parameters)
        alphas = facets.roughness
        alpha = math.sqrt(alphas[0] * alphas[1])
        if alphas[0] != alphas[1]:
            self.report.add(where, "a coat of two roughnesses", f"one of alpha {alpha:.3g}")
        self._layers(parameters, "", 0.01)
        base = without_bounces(self.texture(parameters, "reflectance", grey(0.5)), ior, where, self.report)
        return Plastic(base, ior=ior, roughness=alpha, alpha=facets.alpha)

    def _metal_index(self, parameters: Parameters, prefix: str) -> tuple[Rgb, Rgb, Texture]:
        """Complex index, and the factor of its reflection: a texture of the reflectance at normal incidence."""
        name, white = f"{prefix}reflectance", ConstantTexture(grey(1.0))
        if name not in parameters:
            eta, k = METALS["Cu"]
            return (
                self.color(parameters, f"{prefix}eta", eta),
                self.color(parameters, f"{prefix}k", k),
                white,
            )
        found = self.texture(parameters, name, grey(1.0))
        if not isinstance(found, ConstantTexture):
            self.report.add(str(parameters.place), "a metal with a textured reflectance", "constant over all angles")
            return grey(0.0), grey(1.0), found
        r = np.clip(found.value, 0.0, 0.9999)
        return grey(1.0), rgb(2.0 * np.sqrt(r) / np.sqrt(1.0 - r)), white

    def _conductor(self, parameters: Parameters) -> Material:
        eta, k, scale = self._metal_index(parameters, "")
        facets = self.facets_v4(parameters)
        return Metal(eta, k, facets.roughness, scale, alpha=facets.alpha)

    def _coated_metal(self, parameters: Parameters) -> Material:
        alpha = self.facets_v4(parameters, "interface.").roughness[0]
        self.report.add(str(parameters.place), f"a coat of alpha {alpha:.3g} over metal", "the metal alone")
        if "interface.eta" in parameters:
            parameters.asked.add("interface.eta")
        self._layers(parameters, "", 0.01)
        parameters.asked.add("interface.thickness")
        prefix = "" if "reflectance" in parameters else "conductor."
        eta, k, scale = self._metal_index(parameters, prefix)
        facets = self.facets_v4(parameters, "conductor.")
        return Metal(eta, k, facets.roughness, scale, alpha=facets.alpha)

    def _dielectric(self, parameters: Parameters) -> Material:
        facets = self.facets_v4(parameters)
        return Glass(ior=self._index(parameters), roughness=facets.roughness, alpha=facets.alpha)

    def _pane(self, parameters: Parameters) -> Material:
        return Glass(ior=self._index(parameters), thin=True)

    def _translucent_v4(self, parameters: Parameters) -> Material:
        factor = ConstantTexture(grey(self.scalar(parameters, "scale", 1.0)))
        sides = [self.texture(parameters, name, grey(0.25)) for name in ("reflectance", "transmittance")]
        return Translucent(*(product_of(side, factor) for side in sides))

    def _mix_v4(self, parameters: Parameters) -> Material:
        parameters.asked.add("materials")
        names = parameters.given.get("materials", ())
        if not isinstance(names, tuple) or len(names) != 2:
            raise SceneError(f"{parameters.place}: materials: expected two names")
        first, second = (self.named(name, str(parameters.place)) for name in names)
        made = mixture_of(first, second, self.texture(parameters, "amount", grey(0.5), "float"))
        return plastic_of(made) if isinstance(made, MixMaterial) else made

    # --- textures ------------------------------------------------------------------------------------------------

    def made_texture(self, kind: str, parameters: Parameters, of: Of) -> Texture:
        if kind == "scale" and "tex" in parameters:
            factor = self.texture(parameters, "scale", grey(1.0), "float")
            return product_of(self.texture(parameters, "tex", grey(1.0), of), factor)
        return super().made_texture(kind, parameters, of)

    def image(self, parameters: Parameters, scale: Pair, offset: Pair) -> Texture:
        path, wrap = self.image_path(parameters)
        if path is None:
            return ConstantTexture(grey(0.5))
        where, image = str(parameters.place), loading.read_image(path)
        encoding = parameters.text("encoding", "sRGB").split()
        if not loading.is_linear(path) and encoding[:1] != ["sRGB"]:
            image = loading.encoded_srgb(image)
            gamma = float(encoding[1]) if encoding[:1] == ["gamma"] and _is_number(encoding[1:]) else 1.0
            image = power(image, np.float32(gamma)).astype(np.float32)
        if parameters.truth("invert", False):
            image = np.maximum(1.0 - image, 0.0).astype(np.float32)
        factor = parameters.number("scale", 1.0)
        image = image if factor == 1.0 else (image * np.float32(factor)).astype(np.float32)
        parameters.number("maxanisotropy", 8.0)
        kind = parameters.text("filter", "bilinear")
        if kind not in _FILTERS:
            raise SceneError(f"{where}: filter: expected one of {', '.join(_FILTERS)}, got {kind!r}")
        return ImageTexture(image, scale, offset, wrap, _FILTERS[kind], str(path))  # type: ignore[arg-type]


def _is_number(words: list[str]) -> bool:
    try:
        return len(words) == 1 and 0.0 < float(words[0]) < 100.0
    except ValueError:
        return False
