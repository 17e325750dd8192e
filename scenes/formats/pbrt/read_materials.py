"""Textures and materials of PBRT v3, into the canonical scene's.

Source: PBRT v3 file format, sections on materials and textures; Pharr, Jakob and Humphreys 2016, ch. 8 to 10.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from scenes import loading
from scenes.arithmetic import log, power
from scenes.canonical import (
    Bumped,
    CheckerboardTexture,
    ConstantTexture,
    Glass,
    Glossy,
    ImageTexture,
    Material,
    Matte,
    Metal,
    Mirror,
    MixMaterial,
    MixTexture,
    Plastic,
    Rgb,
    ScaleTexture,
    SceneError,
    Texture,
    Translucent,
    Uber,
)
from scenes.formats.appearance.spectra import METALS, blackbody_rgb, grey, metal, rgb, sampled_rgb, xyz_to_rgb
from scenes.formats.losses import LossReport
from scenes.formats.text.directives import Parameters
from scenes.formats.text.scene_files import SceneFiles

_WRAPS = {"repeat": "repeat", "clamp": "clamp", "black": "black"}
_NO_TEXTURES = ("windy", "fbm", "wrinkled", "marble", "dots", "uv", "bilerp")


def alpha_of_roughness(roughness: float) -> float:
    """Microfacet alpha of PBRT's perceptual roughness (``RoughnessToAlpha``, Pharr et al. 2016, sec. 8.4.2)."""
    x = log(max(roughness, 1e-3))
    return 1.62142 + x * (0.819955 + x * (0.1734 + x * (0.0171201 + x * 0.000640711)))


