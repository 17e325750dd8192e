"""Writer of elements, properties and textures of Mitsuba files.

Source: Mitsuba 0.5 documentation; Mitsuba 3 documentation, plugin reference.
"""

from __future__ import annotations

import re
import xml.etree.ElementTree as ElementTree
from dataclasses import dataclass, field
from functools import cache

from scenes.canonical import CheckerboardTexture, ConstantTexture, ImageTexture, Texture
from scenes.canonical.values import Matrix, Rgb
from scenes.formats.appearance.folding import folded, mean_of, within_one
from scenes.formats.geometry.conventions import first_row_below
from scenes.formats.losses import LossReport
from scenes.formats.text.numbers import number, spaced
from scenes.formats.text.output import Output

Element = ElementTree.Element

_NEW_NAMES = {"toWorld": "to_world", "intIOR": "int_ior", "extIOR": "ext_ior"}


@cache
def _new_name(text: str) -> str:
    return _NEW_NAMES.get(text) or re.sub(r"(?<!^)(?=[A-Z])", "_", text).lower()


@dataclass
class ElementWriter:
    """Collects the elements of a scene; ``modern`` selects Mitsuba 3."""

    output: Output
    report: LossReport
    modern: bool = False
    root: Element = field(default_factory=lambda: Element("scene"))
    _folded: dict[int, tuple[Texture, Texture]] = field(default_factory=dict)
    _parts: dict[int, tuple[Texture, str]] = field(default_factory=dict)
    _taken: set[str] = field(default_factory=set)
    _counts: dict[str, int] = field(default_factory=dict)

    def name(self, text: str) -> str:
        """The name of a property in the version that is written."""
        if not self.modern:
            return text
        return _new_name(text)

    def plugin(self, tag: str, kind: str, parent: Element | None = None, **named: str) -> Element:
        """Creates an element of a kind."""
        made = Element(tag, {"type": kind, **named})
        if parent is not None:
            parent.append(made)
        return made

    def put(self, parent: Element, tag: str, name: str, value: str) -> None:
        """Writes a property."""
        ElementTree.SubElement(parent, tag, {"name": self.name(name), "value": value})

    def matrix(self, parent: Element, name: str, matrix: Matrix) -> None:
        """Writes a transform."""
        holder = ElementTree.SubElement(parent, "transform", {"name": self.name(name)})
        ElementTree.SubElement(holder, "matrix", {"value": spaced(matrix.ravel().tolist())})

    def color(self, parent: Element, name: str, value: Rgb) -> None:
        """Writes a linear colour."""
        self.put(parent, "rgb", name, ", ".join(number(part) for part in value))

    def texture(self, parent: Element, texture: Texture, name: str) -> None:
        """Writes a texture or colour as a property."""
        if id(texture) not in self._folded:
            self._folded[id(texture)] = texture, folded(texture)
        texture = self._folded[id(texture)][1]
        if isinstance(texture, ConstantTexture):
            bounded = self.modern or name.endswith(("eflectance", "ransmittance"))  # others may be above 1 in 0.5
            value = within_one(texture.value, name, self.report) if bounded else texture.value
            self.color(parent, name, value)
            return
        if isinstance(texture, ImageTexture):
            made = self.plugin("texture", "bitmap", parent, name=self.name(name))
            self.put(made, "string", "filename", self.output.picture(texture.image, texture.source))
            beyond = {"repeat": "repeat", "clamp": "clamp", "black": "clamp" if self.modern else "zero"}[texture.wrap]
            self.put(made, "string", "wrapMode", beyond)
            if self.modern and texture.wrap == "black":
                self.report.add(name, "a picture that is black beyond its border", "the colours of its border")
            kind = {"nearest": "nearest", "bilinear": "trilinear", "mipmap": "ewa"}[texture.filter]
            if texture.filter == "bilinear" and not self.modern:
                self.report.add(name, "a texture without levels of detail", "trilinear")
            if self.modern:
                kind = "nearest" if texture.filter == "nearest" else "bilinear"
            self.put(made, "string", "filterType", kind)
            self._uv(made, *first_row_below(texture.uv_scale, texture.uv_offset))
        elif isinstance(texture, CheckerboardTexture):
            made = self.plugin("texture", "checkerboard", parent, name=self.name(name))
            self._part(made, texture.even, "color0")
            self._part(made, texture.odd, "color1")
            self._uv(made, (0.5 * texture.uv_scale[0], 0.5 * texture.uv_scale[1]), (0.0, 0.0))
        else:
            self.report.add(name, f"texture {type(texture).__name__}", "its mean")
            self.color(parent, name, mean_of(texture))

    def numbers(self, parent: Element, texture: Texture, name: str) -> None:
        """Writes a texture of numbers, which are not encoded, as a property."""
        self.texture(parent, texture, name)
        made = parent[-1]
        files = [part.get("value", "") for part in made if part.get("name") == "filename"]
        if self.modern and files and files[0].endswith(".exr"):
            self.put(made, "boolean", "raw", "true")

    def _part(self, made: Element, texture: Texture, name: str) -> None:
        """Writes a texture nested in a texture, by name, so that a shared one is written once."""
        if id(texture) not in self._parts:
            holder = Element("part")
            self.texture(holder, texture, name)
            (element,) = holder
            if element.tag != "texture":
                made.append(element)
                return
            del element.attrib["name"]
            label = self.label("t")
            element.set("id", label)
            self.root.append(element)
            self._parts[id(texture)] = texture, label
        ElementTree.SubElement(made, "ref", {"name": self.name(name), "id": self._parts[id(texture)][1]})

    def _uv(self, made: Element, scale: tuple[float, float], offset: tuple[float, float]) -> None:
        if self.modern:
            holder = ElementTree.SubElement(made, "transform", {"name": "to_uv"})
            size = {"x": number(scale[0]), "y": number(scale[1]), "z": "1"}
            ElementTree.SubElement(holder, "scale", size)
            ElementTree.SubElement(holder, "translate", {"x": number(offset[0]), "y": number(offset[1]), "z": "0"})
            return
        for name, value in zip(("uscale", "vscale", "uoffset", "voffset"), (*scale, *offset), strict=True):
            if value != (0.0 if name.endswith("offset") else 1.0):
                self.put(made, "float", name, number(value))

    def label(self, wanted: str) -> str:
        """An unused identifier."""
        label, count = wanted, self._counts.get(wanted, 1)  # lower numbers are taken
        while label in self._taken:
            count += 1
            label = f"{wanted}{count}"
        self._taken.add(label)
        self._counts[wanted] = count
        return label
