"""The files of a model."""

from __future__ import annotations

import codecs
import re
from pathlib import Path
from typing import Any
from urllib.parse import unquote

from scenes.canonical import SceneError
from scenes.formats.losses import LossReport
from scenes.loading import FileState, state_of

_MARKS = ((codecs.BOM_UTF8, "utf-8-sig"), (codecs.BOM_UTF16_LE, "utf-16"), (codecs.BOM_UTF16_BE, "utf-16"))

_COMMENT_OR_JOINT = re.compile(r"^[ \t]*#[^\r\n]*|\\[ \t]*\r?\n", re.MULTILINE)


class Sources:
    """Reads the files to which a model refers, and records their states, including those of missing files.

    Attributes:
        path: path of the model.
        files: states of all requested files.
        kept: what a reader keeps of a file for its other times; None if nothing.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.files: dict[Path, FileState | None] = {path: state_of(path)}
        self.kept: Any = None

    @property
    def changed(self) -> bool:
        """Whether a file differs from what was read."""
        return any(state_of(file) != state for file, state in self.files.items())

    def find(self, name: str) -> Path | None:
        """The path of a file name, relative to the model's folder; if the name is a path of another machine, its last
        part is used, and if only the case of letters differs, that file. None if there is no such file."""
        text = name.replace("\\", "/")
        for candidate in dict.fromkeys((text, unquote(text), text.rpartition("/")[2])):
            path = self.path.parent / candidate
            self.files.setdefault(path, state_of(path))
            if path.is_file():
                return path
        return self._with_other_case(text)

    def _with_other_case(self, name: str) -> Path | None:
        """The file of a name whose letters differ in case alone, as on systems that do not tell them apart."""
        folder, _, wanted = name.rpartition("/")
        try:
            names = sorted(path.name for path in (self.path.parent / folder).iterdir())
        except (OSError, ValueError):
            return None
        found = next((one for one in names if one.casefold() == unquote(wanted).casefold()), None)
        if found is None:
            return None
        path = self.path.parent / folder / found
        self.files.setdefault(path, state_of(path))
        return path if path.is_file() else None

    def require(self, name: str, what: str) -> Path:
        """Like :meth:`find`, but raises SceneError if there is no such file."""
        path = self.find(name)
        if path is None:
            raise SceneError(f"expected {what} {self.path.parent / name}, found no file")
        return path

    def known(self, name: str, where: str, report: LossReport, what: str, became: str = "left out") -> Path | None:
        """Like :meth:`find`, but a missing file is a loss."""
        path = self.find(name)
        if path is None:
            report.add(where, f"{what} {name!r}, which is missing", became)
        return path


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


def joined_lines(text: str) -> str:
    """The text of an OBJ file or a material library, in which a line that ends with a backslash goes on in the next
    one; blanks may follow the backslash. Whole lines of comment are left out, since theirs may end a path."""
    return _COMMENT_OR_JOINT.sub(lambda found: " " if found[0].startswith("\\") else "", text)
