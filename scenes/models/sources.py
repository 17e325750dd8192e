"""The files that a model is made of."""

from __future__ import annotations

import codecs
from pathlib import Path
from urllib.parse import unquote

from scenes.canonical import SceneError
from scenes.loading import FileState, Picture, read_image, state_of

_MARKS = ((codecs.BOM_UTF8, "utf-8-sig"), (codecs.BOM_UTF16_LE, "utf-16"), (codecs.BOM_UTF16_BE, "utf-16"))


class Sources:
    """Reads the files that a model names, and remembers their states, also of those that are not there.

    Attributes:
        path: of the model.
        files: states of all files that were asked for.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.files: dict[Path, FileState | None] = {path: state_of(path)}

    def find(self, name: str) -> Path | None:
        """The file of a name: in the model's folder as the name says, or, where the name is a path of another machine,
        by its last part. None where there is none."""
        text = name.replace("\\", "/")
        for candidate in dict.fromkeys((text, unquote(text), text.rpartition("/")[2])):
            path = self.path.parent / candidate
            self.files.setdefault(path, state_of(path))
            if path.is_file():
                return path
        return None

    def require(self, name: str, what: str) -> Path:
        """As :func:`find`; raises SceneError where there is none."""
        path = self.find(name)
        if path is None:
            raise SceneError(f"expected {what} {self.path.parent / name}, found no file")
        return path

    def picture(self, name: str) -> tuple[Path, Picture]:
        """A texture of a name, as linear RGB, and its file.

        Raises:
            SceneError: there is none, or it cannot be read.
        """
        path = self.require(name, "a texture at")
        return path, read_image(path)


def text_of(path: Path) -> str:
    """A text in the encoding that its first bytes tell, else UTF-8, else that of Windows (code page 1252), which gives
    a character to nearly every byte; bytes that have none there are replaced."""
    content = path.read_bytes()
    for mark, encoding in _MARKS:
        if content.startswith(mark):
            return content.decode(encoding, errors="replace")
    try:
        return content.decode("utf-8")
    except UnicodeDecodeError:
        return content.decode("cp1252", errors="replace")
