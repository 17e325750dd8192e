"""Text of USD files that is refused before the library reads it."""

from __future__ import annotations

import re

from scenes.canonical import SceneError
from scenes.models.sources import Sources

_NESTED = re.compile(
    rb'"""(?s:.*?)"""|"(?:\\.|[^"\\\n])*+"|\'(?:\\.|[^\'\\\n])*+\'|#[^\n]*|@[^@\n]*@'
    rb"|[=:]\s*\[(?:[\s\d.,()einfaE+-]|#[^\n]*)*+(\[)"
)
"""Strings, comments and files of USD text, and numbers in which a further list begins. Repetitions are possessive:
others take 100 bytes of memory for each byte."""


def refuse_nested(sources: Sources) -> None:
    """Refuses lists within lists of numbers, after which the library quotes the rest of the file at each number.

    Raises:
        SceneError: there is one.
    """
    with sources.path.open("rb") as file:
        if file.read(5) != b"#usda":
            return
    content = sources.path.read_bytes()
    at = next((one.start(1) for one in _NESTED.finditer(content) if one[1]), None)
    if at is not None:
        line, column = content.count(b"\n", 0, at) + 1, at - content.rfind(b"\n", 0, at)
        raise SceneError(f"cannot be read: {line}:{column}: expected numbers, got a list within a list")