@dataclass
class Surfaces:
    """Makes textures and materials of parameters.

    Attributes:
        files: for images.
        report: of what could not be kept.
        textures, materials: by name; filled by the reader.
    """

    files: SceneFiles
    report: LossReport
    textures: Mapping[str, Texture]
    materials: Mapping[str, Material]

    # --- colours and textures ------------------------------------------------------------------------------------

    def color(self, parameters: Parameters, name: str, default: Rgb) -> Rgb:
        """A colour, however it is given; raises SceneError where it cannot be read."""
        if name not in parameters:
            parameters.asked.add(name)
            return default
        kind, place = parameters.types[name], f"{parameters.place}: {name}"
        if kind in ("rgb", "color"):
            return rgb(_count(parameters, name, 3))
        if kind == "xyz":
            return xyz_to_rgb(_count(parameters, name, 3))
        if kind == "blackbody":
            values = parameters.numbers(name)
            if values is None or len(values) not in (1, 2) or not 100.0 <= values[0] <= 1e6:
                raise SceneError(f"{place}: expected a temperature of 100 to 1000000 K and a scale")
            return blackbody_rgb(float(values[0]), float(values[1]) if len(values) == 2 else 1.0)
        if kind == "float":
            return rgb(np.full(3, parameters.number(name, 0.0)))
        if kind == "spectrum":
            return self._spectrum(parameters, name, default)
        raise SceneError(f"{place}: expected a colour, got the type {kind!r}")

    def _spectrum(self, parameters: Parameters, name: str, default: Rgb) -> Rgb:
        given = parameters.given[name]
        if not isinstance(given, tuple):
            values = _pairs(parameters, name)
            return sampled_rgb(values[:, 0], values[:, 1])
        file = parameters.text(name, "")
        parts = Path(file).stem.split(".")[0].replace("metal-", "").split("-")
        known = metal(parts[0])
        if known is not None and parts[-1] in ("eta", "k"):
            return known[0] if parts[-1] == "eta" else known[1]
        where = str(parameters.place)
        path = self.files.path(file, where)
        numbers = " ".join(line.split("#")[0] for line in self.files.text(path, where).splitlines()).split()
        try:
            values = np.array([float(number) for number in numbers]).reshape(-1, 2)
        except ValueError:
            raise SceneError(f"{path}: expected pairs of a wavelength and a value") from None
        if not len(values) or not np.isfinite(values).all():
            raise SceneError(f"{path}: expected pairs of finite numbers")
        return sampled_rgb(values[:, 0], values[:, 1])

    def texture(self, parameters: Parameters, name: str, default: Rgb) -> Texture:
        """A texture by name, or a constant."""
        if parameters.types.get(name) != "texture":
            return ConstantTexture(self.color(parameters, name, default))
        found = self.textures.get(parameters.text(name, ""))
        if found is None:
            wanted = f"{name}: texture {parameters.text(name, '')!r}, which nothing defines"
            self.report.add(str(parameters.place), wanted, f"the constant {default}")
            return ConstantTexture(default)
        return found

    def scalar(self, parameters: Parameters, name: str, default: float) -> float:
        """A number; a texture becomes its mean, reported."""
        if parameters.types.get(name) != "texture":
            return parameters.number(name, default)
        value = float(np.mean(mean_of(self.texture(parameters, name, grey(default)))))
        self.report.add(str(parameters.place), f"{name}: a texture", f"its mean, {value:g}")
        return value

    def made_texture(self, kind: str, parameters: Parameters) -> Texture:
        """The texture that a ``Texture`` directive makes."""
        where = str(parameters.place)
        scale = (parameters.number("uscale", 1.0), parameters.number("vscale", 1.0))
        offset = (parameters.number("udelta", 0.0), parameters.number("vdelta", 0.0))
        mapping = parameters.text("mapping", "uv")
        if mapping != "uv":
            self.report.add(where, f"mapping {mapping!r} of a texture", "the mapping uv")
        if kind == "constant":
            return self.texture(parameters, "value", (1.0, 1.0, 1.0))
        if kind == "scale":
            return product(*(self.texture(parameters, f"tex{n}", (1.0, 1.0, 1.0)) for n in (1, 2)))
        if kind == "mix":
            amount = self.scalar(parameters, "amount", 0.5)
            parts = self.texture(parameters, "tex1", grey(0.0)), self.texture(parameters, "tex2", grey(1.0))
            return MixTexture(*parts, amount)
        if kind == "checkerboard":
            if parameters.whole("dimension", 2, 2, 3) == 3:
                self.report.add(where, "a checkerboard in space", "one over u and v")
            if parameters.text("aamode", "closedform") != "closedform":
                self.report.add(where, "antialiasing of the checkerboard", "that of the renderer")
            if offset != (0.0, 0.0):
                self.report.add(where, "udelta, vdelta of a checkerboard", "none")
            parts = self.texture(parameters, "tex1", grey(1.0)), self.texture(parameters, "tex2", grey(0.0))
            return CheckerboardTexture(*parts, scale)
        if kind == "imagemap":
            return self._image(parameters, scale, offset)
        parameters.asked.update(parameters.given)
        if kind in _NO_TEXTURES:
            self.report.add(where, f"texture {kind!r}", "the constant 0.5")
        else:
            self.report.unknown(where, "texture", kind, "the constant 0.5")
        return ConstantTexture((0.5, 0.5, 0.5))

    def _image(self, parameters: Parameters, scale: tuple[float, float], offset: tuple[float, float]) -> Texture:
        where = str(parameters.place)
        path = self.files.path(parameters.text("filename", ""), where)
        wrap = parameters.text("wrap", "repeat")
        if wrap not in _WRAPS:
            raise SceneError(f"{where}: wrap: expected one of {', '.join(_WRAPS)}, got {wrap!r}")
        image = loading.read_image(path)
        gamma = parameters.truth("gamma", path.suffix.lower() != ".exr")
        if gamma != (path.suffix.lower() != ".exr"):
            image = encoded_again(image) if not gamma else image
        factor = parameters.number("scale", 1.0)
        picture = image if factor == 1.0 else (image * np.float32(factor)).astype(np.float32)
        parameters.number("maxanisotropy", 8.0)
        parameters.truth("trilinear", False)
        return ImageTexture(picture, scale, offset, _WRAPS[wrap], "mipmap", str(path))  # type: ignore[arg-type]

    # --- materials -----------------------------------------------------------------------------------------------

    def material(self, kind: str, parameters: Parameters) -> Material:
        """The material of a kind; one that PBRT does not have is reported."""
        makers = {
            "matte": self._matte, "mirror": self._mirror, "glass": self._glass, "metal": self._metal,
            "substrate": self._substrate, "plastic": self._plastic, "translucent": self._translucent,
            "uber": self._uber, "mix": self._mix,
        }  # fmt: skip
        where = str(parameters.place)
        parameters.text("type", kind)
        if kind in makers:
            made = makers[kind](parameters)
        elif kind in ("", "none"):
            self.report.add(where, "a surface without a material (the border of a medium)", "black")
            made = Matte(ConstantTexture((0.0, 0.0, 0.0)))
        elif kind in ("disney", "fourier", "hair", "kdsubsurface", "subsurface"):
            base = self.texture(parameters, "color" if kind == "disney" else "Kd", (0.5, 0.5, 0.5))
            parameters.asked.update(parameters.given)
            self.report.add(where, f"material {kind!r}", "matte of its base colour")
            made = Matte(base)
        else:
            made = self.unknown_material(kind, parameters)
        if "bumpmap" in parameters and parameters.types["bumpmap"] == "texture":
            made = Bumped(made, self.texture(parameters, "bumpmap", (0.0, 0.0, 0.0)))
        return made

    def _alphas(self, parameters: Parameters, default: float) -> tuple[float, float]:
        even = self.scalar(parameters, "roughness", default)
        pair = self.scalar(parameters, "uroughness", even), self.scalar(parameters, "vroughness", even)
        if min(pair) < 0.0:
            raise SceneError(f"{parameters.place}: roughness: expected no negative number, got {min(pair):g}")
        if not parameters.truth("remaproughness", True):
            return pair
        return alpha_of_roughness(pair[0]), alpha_of_roughness(pair[1])

    def _matte(self, parameters: Parameters) -> Material:
        return Matte(self.texture(parameters, "Kd", grey(0.5)), self.scalar(parameters, "sigma", 0.0))

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
        """``eta``, or ``index``, which older files have."""
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
        return Plastic(*parts, 1.5, self._alphas(parameters, 0.1)[0])

    def _translucent(self, parameters: Parameters) -> Material:
        base = self.texture(parameters, "Kd", grey(0.25))
        sides = [self.texture(parameters, name, grey(0.5)) for name in ("reflect", "transmit")]
        glossy = self.texture(parameters, "Ks", grey(0.25))
        self._alphas(parameters, 0.1)
        if mean_of(glossy) != (0.0, 0.0, 0.0):
            self.report.add(str(parameters.place), "the glossy part of translucent", "left out")
        return Translucent(*(product(base, side) for side in sides))

    def _uber(self, parameters: Parameters) -> Material:
        ior = self._ior(parameters)
        names = (("Kd", 0.25), ("Ks", 0.25), ("Kr", 0.0), ("Kt", 0.0), ("opacity", 1.0))
        parts = [self.texture(parameters, name, grey(value)) for name, value in names]
        return Uber(*parts, ior=ior, roughness=self._alphas(parameters, 0.1))

    def _mix(self, parameters: Parameters) -> Material:
        first, second = self.mixed(parameters)
        # PBRT's amount is that of the first
        return mixture(second, first, self.texture(parameters, "amount", grey(0.5)))

    def unknown_material(self, kind: str, parameters: Parameters) -> Material:
        """Grey, reported."""
        parameters.asked.update(parameters.given)
        self.report.unknown(parameters.place, "material", kind, "grey, matte")
        return Matte(ConstantTexture(grey(0.5)))

    def mixed(self, parameters: Parameters) -> list[Material]:
        """The two materials of a mixture by name."""
        parts = []
        for name in ("namedmaterial1", "namedmaterial2"):
            wanted = parameters.text(name, "")
            if wanted not in self.materials:
                raise SceneError(f"{parameters.place}: {name}: expected a named material, got {wanted!r}")
            parts.append(self.materials[wanted])
        return parts


