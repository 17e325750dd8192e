"""Colours and textures of directive files, converted to the canonical scene.

Source: PBRT v3 file format (https://www.pbrt.org/fileformat-v3), section on textures.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from scenes.canonical import (
    CheckerboardTexture,
    ConstantTexture,
    MixTexture,
    Rgb,
    SceneError,
    Texture,
)
from scenes.formats.appearance.facets import Facets, facets_of
from scenes.formats.appearance.folding import ValueChange, mean_of, product_of
from scenes.formats.appearance.spectra import blackbody_rgb, grey, metal, rgb, sampled_rgb, xyz_to_rgb
from scenes.formats.directives.names import Names, Of
from scenes.formats.directives.syntax import Parameters
from scenes.formats.losses import LossReport
from scenes.formats.text.scene_files import SceneFiles

_WRAPS = ("repeat", "clamp", "black")
_NO_TEXTURES = ("windy", "fbm", "wrinkled", "marble", "dots", "uv", "bilerp")

Pair = tuple[float, float]
Names3 = tuple[str, str, str]


@dataclass
class TextureReader:
    """Creates textures from parameters.

    Attributes:
        files: source of image files.
        report: receives the losses.
        names: names of textures and materials, defined by the reader.
    """

    files: SceneFiles
    report: LossReport
    names: Names

    def color(self, parameters: Parameters, name: str, default: Rgb) -> Rgb:
        """A colour, in any of the representations of the format.

        Raises:
            SceneError: the colour cannot be read.
        """
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
        path = self.files.known(file, where, self.report, f"the spectrum {file!r}", f"the colour {default}")
        if path is None:
            return default
        numbers = " ".join(line.split("#")[0] for line in self.files.text(path, where).splitlines()).split()
        try:
            values = np.array([float(number) for number in numbers]).reshape(-1, 2)
        except ValueError:
            raise SceneError(f"{path}: expected pairs of a wavelength and a value") from None
        if not len(values) or not np.isfinite(values).all():
            raise SceneError(f"{path}: expected pairs of finite numbers")
        return sampled_rgb(values[:, 0], values[:, 1])

    def texture(self, parameters: Parameters, name: str, default: Rgb, of: Of = "color") -> Texture:
        """A colour or float texture, by name, or a constant."""
        if parameters.types.get(name) != "texture":
            return ConstantTexture(self.color(parameters, name, default))
        found = self.names.textures(of).get(parameters.text(name, ""))
        if found is None:
            wanted = f"{name}: texture {parameters.text(name, '')!r} of type {of}, which is not defined"
            self.report.add(str(parameters.place), wanted, f"the constant {default}")
            return ConstantTexture(default)
        return found

    def scalar(self, parameters: Parameters, name: str, default: float) -> float:
        """A number; a texture that is not constant becomes its mean, which is reported."""
        if parameters.types.get(name) != "texture":
            return parameters.number(name, default)
        found = self.texture(parameters, name, grey(default), "float")
        value = float(np.mean(mean_of(found)))
        if not isinstance(found, ConstantTexture):
            self.report.add(str(parameters.place), f"{name}: a texture", f"its mean, {value:g}")
        return value

    def facets(
        self, parameters: Parameters, names: Names3, default: float, change: ValueChange | None = None
    ) -> Facets:
        """The roughness of a material, which is given for both tangent axes together or for each.

        Textures that differ along the axes, or that are not plain, become their means, which is reported.

        Args:
            parameters: parameters of the material.
            names: names for both axes (or empty), for u and for v.
            default: roughness if it is not given.
            change: alpha of given values.

        Raises:
            SceneError: a roughness is negative.
        """
        even = names[0] if names[0] in parameters else ""
        given = [name if name in parameters else even for name in names[1:]]
        if all(given) and all(parameters.types.get(name) == "texture" for name in given):
            first, second = (self.texture(parameters, name, grey(default), "float") for name in given)
            found = facets_of(first, change) if first is second else None
            if found is not None:
                return found
        both = self.scalar(parameters, names[0], default) if names[0] else default
        pair = np.array([self.scalar(parameters, name, both) for name in names[1:]])
        if pair.min() < 0.0:
            raise SceneError(f"{parameters.place}: roughness: expected no negative number, got {pair.min():g}")
        u, v = (pair if change is None else change(pair)).tolist()
        return Facets((u, v))

    def made_texture(self, kind: str, parameters: Parameters, of: Of) -> Texture:
        """The texture that a ``Texture`` directive defines, of colours or floats."""
        where = str(parameters.place)
        if kind == "constant":
            return self.texture(parameters, "value", (1.0, 1.0, 1.0), of)
        if kind == "scale":
            return product_of(*(self.texture(parameters, f"tex{n}", (1.0, 1.0, 1.0), of) for n in (1, 2)))
        if kind == "mix":
            amount = self.scalar(parameters, "amount", 0.5)
            parts = self.texture(parameters, "tex1", grey(0.0), of), self.texture(parameters, "tex2", grey(1.0), of)
            return MixTexture(*parts, amount)
        scale = (parameters.number("uscale", 1.0), parameters.number("vscale", 1.0))
        offset = (parameters.number("udelta", 0.0), parameters.number("vdelta", 0.0))
        mapping = parameters.text("mapping", "uv")
        if mapping != "uv":
            self.report.add(where, f"mapping {mapping!r} of a texture", "the mapping uv")
        if kind == "checkerboard":
            if parameters.whole("dimension", 2, 2, 3) == 3:
                self.report.add(where, "a checkerboard in space", "one over u and v")
            if parameters.text("aamode", "closedform") != "closedform":
                self.report.add(where, "antialiasing of the checkerboard", "that of the renderer")
            if offset != (0.0, 0.0):
                self.report.add(where, "udelta, vdelta of a checkerboard", "none")
            parts = self.texture(parameters, "tex1", grey(1.0), of), self.texture(parameters, "tex2", grey(0.0), of)
            return CheckerboardTexture(*parts, scale)
        if kind == "imagemap":
            return self.image(parameters, scale, offset)
        parameters.asked.update(parameters.given)
        if kind in _NO_TEXTURES:
            self.report.add(where, f"texture {kind!r}", "the constant 0.5")
        else:
            self.report.unknown(where, "texture", kind, "the constant 0.5")
        return ConstantTexture((0.5, 0.5, 0.5))

    def image(self, parameters: Parameters, scale: Pair, offset: Pair) -> Texture:
        """The texture of an image, by the rules of the dialect."""
        raise NotImplementedError

    def image_path(self, parameters: Parameters) -> tuple[Path | None, str]:
        """The file of an image, None if it is missing, and the extension of the image beyond its edges."""
        where, name = str(parameters.place), parameters.text("filename", "")
        path = self.files.known(name, where, self.report, f"the picture {name!r}", "the constant 0.5")
        if path is None:
            parameters.asked.update(parameters.given)
        wrap = parameters.text("wrap", "repeat")
        if wrap not in _WRAPS:
            raise SceneError(f"{where}: wrap: expected one of {', '.join(_WRAPS)}, got {wrap!r}")
        return path, wrap


def _count(parameters: Parameters, name: str, count: int) -> np.ndarray:
    found = parameters.numbers(name, count)
    assert found is not None
    return found


def _pairs(parameters: Parameters, name: str) -> np.ndarray:
    found = parameters.numbers(name)
    if found is None or len(found) < 2 or len(found) % 2:
        raise SceneError(f"{parameters.place}: {name}: expected pairs of a wavelength and a value")
    return found.reshape(-1, 2)
