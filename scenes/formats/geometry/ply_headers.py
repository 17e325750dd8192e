"""Headers of PLY files.

Source: G. Turk, "The PLY Polygon File Format" (1994).
"""

from __future__ import annotations

import re
from dataclasses import dataclass

from scenes.canonical import SceneError

_TYPES = {
    "char": "i1", "int8": "i1", "uchar": "u1", "uint8": "u1", "short": "i2", "int16": "i2", "ushort": "u2",
    "uint16": "u2", "int": "i4", "int32": "i4", "uint": "u4", "uint32": "u4", "float": "f4", "float32": "f4",
    "double": "f8", "float64": "f8",
}  # fmt: skip
_RETURNS = re.compile(rb"ply[ \t]*\r(?!\n)")
_ORDERS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}


@dataclass(frozen=True)
class Element:
    """The rows of one kind.

    Attributes:
        name: their kind.
        count: their number.
        properties: name, type, and type of the count for lists.
    """

    name: str
    count: int
    properties: tuple[tuple[str, str, str], ...]


@dataclass(frozen=True)
class Header:
    """What stands before the rows of a file.

    Attributes:
        order: byte order of the rows; empty for text.
        elements: the kinds of rows, in the order of the file.
        body: what follows the header.
        picture: name of the picture that MeshLab writes as a comment; empty if there is none.
    """

    order: str
    elements: tuple[Element, ...]
    body: memoryview
    picture: str

    def kind_of(self, element: str, wanted: str) -> str:
        """The type of a property; empty if there is none."""
        found = (part for one in self.elements if one.name == element for part in one.properties if part[0] == wanted)
        return next(found, ("", "", ""))[1]


def header_of(content: bytes, name: str) -> Header:
    """The header of a file, whose lines end with a line feed, a carriage return or both.

    Raises:
        SceneError: it is not the header of a PLY file.
    """
    end = content.find(b"end_header", 0, 1 << 16)
    # only the first line tells: rows of numbers may start with the byte of a line feed
    newline = content.find(b"\r" if _RETURNS.match(content) else b"\n", end)
    if not content.startswith(b"ply") or end < 0 or newline < 0:
        raise SceneError(f"{name}: expected a PLY file, got {content[:8]!r}")
    order, picture, elements = None, "", []
    for line in content[:end].decode("utf-8", "replace").splitlines()[1:]:
        parts = line.split()
        if not parts or parts[0] in ("comment", "obj_info"):
            if parts[:2] == ["comment", "TextureFile"] and not picture:
                picture = (*line.split(maxsplit=2), "")[2].strip()
        elif parts[0] == "format" and len(parts) == 3 and parts[1] in _ORDERS:
            order = _ORDERS[parts[1]]
        elif parts[0] == "element" and len(parts) == 3 and parts[2].isdecimal():
            elements.append(Element(parts[1], int(parts[2]), ()))
        elif parts[0] == "property" and elements and len(parts) == 3 and parts[1] in _TYPES:
            elements[-1] = _with(elements[-1], (parts[2], _TYPES[parts[1]], ""))
        elif parts[0] == "property" and elements and len(parts) == 5 and {parts[2], parts[3]} <= set(_TYPES):
            elements[-1] = _with(elements[-1], (parts[4], _TYPES[parts[3]], _TYPES[parts[2]]))
        else:
            raise SceneError(f"{name}: expected a line of a PLY header, got {line[:40]!r}")
    if order is None:
        raise SceneError(f"{name}: expected a format in the PLY header, got none")
    return Header(order, tuple(elements), memoryview(content)[newline + 1 :], picture)


def _with(element: Element, added: tuple[str, str, str]) -> Element:
    return Element(element.name, element.count, (*element.properties, added))
