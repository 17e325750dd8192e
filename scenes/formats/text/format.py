"""What a format of scene files is."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from scenes.canonical import Scene
from scenes.formats.losses import LossReport
from scenes.formats.text.output import Output

Read = Callable[[Path, Path | None, LossReport], Scene]
"""Reads a file: its path, the folder that nothing is read outside of (None for its own), and who hears of losses."""

Write = Callable[[Scene, Output, LossReport], None]
"""Writes a scene into an output, with its meshes and pictures; reports what could not be kept."""


@dataclass(frozen=True)
class Format:
    """A format of scene files.

    Attributes:
        name: in words, for messages.
        endings: of the names of its files, in lower case and with the dot. The first format that has an ending is
            taken for it; one without endings is chosen by its name.
        read: reads a file, or None where files are only written.
        write: writes a scene, or None where files are only read.
    """

    name: str
    endings: tuple[str, ...]
    read: Read | None = None
    write: Write | None = None
