"""Places in texts, for messages."""

from __future__ import annotations

from typing import NamedTuple


class TextPosition(NamedTuple):
    """A place in a text; lines and columns count from 1."""

    file: str
    line: int
    column: int

    def __str__(self) -> str:
        return f"{self.file}:{self.line}:{self.column}"
