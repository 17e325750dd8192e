"""Reference images at a high rate in space and time, rendered once and kept on disk.

A reference is named by a hash of everything that decides its content. It is written image by image under a temporary
name, so that an interrupted rendering goes on where it stopped.
"""

from __future__ import annotations

import dataclasses
import hashlib
import importlib.metadata
import json
import os
import shutil
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from torch import Tensor

from analysis.files import PARTIAL, locked, write_json

_HALF_MAX = float(np.finfo(np.float16).max)


@dataclass(frozen=True)
class ReferenceSpec:
    """Everything that decides the content of a reference.

    Attributes:
        scene: name and phase of the scene, for people.
        scene_hash: :func:`content_hash` of the scene.
        renderer_hash: hash of the renderer's source, versions and kind of device.
        start_s: time of the first image, seconds.
        rate_hz: images per second.
        count: number of images.
        resolution_px: width and height, pixels.
        samples_per_axis: the average of a grid of this many samples squared is one pixel.
    """

    scene: str
    scene_hash: str
    renderer_hash: str
    start_s: float
    rate_hz: float
    count: int
    resolution_px: int
    samples_per_axis: int

    def __post_init__(self) -> None:
        for name in ("rate_hz", "count", "resolution_px", "samples_per_axis"):
            if not getattr(self, name) > 0:
                raise ValueError(f"reference {name}: expected a positive number, got {getattr(self, name)!r}")

    @property
    def key(self) -> str:
        """Name of the reference on disk."""
        text = json.dumps(dataclasses.asdict(self), sort_keys=True)
        return hashlib.sha256(text.encode()).hexdigest()[:24]

    @property
    def shape(self) -> tuple[int, int, int, int]:
        return self.count, self.resolution_px, self.resolution_px, 3

    @property
    def bytes(self) -> int:
        """Size on disk."""
        return 2 * int(np.prod(self.shape))


def content_hash(value: Any) -> str:
    """Hash of a tree of dataclasses, containers, numbers and arrays, such as a scene with its meshes and textures."""
    digest = hashlib.sha256()
    known: dict[int, bytes] = {}

    def leaf(item: Any) -> bytes:
        # meshes and textures are shared by many instances: each is hashed once
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


def source_hash(folder: Path, skip: tuple[str, ...] = ()) -> str:
    """Hash of the Python files and C++ headers in and below a folder, by name and content.

    Args:
        folder: where they lie.
        skip: patterns of names that are left out.
    """
    digest = hashlib.sha256()
    for path in sorted([*folder.glob("*.py"), *folder.glob("*/*.h")]):
        if not any(path.match(pattern) for pattern in skip):
            digest.update(path.name.encode() + path.read_bytes())
    return digest.hexdigest()


_NOT_TRACING = ("film.py", "sequence.py", "queries.py", "control*.py", "display*.py", "launching.py")


def renderer_hash(root: Path, device: str) -> str:
    """Hash of what decides a picture: the renderer without file formats and stages, Warp, the kind of device."""
    version = importlib.metadata.version("warp-lang")
    return "-".join((source_hash(root / "renderer", skip=_NOT_TRACING)[:16], version, device.partition(":")[0]))


@dataclass(frozen=True)
class Reference:
    """Reference images on disk.

    Attributes:
        spec: what they are.
        images: ``(count, height, width, 3)`` float16 linear RGB, mapped into memory as it is read.
        nonfinite: values of the rendering that were not finite; they are stored as 0.
        rendered: images rendered now rather than found on disk.
    """

    spec: ReferenceSpec
    images: NDArray[np.float16]
    nonfinite: int
    rendered: int


Render = Callable[[float], Tensor]
"""``time_s -> (height, width, 3)`` linear RGB, already down-filtered to the resolution of the reference."""


def obtain(cache: Path, spec: ReferenceSpec, render: Render, progress: Callable[[int, int], None]) -> Reference:
    """The reference from disk, or rendered now; a rendering that was interrupted goes on where it stopped.

    Two processes that want the same reference do not both render it: the second waits.

    Args:
        cache: folder of references.
        spec: what is wanted.
        render: called for each image that is not on disk.
        progress: called with images done and images in all.

    Raises:
        ValueError: the disk has no room for it, or the renderer returns another shape.
    """
    cache.mkdir(parents=True, exist_ok=True)
    final, sidecar = cache / f"{spec.key}.npy", cache / f"{spec.key}.json"
    with locked(cache / f"{spec.key}.lock"):
        before = spec.count if final.exists() else None
        if before is None:
            before = _render_missing(cache, spec, render, progress)
    progress(spec.count, spec.count)
    nonfinite = json.loads(sidecar.read_text())["nonfinite"]
    images = np.load(final, mmap_mode="r")
    if images.shape != spec.shape:
        raise ValueError(f"{final}: expected images {spec.shape}, got {images.shape}; delete the file")
    return Reference(spec, images, nonfinite, spec.count - before)


def _render_missing(cache: Path, spec: ReferenceSpec, render: Render, progress: Callable[[int, int], None]) -> int:
    """Renders what is missing and puts the file into place; returns how many images were already there."""
    # not the temporary name of the sidecar: writing that would take the state along
    partial, state = cache / f"{spec.key}{PARTIAL}.npy", cache / f"{spec.key}.state.json"
    done, nonfinite = _resume(partial, state, spec)
    if done == 0:
        free = shutil.disk_usage(cache).free
        if spec.bytes > free:
            raise ValueError(f"{cache}: the reference needs {spec.bytes / 1e9:.1f} GB, {free / 1e9:.1f} GB are free")
        state.unlink(missing_ok=True)  # of a file that is gone or damaged
        np.lib.format.open_memmap(partial, mode="w+", dtype=np.float16, shape=spec.shape)
    before, images = done, np.lib.format.open_memmap(partial, mode="r+")
    for number in range(done, spec.count):
        progress(number, spec.count)
        image = np.asarray(render(spec.start_s + number / spec.rate_hz).cpu())
        if image.shape != spec.shape[1:]:
            raise ValueError(f"reference: expected images {spec.shape[1:]}, got {image.shape}")
        nonfinite += int((~np.isfinite(image)).sum())
        image = np.nan_to_num(image, nan=0.0, posinf=0.0, neginf=0.0)
        images[number] = np.clip(image, 0.0, _HALF_MAX).astype(np.float16)
        images.flush()
        write_json(state, {"done": number + 1, "nonfinite": nonfinite})
    del images
    write_json(cache / f"{spec.key}.json", {"nonfinite": nonfinite, **dataclasses.asdict(spec)})
    os.replace(partial, cache / f"{spec.key}.npy")
    state.unlink(missing_ok=True)
    return before


def _resume(partial: Path, state: Path, spec: ReferenceSpec) -> tuple[int, int]:
    """Images done and non-finite values of an interrupted rendering; zeros where there is none that can be used."""
    try:
        found = json.loads(state.read_text())
        shape = np.load(partial, mmap_mode="r").shape
    except (OSError, ValueError, EOFError):
        return 0, 0
    return (found["done"], found["nonfinite"]) if shape == spec.shape else (0, 0)
