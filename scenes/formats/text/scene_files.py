"""Files that a scene file names.

A scene file is not trusted. Its names are relative; names that lead out of the allowed folder, also through links, are
refused. The bytes that are read and the depth of includes are bounded.
"""

from __future__ import annotations

import codecs
import gzip
from pathlib import Path

from scenes.canonical import SceneError
from scenes.formats.losses import LossReport

DEPTH_MAX = 16
"""Greatest depth of files that include each other."""

BYTES_MAX = 2 << 30
"""Most bytes of text and meshes that one scene reads."""


class SceneFiles:
    """The files of one scene."""

    def __init__(self, main: Path, root: Path | None = None, bytes_max: int = BYTES_MAX) -> None:
        """Opens nothing yet.

        Args:
            main: the scene's first file.
            root: folder that no file may lie outside of; by default that of ``main``.
            bytes_max: bytes that are read at most.
        """
        self.main = Path(main)
        self.folder = self.main.resolve().parent
        self.root = (Path(root) if root is not None else self.folder).resolve()
        self._left = bytes_max
        if not self.folder.is_relative_to(self.root):
            raise SceneError(f"{main}: expected a scene inside {self.root}")

    def path(self, name: str, where: str, beside: Path | None = None) -> Path:
        """The file of a name.

        Args:
            name: as the scene gives it, relative.
            where: place of the name, for the message.
            beside: another file; the name is looked up in its folder where the folder of the first file lacks it.

        Raises:
            SceneError: the name is absolute, leads outside, or names no file.
        """
        found = self._found(name, where, beside)
        if found is None:
            wanted = self.folder / name.replace("\\", "/")
            raise SceneError(f"{where}: expected a file at {wanted}, found none")
        return found

    def known(
        self, name: str, where: str, report: LossReport, what: str, became: str, beside: Path | None = None
    ) -> Path | None:
        """The file of a name, or None where it is missing, which is reported.

        Raises:
            SceneError: the name is absolute or leads outside.
        """
        found = self._found(name, where, beside)
        if found is None:
            report.add(where, f"{what}, which is missing", became)
        return found

    def _found(self, name: str, where: str, beside: Path | None) -> Path | None:
        text = name.replace("\\", "/")
        if not text or "\0" in text or Path(text).is_absolute() or text[1:2] == ":":
            raise SceneError(f"{where}: expected a relative file name, got {name!r}")
        places = [self.folder] + ([beside.resolve().parent] if beside is not None else [])
        for place in places:
            path = (place / text).resolve()
            if not path.is_relative_to(self.root):
                raise SceneError(f"{where}: expected a file inside {self.root}, got {name!r} (the root can be set)")
            if path.is_file():
                return path
        return None

    def read(self, path: Path, where: str) -> bytes:
        """Content of a file, decompressed where its name ends in ``.gz``.

        Raises:
            SceneError: it cannot be read, or is more than may be read.
        """
        try:
            if path.stat().st_size > self._left:
                raise SceneError(f"{where}: {path}: expected at most {self._left:,} bytes, got {path.stat().st_size:,}")
            if path.suffix == ".gz":
                with gzip.open(path) as file:
                    content = file.read(self._left + 1)
            else:
                content = path.read_bytes()
        except (OSError, EOFError) as error:
            raise SceneError(f"{where}: {path}: cannot be read ({error})") from None
        if len(content) > self._left:
            raise SceneError(f"{where}: {path}: expected at most {self._left:,} bytes")
        self._left -= len(content)
        return content

    def text(self, path: Path, where: str) -> str:
        """Content of a text file: UTF-8, UTF-16 with a mark of its byte order, or else Latin-1."""
        content = self.read(path, where)
        try:
            marked = content.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE))
            return content.decode("utf-16" if marked else "utf-8-sig")
        except UnicodeDecodeError:
            return content.decode("latin-1")
