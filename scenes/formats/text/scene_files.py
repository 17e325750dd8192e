"""The files to which a scene file refers.

A scene file is not trusted. File names must be relative; names that lead out of the allowed folder, including through
links, are rejected. The number of bytes read and the depth of includes are bounded.
"""

from __future__ import annotations

import codecs
import gzip
from pathlib import Path

from scenes.canonical import SceneError
from scenes.formats.losses import LossReport

DEPTH_MAX = 16
"""Maximum depth of nested includes."""

BYTES_MAX = 2 << 30
"""Maximum number of bytes of text and meshes that one scene reads."""


class SceneFiles:
    """The files of one scene."""

    def __init__(self, main: Path, root: Path | None = None, bytes_max: int = BYTES_MAX) -> None:
        """Sets the folder; no file is opened.

        Args:
            main: main file of the scene.
            root: folder outside of which no file may lie; by default that of ``main``.
            bytes_max: maximum number of bytes that are read.
        """
        self.main = Path(main)
        self.folder = self.main.resolve().parent
        self.root = (Path(root) if root is not None else self.folder).resolve()
        self._left = bytes_max
        self._paths: dict[tuple[str, Path | None], Path] = {}
        if not self.folder.is_relative_to(self.root):
            raise SceneError(f"{main}: expected a scene inside {self.root}")

    def path(self, name: str, where: str, beside: Path | None = None) -> Path:
        """The path of a file name.

        Args:
            name: relative file name, as in the scene.
            where: place of the name, for the message.
            beside: another file; the name is searched in its folder if the folder of the main file lacks it.

        Raises:
            SceneError: the name is absolute, leads outside, or names no file.
        """
        found = self._once(name, where, beside)
        if found is None:
            wanted = self.folder / name.replace("\\", "/")
            raise SceneError(f"{where}: expected a file at {wanted}, found none")
        return found

    def known(
        self, name: str, where: str, report: LossReport, what: str, became: str, beside: Path | None = None
    ) -> Path | None:
        """The path of a file name, or None if the file is missing, which is reported.

        Raises:
            SceneError: the name is absolute or leads outside.
        """
        found = self._once(name, where, beside)
        if found is None:
            report.add(where, f"{what}, which is missing", became)
        return found

    def _once(self, name: str, where: str, beside: Path | None) -> Path | None:
        """The file of a name, which is searched until it is found."""
        found = self._paths.get((name, beside)) or self._found(name, where, beside)
        if found is not None:
            self._paths[name, beside] = found
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
        """Content of a file, decompressed if its name ends in ``.gz``.

        Raises:
            SceneError: the file cannot be read, or exceeds the number of bytes that may be read.
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
        """Content of a text file in UTF-8, UTF-16 with a byte order mark, or else Latin-1."""
        content = self.read(path, where)
        try:
            marked = content.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE))
            return content.decode("utf-16" if marked else "utf-8-sig")
        except UnicodeDecodeError:
            return content.decode("latin-1")
