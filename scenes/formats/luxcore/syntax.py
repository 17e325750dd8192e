"""The syntax of LuxCore's files: lines of ``key = values``, with keys in parts between dots.

Source: LuxCore SDK reference manual (wiki of LuxCoreRender), section on properties; ``Properties`` of LuxCore 2.10:
comments are whole lines, and the last of two equal keys counts.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scenes.canonical import SceneError
from scenes.formats.directives.syntax import parsed_numbers
from scenes.formats.text.places import TextPosition

_WORD = re.compile(r'"(?P<double>[^"]*)"|\'(?P<single>[^\']*)\'|(?P<bare>[^\s"\']+)')
_FIRST = re.compile(r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?(?=[\s,]|\Z)|[-+]?(?:nan|inf)(?=\s|\Z)")
"""A number at the beginning of a value."""

Block = dict[str, "Property"]
"""Properties of one part of a scene, by the rest of their keys."""


@dataclass
class Property:
    """A property.

    Attributes:
        key: the whole key.
        text: the value, without blanks at its ends.
        place: place of the value.
    """

    key: str
    text: str
    place: TextPosition
    _numbers: NDArray[np.float64] | None = None

    def words(self) -> list[str]:
        """The words of the value, without their quotes."""
        return [found[str(found.lastgroup)] for found in _WORD.finditer(self.text)]

    def word(self) -> str:
        """The value as one word.

        Raises:
            SceneError: there is none, or more than one.
        """
        found = self.words()
        if len(found) != 1:
            raise SceneError(f"{self.place}: {self.key}: expected one word, got {self.text[:40]!r}")
        return found[0].strip()

    @property
    def is_number(self) -> bool:
        """Whether the value begins with a number, quoted or not."""
        return _FIRST.match(self._bare) is not None

    @property
    def _bare(self) -> str:
        return self.text[1:-1].strip() if self.text[:1] in "\"'" else self.text

    def numbers(self, *counts: int) -> NDArray[np.float64]:
        """The numbers of the value.

        Args:
            counts: how many there may be; any number if there are none.

        Raises:
            SceneError: a word is no finite number of usual size, or their count is another one.
        """
        if self._numbers is None:
            if not self.is_number:
                raise SceneError(f"{self.place}: {self.key}: expected numbers, got {self.text[:40]!r}")
            self._numbers = parsed_numbers(self._bare, self.place)
        if counts and len(self._numbers) not in counts:
            wanted = " or ".join(map(str, counts))
            raise SceneError(f"{self.place}: {self.key}: expected {wanted} numbers, got {len(self._numbers)}")
        return self._numbers


def parsed_properties(text: str, file: str) -> Block:
    """The properties of a text by their keys, in order.

    Raises:
        SceneError: a line is neither empty, nor a comment, nor a property.
    """
    found: Block = {}
    for line, content in enumerate(text.split("\n"), 1):
        bare = content.strip()
        if not bare or bare.startswith("#"):
            continue
        before, sign, after = content.partition("=")
        key, value = before.strip(), after.strip()
        place = TextPosition(file, line, len(before) + 1 + len(after) - len(after.lstrip()) + 1)
        if not sign or not key or not value or "\0" in bare:
            column = len(content) - len(content.lstrip()) + 1
            where = place if sign and key else TextPosition(file, line, column)
            raise SceneError(f"{where}: expected a property such as scene.camera.type = perspective, got {bare[:40]!r}")
        found.pop(key, None)
        found[key] = Property(key, value, place)
    return found


def parts_of(properties: Block, prefix: str) -> dict[str, Block]:
    """The properties below a prefix, taken out of ``properties``: by the name of the part, then by the rest of the
    key, which is empty for the part itself."""
    found: dict[str, Block] = {}
    for key in [key for key in properties if key.startswith(prefix)]:
        name, _, rest = key[len(prefix) :].partition(".")
        found.setdefault(name, {})[rest] = properties.pop(key)
    return found
