"""The syntax of PBRT and LuxRender files: directives with values and typed parameters.

A list of numbers is one token, so that the time to read millions of vertices is that of converting the numbers.

Source: PBRT v3 file format (https://www.pbrt.org/fileformat-v3); LuxRender 1.x scene files use the same syntax.
"""

from __future__ import annotations

import re
import warnings
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from scenes.canonical import SceneError
from scenes.formats.text.numbers import NUMBER_MAX
from scenes.formats.text.places import TextPosition

_TOKEN = re.compile(
    r"""
    (?: \s+ | \#[^\n]* )*+
    (?: (?P<TRUTH> (?: true | false )\b )
    | (?P<NAME> [A-Za-z_]\w* )
    | (?P<STRING> "[^"\\\n]*(?:\\.[^"\\\n]*)*" )
    | (?P<NUMBER> [-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?(?![\w.]) )
    | (?P<STRINGS> \[\s*(?:(?:\#[^\n]*\n|true\b|false\b|"[^"\\\n]*(?:\\.[^"\\\n]*)*")\s*)*\] )
    | (?P<NUMBERS> \[[-+.\deE\s,]*(?:\#[^\n]*(?:\n|$)[-+.\deE\s,]*)*\] )
    | (?P<END> \Z ) )
    """,
    re.VERBOSE,
)
"""The tokens, after blanks and comments. No grammar is needed: a directive is a name and all values up to the next
name."""

_BLANKS = re.compile(r"(?:\s+|#[^\n]*)*")

_LONG = 256  # characters from which numbers are converted by NumPy
_PIECE = 1 << 20  # characters of a list of numbers that are converted at a time

Values = NDArray[np.float64] | tuple[str, ...]

Opener = Callable[[str, TextPosition, tuple[Path, ...]], tuple[str, Path]]
"""``(name, place, open files) -> (text, path)`` of an included file; ``place`` is where it is named, and the innermost
open file is the last."""


class Token(NamedTuple):
    """A token: its kind, which is a group of the pattern, its text, and the place where it begins."""

    kind: str
    text: str
    line: int
    column: int


class Directive(NamedTuple):
    """A directive: its name, its strings and numbers in order, and the file in which it begins."""

    name: str
    values: tuple[Values, ...]
    place: TextPosition
    file: Path


@dataclass
class Parameters:
    """Typed parameters of a directive. Unused parameters can be listed.

    Attributes:
        place: place of the directive.
        given: values of the parameters by name.
        types: declared types of the parameters by name.
    """

    place: TextPosition
    given: Mapping[str, Values]
    types: Mapping[str, str]
    asked: set[str] = field(default_factory=set)

    def __contains__(self, name: str) -> bool:
        return name in self.given

    def numbers(self, name: str, count: int | None = None) -> NDArray[np.float64] | None:
        """Numbers of a parameter, or None if it is not given.

        Raises:
            SceneError: it holds strings, or a different count of numbers than ``count``.
        """
        self.asked.add(name)
        if name not in self.given:
            return None
        found = self.given[name]
        if isinstance(found, tuple):
            raise SceneError(f"{self.place}: {name}: expected numbers, got {found!s:.40}")
        if count is not None and len(found) != count:
            raise SceneError(f"{self.place}: {name}: expected {count} numbers, got {len(found)}")
        return found

    def number(self, name: str, default: float) -> float:
        """A single number.

        Raises:
            SceneError: there are several numbers.
        """
        found = self.numbers(name, 1)
        return default if found is None else float(found[0])

    def whole(self, name: str, default: int, least: int, most: int) -> int:
        """An integer from ``least`` to ``most``.

        Raises:
            SceneError: it is not such an integer.
        """
        value = self.number(name, default)
        if value != int(value) or not least <= value <= most:
            raise SceneError(f"{self.place}: {name}: expected a whole number from {least} to {most}, got {value:g}")
        return int(value)

    def text(self, name: str, default: str) -> str:
        """A string.

        Raises:
            SceneError: there are numbers, or several strings.
        """
        self.asked.add(name)
        found = self.given.get(name)
        if found is None:
            return default
        if not isinstance(found, tuple) or len(found) != 1:
            raise SceneError(f"{self.place}: {name}: expected one string")
        return found[0]

    def truth(self, name: str, default: bool) -> bool:
        """True or false, quoted or not.

        Raises:
            SceneError: it is a different word.
        """
        value = self.text(name, str(default).lower())
        if value not in ("true", "false"):
            raise SceneError(f"{self.place}: {name}: expected true or false, got {value!r}")
        return value == "true"

    def unasked(self) -> list[str]:
        """Names of the unused parameters."""
        return [name for name in self.given if name not in self.asked]


def parse_directives(text: str, file: Path, opener: Opener) -> Iterator[Directive]:
    """Directives of a text and of its includes.

    An included text replaces ``Include``, so parameters after it belong to its last directive.

    Raises:
        SceneError: the text does not consist of directives; the message gives file, line and column.
    """
    head: Token | None = None
    begun, name, values = file, file.name, list[Values]()
    for token, within in _spliced(text, (file,), opener):
        if token.kind == "NAME":
            if head is not None:
                yield Directive(head.text, tuple(values), TextPosition(name, head.line, head.column), begun)
            if within is not begun:
                begun, name = within, within.name
            head, values = token, []
        elif head is None:
            place = TextPosition(within.name, token.line, token.column)
            raise SceneError(f"{place}: expected a directive, got {token.text[:20]!r}")
        else:
            values.append(_values(token, within))
    if head is not None:
        yield Directive(head.text, tuple(values), TextPosition(name, head.line, head.column), begun)


