"""Places in texts, for messages."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class TextPosition:
    """A place in a text; lines and columns count from 1."""

    file: str
    line: int
    column: int

    def __str__(self) -> str:
        return f"{self.file}:{self.line}:{self.column}"
