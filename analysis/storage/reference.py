"""Reference images at a high rate in space and time, rendered once and kept on disk.

A reference is named by a hash of everything that decides its content. It is written image by image, each with its
checksum and the number of its non-finite values. An interrupted rendering continues where it stopped, and damaged
images are detected and rendered again.
"""

from __future__ import annotations

import dataclasses
import hashlib
import io
import json
import os
import shutil
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import ArrayLike, NDArray
from torch import Tensor

from analysis.command.progress import Task
from analysis.storage.files import atomic, locked
from analysis.storage.journal import Journal, warn
from analysis.storage.source import code_hash

_HALF_MAX = float(np.finfo(np.float16).max)


@dataclass(frozen=True)
class ReferenceSpec:
    """Everything that decides the content of a reference.

    Attributes:
        scene: name and phase of the scene, for messages.
        scene_hash: :func:`content_hash` of the scene.
        renderer_hash: :func:`renderer_hash` of the renderer.
        start_s: time of the first image, seconds.
        rate_hz: images per second.
        count: number of images.
        width_px, height_px: size of the images.
        samples_per_axis: side of the grid of samples whose average is a pixel.
    """

    scene: str
    scene_hash: str
    renderer_hash: str
    start_s: float
    rate_hz: float
    count: int
    width_px: int
    height_px: int
    samples_per_axis: int

    def __post_init__(self) -> None:
        for name in ("rate_hz", "count", "width_px", "height_px", "samples_per_axis"):
            if not getattr(self, name) > 0:
                raise ValueError(f"reference {name}: expected a positive number, got {getattr(self, name)!r}")

    @property
    def key(self) -> str:
        """Name of the reference on disk."""
        text = json.dumps(dataclasses.asdict(self), sort_keys=True)
        return hashlib.sha256(text.encode()).hexdigest()[:24]

    @property
    def shape(self) -> tuple[int, int, int, int]:
        """Shape ``(count, height, width, 3)`` of the images."""
        return self.count, self.height_px, self.width_px, 3

    @property
    def bytes(self) -> int:
        """Size on disk, bytes."""
        return 2 * int(np.prod(self.shape))


def content_hash(value: Any) -> str:
    """Hash of a tree of dataclasses, containers, numbers and arrays, such as a scene with its meshes and textures."""
    digest = hashlib.sha256()
    known: dict[int, bytes] = {}

    def leaf(item: Any) -> bytes:
        # many instances share meshes and textures: each is hashed once
        if id(item) not in known:
            part = hashlib.sha256(f"{item.dtype}{item.shape}".encode())
            part.update(np.ascontiguousarray(item).tobytes())
            known[id(item)] = part.digest()
        return known[id(item)]

    def visit(item: Any) -> None:
        if isinstance(item, np.ndarray):
            digest.update(leaf(item))
        elif dataclasses.is_dataclass(item) and not isinstance(item, type):
            digest.update(type(item).__name__.encode())
            for entry in dataclasses.fields(item):
                digest.update(entry.name.encode())
                visit(getattr(item, entry.name))
        elif isinstance(item, Mapping):
            digest.update(f"map{len(item)}".encode())
            for key in sorted(item, key=repr):
                digest.update(repr(key).encode())
                visit(item[key])
        elif isinstance(item, (list, tuple)):
            digest.update(f"list{len(item)}".encode())
            for entry in item:
                visit(entry)
        else:
            digest.update(f"{type(item).__name__}:{item!r};".encode())

    visit(value)
    return digest.hexdigest()


def renderer_hash(renderer: object, device: str) -> str:
    """Hash of the code that makes the images of a reference, and the kind of device."""
    return f"{code_hash(type(renderer), ReferenceSpec)}-{device.partition(':')[0]}"


@dataclass(frozen=True)
class Reference:
    """Reference images on disk.

    Attributes:
        spec: everything that decides their content.
        images: ``(count, height, width, 3)`` float16 linear RGB, memory-mapped.
        nonfinite: number of non-finite values in the rendering, which are stored as 0.
        rendered: number of images that were rendered now, not found on disk.
    """

    spec: ReferenceSpec
    images: NDArray[np.float16]
    nonfinite: int
    rendered: int


def as_stored(image: ArrayLike) -> NDArray[np.float16]:
    """Linear radiance as stored in a reference: float16, at least 0, and 0 where it is not finite."""
    finite = np.nan_to_num(np.asarray(image), nan=0.0, posinf=0.0, neginf=0.0)
    return np.clip(finite, 0.0, _HALF_MAX).astype("<f2")


Render = Callable[[float], Tensor]
"""``time_s -> (height, width, 3)`` linear RGB, already down-filtered to the resolution of the reference."""