def mixture(first: Material, second: Material, amount: Texture) -> Material:
    """A mixture, ``amount`` of the second; a metal in black is one that reflects less."""
    black = isinstance(first, Matte) and first.reflectance == ConstantTexture(grey(0.0))
    if black and isinstance(second, Metal) and second.reflectance_scale == ConstantTexture(grey(1.0)):
        return dataclasses.replace(second, reflectance_scale=amount)
    return MixMaterial(first, second, amount)


def product(first: Texture, second: Texture) -> Texture:
    """The product of two textures, a constant where both are."""
    if isinstance(first, ConstantTexture) and isinstance(second, ConstantTexture):
        return ConstantTexture(rgb(np.multiply(first.value, second.value)))
    if isinstance(first, ConstantTexture) and first.value == (1.0, 1.0, 1.0):
        return second
    if isinstance(second, ConstantTexture) and second.value == (1.0, 1.0, 1.0):
        return first
    return ScaleTexture(first, second)


def mean_of(texture: Texture) -> Rgb:
    """Mean colour of a texture over its square."""
    if isinstance(texture, ConstantTexture):
        return texture.value
    if isinstance(texture, ImageTexture):
        return rgb(texture.image.reshape(-1, 3).mean(axis=0, dtype=np.float64))
    if isinstance(texture, CheckerboardTexture):
        return rgb(0.5 * (np.array(mean_of(texture.even)) + mean_of(texture.odd)))
    if isinstance(texture, ScaleTexture):
        return rgb(np.multiply(mean_of(texture.first), mean_of(texture.second)))
    weights = 1.0 - texture.amount, texture.amount
    return rgb(weights[0] * np.array(mean_of(texture.first)) + weights[1] * np.array(mean_of(texture.second)))


def encoded_again(image: np.ndarray) -> np.ndarray:
    """The encoded values of a decoded picture, for files that say theirs are linear."""
    low = image <= 0.0031308
    return np.where(low, 12.92 * image, 1.055 * power(np.maximum(image, 0.0), 1.0 / 2.4) - 0.055).astype(np.float32)


def _count(parameters: Parameters, name: str, count: int) -> np.ndarray:
    found = parameters.numbers(name, count)
    assert found is not None
    return found


def _pairs(parameters: Parameters, name: str) -> np.ndarray:
    found = parameters.numbers(name)
    if found is None or len(found) < 2 or len(found) % 2:
        raise SceneError(f"{parameters.place}: {name}: expected pairs of a wavelength and a value")
    return found.reshape(-1, 2)
