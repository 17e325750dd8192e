"""Textures of Mitsuba 0.5, converted to the canonical scene.

Source: Mitsuba 0.5 documentation, section on textures.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from scenes import loading
from scenes.arithmetic import power
from scenes.canonical import CheckerboardTexture, ConstantTexture, ImageTexture, Rgb, SceneError, Texture
from scenes.formats.appearance.folding import product_of
from scenes.formats.appearance.graphs import NESTED_MAX, check_depth
from scenes.formats.appearance.spectra import grey
from scenes.formats.geometry.conventions import first_row_below
from scenes.formats.losses import LossReport
from scenes.formats.mitsuba.properties import Properties
from scenes.formats.text.scene_files import SceneFiles
from scenes.formats.text.xml_tree import XmlNode

_WRAPS = {"repeat": "repeat", "clamp": "clamp", "zero": "black", "mirror": "repeat", "one": "clamp"}
MISSING = "missing"
"""Kind of a texture that replaces a missing one, which has been reported."""

_FILTERS = {"nearest": "nearest", "bilinear": "bilinear", "trilinear": "mipmap", "ewa": "mipmap"}


@dataclass
class MitsubaTextures:
    """Creates textures from elements.

    Attributes:
        files: source of image files.
        report: receives the losses.
        find: returns the element to which a reference refers.
    """

    files: SceneFiles
    report: LossReport
    find: Callable[[XmlNode], XmlNode]
    textures: dict[int, Texture] = field(default_factory=dict)
    _inside: int = 0

    def texture(self, properties: Properties, name: str, default: Rgb) -> Texture:
        """The texture of a property, which may be a texture, a reference to one, or a colour."""
        for child in properties.rest:
            if child.tag in ("texture", "ref") and child.get("name") == name:
                properties.asked.add(name)
                node = self.find(child) if child.tag == "ref" else child
                if node.tag != "texture":
                    raise SceneError(f"{child.place}: {name}: expected a texture, got {node.tag!r}")
                return self.made_texture(node)
        return ConstantTexture(properties.color(name, default))

    def made_texture(self, node: XmlNode) -> Texture:
        """The texture of an element, created once."""
        if id(node) not in self.textures:
            properties = Properties(node, self.report)
            self._inside += 1
            if self._inside > NESTED_MAX:
                raise SceneError(f"{node.place}: expected at most {NESTED_MAX} textures inside each other")
            self.textures[id(node)] = self._texture(properties)
            self._inside -= 1
            properties.left_over()
            check_depth(self.textures[id(node)], properties.where)
        return self.textures[id(node)]

    def _texture(self, properties: Properties) -> Texture:
        kind = properties.node.get("type")
        if kind == "checkerboard":
            scale, offset = _placing(properties)
            if offset != (0.0, 0.0):
                self.report.add(properties.where, "offset of a checkerboard", "none")
            parts = self.texture(properties, "color0", grey(0.4)), self.texture(properties, "color1", grey(0.2))
            # a square of the checkerboard is half a unit wide
            return CheckerboardTexture(*parts, (2.0 * scale[0], 2.0 * scale[1]))
        if kind == "scale":
            inner = next((child for child in properties.rest if child.tag in ("texture", "ref")), None)
            properties.asked.update(child.get("name") for child in properties.rest if child is inner)
            base = self.made_texture(self.find(inner) if inner.tag == "ref" else inner) if inner else None
            factor = ConstantTexture(properties.color("scale", grey(1.0)))
            return factor if base is None else product_of(base, factor)
        if kind == MISSING:
            return ConstantTexture(grey(0.5))
        if kind == "bitmap":
            return self._bitmap(properties, *_placing(properties))
        properties.asked.update(properties.given)
        self.report.add(properties.where, f"texture {kind!r}", "the constant 0.5")
        return ConstantTexture(grey(0.5))

    def _bitmap(self, properties: Properties, scale: tuple[float, float], offset: tuple[float, float]) -> Texture:
        where = properties.where
        name = properties.text("filename", "")
        path = self.files.known(name, where, self.report, f"the picture {name!r}", "the constant 0.5")
        if path is None:
            properties.asked.update(properties.given)
            return ConstantTexture(grey(0.5))
        image = loading.read_image(path)
        gamma = properties.number("gamma", -1.0)
        if gamma > 0.0 and not loading.is_linear(path):
            image = power(loading.encoded_srgb(image), np.float32(gamma)).astype(np.float32)
        wrap = properties.text("wrapMode", "repeat")
        if wrap not in _WRAPS:
            raise SceneError(f"{where}: wrapMode: expected one of {', '.join(_WRAPS)}, got {wrap!r}")
        if wrap in ("mirror", "one"):
            self.report.add(where, f"wrapMode {wrap!r}", _WRAPS[wrap])
        kind = properties.text("filterType", "ewa")
        if kind not in _FILTERS:
            raise SceneError(f"{where}: filterType: expected one of {', '.join(_FILTERS)}, got {kind!r}")
        properties.number("maxAnisotropy", 20.0)
        size, start = first_row_below(scale, offset)
        return ImageTexture(image, size, start, _WRAPS[wrap], _FILTERS[kind], str(path))  # type: ignore[arg-type]


def _placing(properties: Properties) -> tuple[tuple[float, float], tuple[float, float]]:
    """Scale and offset of texture coordinates."""
    even = properties.number("uvscale", 1.0)
    scale = properties.number("uscale", even), properties.number("vscale", even)
    return scale, (properties.number("uoffset", 0.0), properties.number("voffset", 0.0))
