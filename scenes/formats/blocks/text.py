"""The text of block files: blocks of attributes, one per line, checked against the allowed attributes.

Source: motion-blur perception thesis, chapter 3, figs 12 and 13.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import lark

from scenes.canonical import SceneError

_GRAMMAR = r"""
start: _NL? block*
block: WORD _NL attribute* END _NL
attribute: WORD WORD* _NL
END.2: /end(?=[ \t]*(#[^\n]*)?\n)/
WORD: /"[^"\n]*"|[^\s#"]+/
_NL: /([ \t]*(#[^\n]*)?\r?\n)+[ \t]*/
%ignore /[ \t]+/
"""
_PARSER = lark.Lark(_GRAMMAR, parser="lalr", propagate_positions=True)

Shape = int | tuple[int, ...] | type[str]
"""Type of an attribute's value: a count of numbers, one of several counts, or a word."""

ALLOWED: Mapping[str, Mapping[str, Shape]] = {
    "group": {"groupname": str, "location": 3, "velocity": 3, "rotation": 3, "scale": (1, 3)},
    "light": {
        "type": str,
        "location": 3,
        "target": 3,
        "direction": 3,
        "color": 3,
        "angle": 1,
        "innerangle": 1,
        "outerangle": 1,
        "size": 2,
        "map": str,
    },
    "material": {
        "materialname": str,
        "type": str,
        "diffusecolor": 3,
        "texture": str,
        "specularcolor": 3,
        "specularexponent": 1,
        "ambientcolor": 3,
        "fresnelminimum": 1,
        "fresnelmaximum": 1,
        "fresnelexponent": 1,
        "spread": 1,
        "refractionindex": 1,
        "emissioncolor": 3,
    },
    "object": {
        "objectname": str,
        "type": str,
        "materialname": str,
        "modelfilename": str,
        "smoothangle": 1,
        "radius": 1,
        "scale": (1, 3),
        "rotation": 3,
        "location": 3,
        "velocity": 3,
        "groupname": str,
    },
    "instance": {
        "objectname": str,
        "materialname": str,
        "scale": (1, 3),
        "rotation": 3,
        "location": 3,
        "velocity": 3,
        "groupname": str,
    },
    "camera": {
        "location": 3,
        "locationvelocity": 3,
        "lookat": 3,
        "lookatvelocity": 3,
        "up": 3,
        "upvelocity": 3,
        "fov": 1,
        "aperture": 1,
        "focaldistance": 1,
    },
    "settings": {
        "scenename": str,
        "starttime": 1,
        "frametime": 1,
        "numframes": 1,
        "framerate": 1,
        "shuttershare": 1,
        "sizex": 1,
        "sizey": 1,
        "ambientlightcolor": 3,
        "maxdepth": 1,
        "pointset": str,
        "numsamples": 1,
        "timefilter": str,
        "envmap": str,
        "envmaplimit": 1,
    },
}
"""Allowed attributes of each kind of block, with their types."""


@dataclass(frozen=True)
class Block:
    """A block of a file.

    Attributes:
        kind: one of :data:`ALLOWED`.
        values: values by attribute: a number, a tuple of numbers, or a word.
        where: file and line, for messages.
    """

    kind: str
    values: Mapping[str, Any]
    where: str

    def get(self, name: str, default: Any = None) -> Any:
        """The value of an attribute, or the default."""
        return self.values.get(name, default)

    def require(self, name: str) -> Any:
        """The value of an attribute.

        Raises:
            SceneError: the attribute is missing.
        """
        if name not in self.values:
            raise SceneError(f"{self.where}: {self.kind}: expected {name!r}, found none")
        return self.values[name]


def read_blocks(path: Path) -> list[Block]:
    """Blocks of a file, in order.

    Raises:
        SceneError: the file is missing, is not UTF-8, or is invalid; the message gives file and line, the expected and
            the actual value.
    """
    try:
        text = path.read_text(encoding="utf-8")
    except UnicodeDecodeError as error:
        raise SceneError(f"{path}: expected UTF-8 text, byte {error.start} is invalid") from None
    except OSError as error:
        raise SceneError(f"{path}: cannot be read ({error.strerror})") from None
    return parse_blocks(text, str(path))


def parse_blocks(text: str, name: str) -> list[Block]:
    """Blocks of a text; ``name`` is used in messages. Raises as :func:`read_blocks`."""
    try:
        tree = _PARSER.parse(text + "\n")
    except lark.exceptions.UnexpectedInput as error:
        raise SceneError(f"{name}:{error.line}: {_surprise(error)}") from None
    return [_block(block, name) for block in tree.children if isinstance(block, lark.Tree)]


def _surprise(error: lark.exceptions.UnexpectedInput) -> str:
    token = getattr(error, "token", None)
    if token is not None and token.type == "$END":
        return "expected 'end' of the last block, found the end of the file"
    got = repr(str(token if token is not None else getattr(error, "char", "")))
    return f"expected an attribute or 'end' on a line of its own, got {got}"


def _block(tree: lark.Tree, name: str) -> Block:
    first = tree.children[0]
    assert isinstance(first, lark.Token)
    kind, where = str(first), f"{name}:{first.line}"
    attributes = [child for child in tree.children if isinstance(child, lark.Tree)]
    if kind not in ALLOWED:
        raise SceneError(f"{where}: expected one of {', '.join(ALLOWED)}, got {kind!r}")
    values: dict[str, Any] = {}
    for attribute in attributes:
        key, *words = [str(word) for word in attribute.children]
        line = f"{name}:{attribute.children[0].line}"  # type: ignore[union-attr]
        if key not in ALLOWED[kind]:
            raise SceneError(f"{line}: {kind}: expected one of {', '.join(ALLOWED[kind])}, got {key!r}")
        if key in values:
            raise SceneError(f"{line}: {kind}: {key} occurs twice")
        values[key] = _value(ALLOWED[kind][key], words, f"{line}: {kind}.{key}")
    return Block(kind, values, where)


def _value(shape: Shape, words: list[str], what: str) -> Any:
    if shape is str:
        if len(words) != 1:
            raise SceneError(f"{what}: expected one word, got {' '.join(words) or 'none'}")
        return words[0].strip('"')
    counts = shape if isinstance(shape, tuple) else (shape,)
    if len(words) not in counts:
        wanted = " or ".join(str(count) for count in counts)
        raise SceneError(f"{what}: expected {wanted} numbers, got {' '.join(words) or 'none'}")
    numbers = []
    for word in words:
        try:
            numbers.append(float(word))
        except ValueError:
            raise SceneError(f"{what}: expected a number, got {word!r}") from None
        if not math.isfinite(numbers[-1]):
            raise SceneError(f"{what}: expected a finite number, got {word!r}")
    return numbers[0] if len(numbers) == 1 else tuple(numbers)
