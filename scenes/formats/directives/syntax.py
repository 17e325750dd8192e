"""The syntax of PBRT and LuxRender files: directives with values and typed parameters.

A list of numbers is one token, so that the time to read millions of vertices is that of converting the numbers.

Source: PBRT v3 file format (https://www.pbrt.org/fileformat-v3); LuxRender 1.x scene files use the same syntax.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from scenes.canonical import SceneError
from scenes.formats.text.numbers import NUMBER_MAX
from scenes.formats.text.places import TextPosition

if TYPE_CHECKING:
    import lark

_GRAMMAR = r"""
start: directive*
directive: NAME value*
value: STRING | NUMBER | NUMBERS | STRINGS | TRUTH
TRUTH.2: /(true|false)\b/
NAME: /[A-Za-z_]\w*/
STRING: /"[^"\\\n]*(?:\\.[^"\\\n]*)*"/
NUMBER: /[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?(?![\w.])/
NUMBERS: /\[[-+.\deE\s,]*(?:#[^\n]*(?:\n|$)[-+.\deE\s,]*)*\]/
STRINGS: /\[\s*(?:(?:#[^\n]*\n|true\b|false\b|"[^"\\\n]*(?:\\.[^"\\\n]*)*")\s*)*\]/
COMMENT: /#[^\n]*/
%ignore /[\s]+/
%ignore COMMENT
"""

_PIECE = 1 << 20  # characters of a list of numbers that are converted at a time

Values = NDArray[np.float64] | tuple[str, ...]

Opener = Callable[[str, TextPosition, tuple[Path, ...]], tuple[str, Path]]
"""``(name, place, open files) -> (text, path)`` of an included file; ``place`` is where it is named, and the innermost
open file is the last."""


@lru_cache(maxsize=1)
def _lexer() -> lark.Lark:
    """The lexer. No parser is needed: a directive is a name and all values up to the next name."""
    import lark

    return lark.Lark(_GRAMMAR, parser=None, lexer="basic")


@dataclass(frozen=True)
class Directive:
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
    head, begun, values = None, file, []
    for token, within in _spliced(text, (file,), opener):
        if token.type == "NAME":
            if head is not None:
                yield _directive(head, values, begun)
            head, begun, values = token, within, []
        elif head is None:
            place = TextPosition(within.name, token.line, token.column)
            raise SceneError(f"{place}: expected a directive, got {str(token)[:20]!r}")
        else:
            values.append(_values(token, within.name))
    if head is not None:
        yield _directive(head, values, begun)


def _spliced(text: str, inside: tuple[Path, ...], opener: Opener) -> Iterator[tuple[Any, Path]]:
    """Tokens of a text and of its includes, each with its file."""
    file = inside[-1]
    tokens = _tokens(text, file.name)
    for token in tokens:
        if token.type != "NAME" or str(token) != "Include":
            yield token, file
            continue
        place, name = TextPosition(file.name, token.line, token.column), next(tokens, None)
        found = _values(name, file.name) if name is not None and name.type in ("STRING", "STRINGS") else ()
        if not isinstance(found, tuple) or len(found) != 1:
            raise SceneError(f"{place}: Include: expected a string")
        included, path = opener(found[0], place, inside)
        yield from _spliced(included, (*inside, path), opener)


def _tokens(text: str, file: str) -> Iterator[Any]:
    """Tokens one by one, so that at most one list of numbers is held both as text and as numbers."""
    import lark

    try:
        yield from _lexer().lex(text)
    except lark.exceptions.UnexpectedCharacters as error:
        got = text[error.pos_in_stream : error.pos_in_stream + 20].split("\n")[0] if error.pos_in_stream else ""
        place = TextPosition(file, error.line, error.column)
        raise SceneError(f"{place}: expected a directive, string or number, got {got!r}") from None


def _directive(head: Any, values: list[Values], file: Path) -> Directive:
    return Directive(str(head), tuple(values), TextPosition(file.name, head.line, head.column), file)


def _values(token: Any, file: str) -> Values:
    if token.type == "STRING":
        return (_unquoted(token),)
    if token.type == "TRUTH":
        return (str(token),)
    if token.type == "STRINGS":
        return tuple(str(part) if part.type == "TRUTH" else _unquoted(part) for part in _strings(token))
    place = TextPosition(file, token.line, token.column)
    if token.type == "NUMBER" and abs(value := float(token)) <= NUMBER_MAX:
        return np.array([value])
    body = str(token) if token.type == "NUMBER" or "#" in token else token
    if "#" in body:
        body = "[" + "\n".join(line.split("#")[0] for line in body[1:-1].splitlines()) + "]"
    start, end = (0, len(body)) if token.type == "NUMBER" else (1, len(body) - 1)
    parts = []
    while start < end:  # in pieces, so that the numbers of a large mesh are not copied as text
        cut = start + _PIECE
        while cut < end and body[cut] not in " \t\r\n,":
            cut += 1
        parts.append(_parsed(body[start : min(cut, end)], place))
        start = cut
    return parts[0] if len(parts) == 1 else np.concatenate(parts) if parts else np.zeros(0)


def _parsed(text: str, place: TextPosition) -> NDArray[np.float64]:
    """Numbers separated by blanks and commas."""
    text = text.replace(",", " ")
    if not text or text.isspace():
        return np.zeros(0)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        try:
            found = np.fromstring(text, dtype=np.float64, sep=" ")
        except (DeprecationWarning, ValueError):
            raise SceneError(f"{place}: expected numbers, got {text.strip()[:30]!r}") from None
    if not (np.abs(found) <= NUMBER_MAX).all():  # NaN fails as well
        raise SceneError(f"{place}: expected numbers up to {NUMBER_MAX:g}, got {text.strip()[:30]!r}")
    return found


def _strings(token: Any) -> list[Any]:
    inner = str(token)[1:-1]
    return [part for part in _lexer().lex("x " + inner) if part.type in ("STRING", "TRUTH")]


def _unquoted(token: Any) -> str:
    return str(token)[1:-1].replace('\\"', '"').replace("\\\\", "\\")


def parameters_of(directive: Directive, skip: int) -> Parameters:
    """Parameters of a directive after its first ``skip`` values: pairs of ``"type name"`` and values.

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
        if name not in given:  # the first counts, as in PBRT
            given[name], types[name] = rest[at + 1], kind
    return Parameters(directive.place, given, types)
