"""The description of a format of scene files."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from scenes.canonical import Scene
from scenes.formats.losses import LossReport
from scenes.formats.text.output import Output

Read = Callable[[Path, Path | None, LossReport], Scene]
"""``(path, root, report) -> scene``: reads a file. Nothing is read outside of the folder ``root`` (None for the file's
own), and losses are reported."""

Write = Callable[[Scene, Output, LossReport], None]
"""Writes a scene into an output, with its meshes and images; losses are reported."""


@dataclass(frozen=True)
class Format:
    """A format of scene files.

    Attributes:
        name: name for messages.
        endings: endings of its file names, in lower case and with the dot. The first format with an ending is used for
            it; a format without endings is selected by name.
        read: reads a file; None if the format can only be written.
        write: writes a scene; None if the format can only be read.
    """

    name: str
    endings: tuple[str, ...]
    read: Read | None = None
    write: Write | None = None