def _spliced(text: str, inside: tuple[Path, ...], opener: Opener) -> Iterator[tuple[Token, Path]]:
    """Tokens of a text and of its includes, each with its file."""
    file = inside[-1]
    tokens = _tokens(text, file)
    for token in tokens:
        if token.kind != "NAME" or token.text != "Include":
            yield token, file
            continue
        place, name = TextPosition(file.name, token.line, token.column), next(tokens, None)
        found = _values(name, file) if name is not None and name.kind in ("STRING", "STRINGS") else ()
        if not isinstance(found, tuple) or len(found) != 1:
            raise SceneError(f"{place}: Include: expected a string")
        included, path = opener(found[0], place, inside)
        yield from _spliced(included, (*inside, path), opener)


def _tokens(text: str, file: Path) -> Iterator[Token]:
    """Tokens one by one, so that at most one list of numbers is held both as text and as numbers."""
    at, line, begun, match = 0, 1, 0, _TOKEN.match
    while True:
        found = match(text, at)
        if found is None:
            at = next(_BLANKS.finditer(text, at)).end()
            line, begun = line + text.count("\n", begun, at), text.rfind("\n", 0, at) + 1
            place, got = TextPosition(file.name, line, at - begun + 1), text[at : at + 20].split("\n")[0]
            raise SceneError(f"{place}: expected a directive, string or number, got {got!r}")
        kind = found.lastgroup
        if kind == "END" or kind is None:
            return
        start, end = found.span(kind)
        if start > at and (ends := text.count("\n", at, start)):
            line, begun = line + ends, text.rindex("\n", at, start) + 1
        yield Token(kind, found[kind], line, start - begun + 1)
        if kind in ("STRINGS", "NUMBERS") and (ends := text.count("\n", start, end)):
            line, begun = line + ends, text.rindex("\n", start, end) + 1
        at = end


def _values(token: Token, file: Path) -> Values:
    kind, body = token.kind, token.text
    if kind == "STRING":
        return (_unquoted(body),)
    if kind == "TRUTH":
        return (body,)
    if kind == "STRINGS":
        parts = [(str(part.lastgroup), part[str(part.lastgroup)]) for part in _TOKEN.finditer(body[1:-1])]
        return tuple(word if kind == "TRUTH" else _unquoted(word) for kind, word in parts if kind != "END")
    if kind == "NUMBER" and abs(value := float(body)) <= NUMBER_MAX:
        return np.array([value])
    place = TextPosition(file.name, token.line, token.column)
    if "#" in body:
        body = "[" + "\n".join(line.split("#")[0] for line in body[1:-1].splitlines()) + "]"
    start, end = (0, len(body)) if kind == "NUMBER" else (1, len(body) - 1)
    pieces = []
    while start < end:  # in pieces, so that the numbers of a large mesh are not copied as text
        cut = start + _PIECE
        while cut < end and body[cut] not in " \t\r\n,":
            cut += 1
        pieces.append(parsed_numbers(body[start : min(cut, end)], place))
        start = cut
    return pieces[0] if len(pieces) == 1 else np.concatenate(pieces) if pieces else np.zeros(0)


def parsed_numbers(text: str, place: TextPosition) -> NDArray[np.float64]:
    """Numbers separated by blanks and commas."""
    text = text.replace(",", " ")
    if not text or text.isspace():
        return np.zeros(0)
    found = _few(text) if len(text) < _LONG else None
    if found is None:
        found = _many(text, place)
    if not (np.abs(found) <= NUMBER_MAX).all():  # NaN fails as well
        raise SceneError(f"{place}: expected numbers up to {NUMBER_MAX:g}, got {text.strip()[:30]!r}")
    return found


def _few(text: str) -> NDArray[np.float64] | None:
    """Numbers between blanks, or None if a word is not one number."""
    try:
        return np.array([float(word) for word in text.split()])
    except ValueError:
        return None


def _many(text: str, place: TextPosition) -> NDArray[np.float64]:
    """Numbers, which may follow each other without a blank, as in ``1-2``."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        try:
            return np.fromstring(text, dtype=np.float64, sep=" ")
        except (DeprecationWarning, ValueError):
            raise SceneError(f"{place}: expected numbers, got {text.strip()[:30]!r}") from None


def _unquoted(text: str) -> str:
    return text[1:-1].replace('\\"', '"').replace("\\\\", "\\")


def parameters_of(directive: Directive, skip: int) -> Parameters:
    """Parameters of a directive after its first ``skip`` values, of which the last of each name counts.

    Raises:
        SceneError: a declaration is malformed, or has no value.
    """
    given: dict[str, Values] = {}
    types: dict[str, str] = {}
    rest = directive.values[skip:]
    for at in range(0, len(rest), 2):
        head = rest[at]
        if not isinstance(head, tuple) or len(head) != 1 or len(head[0].split()) != 2:
            got = " ".join(str(head).split())[:40]
            raise SceneError(
                f'{directive.place}: {directive.name}: expected a parameter such as "float fov", got {got}'
            )
        kind, name = head[0].split()
        if at + 1 >= len(rest):
            raise SceneError(f"{directive.place}: {directive.name}: expected a value for {name!r}, got none")
        if types.get(name) != "texture" or kind == "texture":  # PBRT and LuxRender look for a texture first
            given[name], types[name] = rest[at + 1], kind
    return Parameters(directive.place, given, types)
