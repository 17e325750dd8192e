"""The files of a model."""

from __future__ import annotations

import codecs
from pathlib import Path
from urllib.parse import unquote

from scenes.canonical import SceneError
from scenes.loading import FileState, read_image, state_of
from scenes.pictures import Pixels

_MARKS = ((codecs.BOM_UTF8, "utf-8-sig"), (codecs.BOM_UTF16_LE, "utf-16"), (codecs.BOM_UTF16_BE, "utf-16"))


class Sources:
    """Reads the files to which a model refers, and records their states, including those of missing files.

    Attributes:
        path: path of the model.
        files: states of all requested files.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.files: dict[Path, FileState | None] = {path: state_of(path)}

    def find(self, name: str) -> Path | None:
        """The path of a file name, relative to the model's folder; if the name is a path of another machine, its last
        part is used. None if there is no such file."""
        text = name.replace("\\", "/")
        for candidate in dict.fromkeys((text, unquote(text), text.rpartition("/")[2])):
            path = self.path.parent / candidate
            self.files.setdefault(path, state_of(path))
            if path.is_file():
                return path
        return None

    def require(self, name: str, what: str) -> Path:
        """Like :meth:`find`, but raises SceneError if there is no such file."""
        path = self.find(name)
        if path is None:
            raise SceneError(f"expected {what} {self.path.parent / name}, found no file")
        return path

    def picture(self, name: str) -> tuple[Path, Pixels]:
        """An image by its file name, as linear RGB, and its path.

        Raises:
            SceneError: the image is missing, or cannot be read.
        """
        path = self.require(name, "a texture at")
        return path, read_image(path)


def text_of(path: Path) -> str:
    """The text of a file in the encoding of its byte order mark, else in UTF-8, else in Windows code page 1252, which
    assigns a character to nearly every byte; other bytes are replaced."""
    content = path.read_bytes()
    for mark, encoding in _MARKS:
        if content.startswith(mark):
            return content.decode(encoding, errors="replace")
    try:
        return content.decode("utf-8")
    except UnicodeDecodeError:
        return content.decode("cp1252", errors="replace")
