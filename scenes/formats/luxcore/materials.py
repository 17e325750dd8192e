"""Textures, volumes and materials of LuxCore as parameters of those of LuxRender 1.x.

Source: LuxCore SDK reference manual (wiki of LuxCoreRender), sections on textures, volumes and materials.
"""

from __future__ import annotations

import math
from collections.abc import Container, Mapping

import numpy as np

from scenes.arithmetic import product
from scenes.canonical import Texture
from scenes.formats.appearance.folding import mean_of
from scenes.formats.directives.names import Names
from scenes.formats.directives.syntax import Values
from scenes.formats.losses import LossReport
from scenes.formats.luxcore.directives import numbers, parameters, texts
from scenes.formats.luxcore.surfaces import DEFAULTS, MATERIALS, TEXTURES
from scenes.formats.luxcore.syntax import Block, Property
from scenes.formats.luxrender.read import LUMINANCE

_FRESNEL = ("fresnelpreset", "fresnelcolor", "fresnelconst", "fresnelsopra", "fresnelluxpop", "fresneltexture")
_SIDES = {"interior": ("interiorior", "iorinside"), "exterior": ("exteriorior", "ioroutside")}
_VOLUME = {"scattering": "sigma_s", "asymmetry": "g"}


def texture_values(
    kind: str, block: Block, textures: Container[str], report: LossReport
) -> tuple[str, str, list[Values]]:
    """Type, kind and parameters of a texture in LuxRender."""
    values: list[Values] = []
    for rest, names in (("mapping.uvscale", ("uscale", "vscale")), ("mapping.uvdelta", ("udelta", "vdelta"))):
        if rest in block:
            for name, value in zip(names, np.broadcast_to(block.pop(rest).numbers(1, 2), 2).tolist(), strict=True):
                values += numbers(name, value)
    if kind == "imagemap":
        values += _image(block, report)
    values += numbers("dimension", 3.0) if kind == "checkerboard3d" else []
    values += parameters(block, textures)
    return ("fresnel" if kind in _FRESNEL else "color"), TEXTURES.get(kind, kind), values


def _image(block: Block, report: LossReport) -> list[Values]:
    """What an image of LuxCore has by other words."""
    if "colorspace" in block:
        found = block.pop("colorspace")
        if found.word() == "nop":
            return [*numbers("gamma", 1.0), *_image(block, report)]
        report.add(str(found.place), f"property {found.key!r}", "its gamma")
    values = texts(filename="") if "file" not in block else []
    if "filter" in block and block["filter"].word() == "linear":
        del block["filter"]
    if "wrap" in block and block["wrap"].word() == "white":
        report.add(str(block["wrap"].place), "a picture that is white beyond its edges", "its last texels")
        del block["wrap"]
        values += texts(wrap="clamp")
    return values


def volume_values(kind: str, block: Block, textures: Mapping[str, Texture], report: LossReport) -> list[Values]:
    """Parameters of a volume in LuxRender."""
    index = 1.0 if "ior" not in block else _number(block.pop("ior"), textures)
    names = _VOLUME if kind == "clear" else {**_VOLUME, "absorption": "sigma_a"}
    return [*parameters(block, textures, names), *numbers("fresnel", index)]


def material_values(name: str, block: Block, names: Names, report: LossReport) -> list[Values]:
    """Parameters of a material in LuxRender, with its type."""
    given = block.pop("type").word() if "type" in block else "matte"
    kind = MATERIALS.get(given, given)
    values: list[Values] = []
    if given in ("glass", "archglass", "roughglass"):
        kind, values = _glass(given, block, names.colors)
    if given in ("matte", "roughmatte") and "sigma" in block:  # which LuxCore 2.10 takes in radians, measured
        sigma = _number(block.pop("sigma"), names.colors)
        values += numbers("sigma", math.degrees(sigma) if given == "roughmatte" else 0.0)
    if given == "metal2" and "fresnel" not in block:
        values += texts(fresnel=_index(name, block, names))
    for parameter, default in DEFAULTS.get(kind, {}).items():
        if parameter.lower() not in block:
            values += numbers(parameter, *default)
    if kind == "mattetranslucent":
        values += [("bool energyconserving",), ("true",)]
    return [*texts(type=kind), *values, *parameters(block, names.colors)]


def _glass(given: str, block: Block, textures: Mapping[str, Texture]) -> tuple[str, list[Values]]:
    """Glass by the indices of both its sides; without them they are those of its volumes."""
    found: dict[str, Property] = {}
    for side, keys in _SIDES.items():
        for key in keys:
            if key in block:
                found[side] = block.pop(key)
    inside, outside = (_number(found[side], textures) if side in found else 1.0 for side in _SIDES)
    values = numbers("index", inside / outside if outside else inside)
    if given == "archglass":
        values += [("bool architectural",), ("true",)]
    return ("roughglass" if given == "roughglass" else "glass" if found else "glass2"), values


def _index(name: str, block: Block, names: Names) -> str:
    """Defines the index of a metal that has it itself."""
    label = f"{name} n k"
    parts = [_color(block.pop(part, None), names.colors) for part in ("n", "k")]
    names.define(names.indices, label, tuple(parts))
    return label


def _color(found: Property | None, textures: Mapping[str, Texture]) -> tuple[float, float, float]:
    if found is None:
        return 0.5, 0.5, 0.5
    if not found.is_number and found.word() in textures:
        return mean_of(textures[found.word()])
    red, green, blue = np.broadcast_to(found.numbers(1, 3), 3).tolist()
    return red, green, blue


def _number(found: Property, textures: Mapping[str, Texture]) -> float:
    """A number, or the luminance of a colour."""
    color = _color(found, textures)
    return color[0] if len(set(color)) == 1 else float(product(LUMINANCE, color))
