"""The files of a converted scene: its text, meshes and images, which are put in place together or not at all."""

from __future__ import annotations

import hashlib
import os
import re
import shutil
import tempfile
from collections.abc import Iterable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from scenes import loading
from scenes.canonical import Mesh, SceneError
from scenes.formats.geometry.ply_writing import ply_parts

_OF_CONTENT = re.compile(r"-[0-9a-f]{8}$")


class Output:
    """Files of a scene that is being written.

    They are written to a temporary folder beside the target and moved when :meth:`place` is called.
    """

    def __init__(self, path: Path) -> None:
        """Raises SceneError if the folder is not writable."""
        self.path = Path(path)
        try:
            self.path.parent.mkdir(parents=True, exist_ok=True)
            self._work = Path(tempfile.mkdtemp(prefix=".partial-", dir=self.path.parent))
        except OSError as error:
            raise SceneError(f"{path}: cannot be written ({error.strerror})") from None
        self._meshes: dict[int, tuple[Mesh, str]] = {}
        self._pictures: dict[int, tuple[NDArray[np.float32], str]] = {}

    def named(self, folder: str, stem: str, ending: str, parts: Iterable[bytes | memoryview]) -> str:
        """Writes a file whose name contains a hash of its content, so that the files of several scenes in one folder do
        not collide.

        Returns:
            Its name, relative to the folder of the scene.
        """
        (self._work / folder).mkdir(exist_ok=True)
        partial, digest = self._work / folder / "partial", hashlib.blake2b(digest_size=4)
        with partial.open("wb") as file:
            for part in parts:
                digest.update(part)
                file.write(part)
        name = f"{folder}/{_OF_CONTENT.sub('', _plain(stem))}-{digest.hexdigest()}{ending}"
        partial.replace(self._work / name)
        return name

    def mesh(self, mesh: Mesh) -> str:
        """Writes a mesh as PLY; the same mesh is written once.

        Returns:
            Its name, relative to the folder of the scene.
        """
        if id(mesh) not in self._meshes:
            stem = Path(mesh.source).stem if mesh.source.endswith((".ply", ".obj", ".gz")) else "mesh"
            self._meshes[id(mesh)] = mesh, self.named("models", stem, ".ply", ply_parts(mesh))
        return self._meshes[id(mesh)][1]

    def picture(
        self, image: NDArray[np.float32], source: str, endings: tuple[str, ...] = (".exr", ".png", ".jpg", ".jpeg")
    ) -> str:
        """Copies the file of an image, or writes an EXR file if its format is not supported or the image has changed.

        Args:
            image: linear RGB.
            source: file of the image, or empty.
            endings: endings of files that may be copied.
        """
        if id(image) not in self._pictures:
            path = Path(source)
            wanted = path.is_file() and path.suffix.lower() in endings
            same = wanted and np.array_equal(loading.read_image(path), image)
            content = path.read_bytes() if same else self._exr_bytes(image)
            name = self.named("textures", path.stem or "picture", path.suffix.lower() if same else ".exr", [content])
            self._pictures[id(image)] = image, name
        return self._pictures[id(image)][1]

    def _exr_bytes(self, image: NDArray[np.float32]) -> bytes:
        import OpenEXR

        header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
        path = self._work / "picture.exr"
        OpenEXR.File(header, {"RGB": np.ascontiguousarray(image, np.float32)}).write(str(path))
        content = path.read_bytes()
        path.unlink()
        return content

    def text(self, name: str, content: str) -> None:
        """Writes a text file, the same bytes on every system; the scene's own has the name of :attr:`path`."""
        (self._work / name).write_bytes(content.encode())

    def content(self, name: str, parts: Iterable[bytes]) -> None:
        """Writes a binary file from its parts; the scene's own has the name of :attr:`path`."""
        with (self._work / name).open("wb") as file:
            file.writelines(parts)

    def place(self) -> None:
        """Moves everything into place, the scene's own file last.

        Raises:
            SceneError: a file cannot be moved.
        """
        try:
            files = sorted(file for file in self._work.rglob("*") if file.is_file())
            files.sort(key=lambda file: file.name == self.path.name)
            for file in files:
                target = self.path.parent / file.relative_to(self._work)
                target.parent.mkdir(parents=True, exist_ok=True)
                os.replace(file, target)
        except OSError as error:
            raise SceneError(f"{self.path}: cannot be written ({error.strerror})") from None
        finally:
            self.discard()

    def discard(self) -> None:
        """Removes the files that were not placed."""
        shutil.rmtree(self._work, ignore_errors=True)


def _plain(stem: str) -> str:
    return "".join(letter if letter.isalnum() or letter in "-_" else "_" for letter in stem) or "part"