def obtain(cache: Path, spec: ReferenceSpec, render: Render, task: Task | None = None) -> Reference:
    """The reference from disk, with every image checked; missing and damaged images are rendered now.

    If two processes want the same reference, the second waits while the first renders it.

    Args:
        cache: folder of references.
        spec: everything that decides the reference.
        render: called for each image that is not on disk.
        task: progress, one step an image.

    Raises:
        ValueError: the disk has no room for it, or the renderer returns another shape.
        OSError: it cannot be written.
    """
    cache.mkdir(parents=True, exist_ok=True)
    stored, task, rendered = _Images(cache, spec), task or Task(), 0
    nonfinite = stored.checked(say=lambda line: None)
    if len(nonfinite) < spec.count:
        with locked(cache / f"{spec.key}.lock"):
            nonfinite = stored.checked(say=warn)
            missing = [number for number in range(spec.count) if number not in nonfinite]
            with stored.opened(fresh=len(missing) == spec.count) as file:
                for number in missing:
                    task.reach(len(nonfinite))
                    nonfinite[number] = stored.write(file, number, render(spec.start_s + number / spec.rate_hz))
                    rendered += 1
    task.reach(spec.count)
    images = np.load(stored.path, mmap_mode="r")
    return Reference(spec, images, sum(nonfinite.values()), rendered)


class _Images:
    """The images of a reference in a file, and the journal that lists those that have been written.

    The file has its full length from the beginning. An image counts if the journal has a row with its checksum.
    """

    def __init__(self, cache: Path, spec: ReferenceSpec) -> None:
        self.path, self._spec = cache / f"{spec.key}.npy", spec
        self._journal = Journal(cache / f"{spec.key}.journal")
        header = io.BytesIO()
        empty = {"descr": np.lib.format.dtype_to_descr(np.dtype(np.float16)), "fortran_order": False}
        np.lib.format.write_array_header_1_0(header, {**empty, "shape": spec.shape})
        self._header, self._image_bytes = header.getvalue(), spec.bytes // spec.count

    def checked(self, say: Callable[[str], None]) -> dict[int, int]:
        """Number of non-finite values of each image that is intact on disk. Reports damaged images."""
        rows: dict[int, dict[str, Any]] = {}
        for row in self._journal.rows():
            if "image" in row:
                rows[row["image"]] = row
            else:
                rows.clear()  # a new file begins
        try:
            with self.path.open("rb") as file:
                whole = os.fstat(file.fileno()).st_size == len(self._header) + self._spec.bytes
                if file.read(len(self._header)) != self._header or not whole:
                    if rows:
                        say(f"{self.path}: is damaged: expected float16 {self._spec.shape}; it is rendered again")
                    return {}
                found = {
                    number: row["nonfinite"]
                    for number, row in sorted(rows.items())
                    if self._digest(number, self._read(file, number)) == row["sha256"]
                }
        except FileNotFoundError:
            return {}
        damaged = sorted(rows.keys() - found.keys())
        if damaged:
            say(f"{self.path}: images {', '.join(map(str, damaged))} are damaged and are rendered again")
        return found

    @contextmanager
    def opened(self, fresh: bool) -> Iterator[BinaryIO]:
        """The file for writing images; a fresh one has space for all images."""
        if fresh:
            self._allocate()
            self._journal.append({"key": self._spec.key, **dataclasses.asdict(self._spec)})
        with self.path.open("r+b") as file:
            yield file

    def write(self, file: BinaryIO, number: int, rendered: Tensor) -> int:
        """Writes an image to the disk; returns the number of its non-finite values."""
        image = np.asarray(rendered.cpu())
        if image.shape != self._spec.shape[1:]:
            raise ValueError(f"reference: expected images {self._spec.shape[1:]}, got {image.shape}")
        nonfinite = int((~np.isfinite(image)).sum())
        content = as_stored(image).tobytes()
        # not through mapped memory, where a full disk would kill the process
        file.seek(self._offset(number))
        file.write(content)
        file.flush()
        os.fsync(file.fileno())
        self._journal.append({"image": number, "nonfinite": nonfinite, "sha256": self._digest(number, content)})
        return nonfinite

    def _offset(self, number: int) -> int:
        return len(self._header) + number * self._image_bytes

    def _read(self, file: BinaryIO, number: int) -> bytes:
        file.seek(self._offset(number))
        return file.read(self._image_bytes)

    def _digest(self, number: int, content: bytes) -> str:
        # the key and the number, so that an image of another reference or at another number has another digest
        digest = hashlib.sha256(f"{self._spec.key} {number} ".encode())
        digest.update(content)
        return digest.hexdigest()

    def _allocate(self) -> None:
        """Creates the file and allocates all of its space on the disk."""
        need = self._spec.bytes + len(self._header)
        self.path.unlink(missing_ok=True)  # its blocks count as free space space
        free = shutil.disk_usage(self.path.parent).free
        if need > free:
            where = self.path.parent
            raise ValueError(f"{where}: the reference needs {need / 1e9:.1f} GB, {free / 1e9:.1f} GB are free")
        with atomic(self.path) as temporary, temporary.open("wb") as file:
            file.write(self._header)
            file.flush()
            os.posix_fallocate(file.fileno(), 0, need)
