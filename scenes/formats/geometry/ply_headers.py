"""Headers of PLY files.

Source: G. Turk, "The PLY Polygon File Format" (1994).
"""

from __future__ import annotations

from dataclasses import dataclass

from scenes.canonical import SceneError

_TYPES = {
    "char": "i1", "int8": "i1", "uchar": "u1", "uint8": "u1", "short": "i2", "int16": "i2", "ushort": "u2",
    "uint16": "u2", "int": "i4", "int32": "i4", "uint": "u4", "uint32": "u4", "float": "f4", "float32": "f4",
    "double": "f8", "float64": "f8",
}  # fmt: skip
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


def header_of(content: bytes, name: str) -> tuple[str, list[Element], memoryview]:
    """The byte order, empty for text; the elements; and what follows the header.

    Raises:
        SceneError: it is not the header of a PLY file.
    """
    end = content.find(b"end_header", 0, 1 << 16)
    newline = content.find(b"\n", end)
    if not content.startswith(b"ply") or end < 0 or newline < 0:
        raise SceneError(f"{name}: expected a PLY file, got {content[:8]!r}")
    order, elements = None, []
    for line in content[:end].decode("ascii", "replace").splitlines()[1:]:
        parts = line.split()
        if not parts or parts[0] in ("comment", "obj_info"):
            continue
        if parts[0] == "format" and len(parts) == 3 and parts[1] in _ORDERS:
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
    return order, elements, memoryview(content)[newline + 1 :]


def _with(element: Element, added: tuple[str, str, str]) -> Element:
    return Element(element.name, element.count, (*element.properties, added))


def texture_of(content: bytes) -> str:
    """The name of the picture that MeshLab writes as a comment into a header; empty if there is none."""
    for line in content[: max(content.find(b"end_header", 0, 1 << 16), 0)].decode("utf-8", "replace").splitlines():
        words = line.split(maxsplit=2)
        if len(words) == 3 and words[:2] == ["comment", "TextureFile"]:
            return words[2].strip()
    return ""
