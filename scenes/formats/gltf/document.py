"""A glTF 2.0 file that is being written: its JSON, its buffer and its images.

Source: Khronos Group, "glTF 2.0 specification", sections 3.6 (buffers, views, accessors), 3.8 (textures) and 4 (GLB).
"""

from __future__ import annotations

import io
import json
import math
import struct
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Any, TypeVar
from urllib.parse import quote

import numpy as np
from jaxtyping import UInt8
from numpy.typing import NDArray
from PIL import Image

from scenes.canonical import SceneError
from scenes.formats.text.output import Output

Json = dict[str, Any]
Part = TypeVar("Part")

VERTICES, INDICES = 34962, 34963
"""Targets of buffer views."""

_TYPES = {"f4": 5126, "u4": 5125, "u2": 5123}
_WIDTHS = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4"}
_GLB, _JSON, _BIN = 0x46546C67, 0x4E4F534A, 0x004E4942
_SIZE_MOST = (1 << 32) - 1


@dataclass
class Document:
    """Collects the lists of a file; what is equal is written once.

    Attributes:
        output: receives the files.
        json: the lists by name.
    """

    output: Output
    json: dict[str, list[Json]] = field(default_factory=dict)
    extensions: Json = field(default_factory=dict)
    _used: set[str] = field(default_factory=set)
    _buffer: list[bytes] = field(default_factory=list)
    _size: int = 0
    _made: dict[Any, tuple[object, Any]] = field(default_factory=dict)

    @property
    def embedded(self) -> bool:
        """Whether all is in one file (GLB)."""
        return self.output.path.suffix.lower() == ".glb"

    def add(self, name: str, item: Json) -> int:
        """Adds an object to a top-level list and returns its index."""
        items = self.json.setdefault(name, [])
        items.append(item)
        return len(items) - 1

    def once(self, key: Any, kept: object, make: Callable[[], Part]) -> Part:
        """What ``make`` returned for the first call with this key; ``kept`` stays alive, so that its id is its own."""
        if key not in self._made:
            self._made[key] = kept, make()
        return self._made[key][1]

    def extension(self, name: str, values: Json) -> dict[str, Json]:
        """An entry of ``extensions``, whose name is listed among those that are used."""
        self._used.add(name)
        return {name: values}

    def _view(self, content: bytes, target: int | None = None) -> int:
        view: Json = {"buffer": 0, "byteOffset": self._size, "byteLength": len(content)}
        padded = content + bytes(-len(content) % 4)
        self._buffer.append(padded)
        self._size += len(padded)
        return self.add("bufferViews", view if target is None else {**view, "target": target})

    def accessor(self, values: NDArray[Any], target: int | None = None, bounds: bool = False) -> int:
        """The index of an accessor of the rows ``(n, width)`` or numbers ``(n,)``, float32, uint32 or uint16."""
        rows = np.ascontiguousarray(values.reshape(len(values), -1))
        kind, width = _TYPES[rows.dtype.str[1:]], _WIDTHS[rows.shape[1]]
        made: Json = {"bufferView": self._view(rows.tobytes(), target), "componentType": kind, "count": len(rows)}
        made["type"] = width
        if bounds:
            made["min"], made["max"] = rows.min(axis=0).tolist(), rows.max(axis=0).tolist()
        return self.add("accessors", made)

    def picture(self, codes: UInt8[NDArray, "h w c"], stem: str) -> int:
        """The index of an image with these values, with or without opacity, as PNG."""
        content = io.BytesIO()
        Image.fromarray(codes, "RGBA" if codes.shape[2] == 4 else "RGB").save(content, "PNG")
        return self.image(content.getvalue(), stem, ".png")

    def image(self, content: bytes, stem: str, ending: str) -> int:
        """The index of an image in a PNG or JPEG file."""
        if not self.embedded:
            return self.add("images", {"uri": quote(self.output.named("textures", stem, ending, [content]))})
        kind = "image/png" if ending == ".png" else "image/jpeg"
        return self.add("images", {"bufferView": self._view(content), "mimeType": kind})

    def write(self) -> None:
        """Writes the file, with its buffer beside it unless it is embedded.

        Raises:
            SceneError: a GLB file would have 4 GiB or more, or a number is not finite.
        """
        whole: Json = {"asset": {"version": "2.0", "generator": "tsar"}, **self.json}
        if self._size:
            buffer: Json = {"byteLength": self._size}
            if not self.embedded:
                buffer["uri"] = quote(self.output.named("models", self.output.path.stem, ".bin", self._buffer))
            whole["buffers"] = [buffer]
        if self.extensions:
            whole["extensions"] = self.extensions
        if self._used:
            whole["extensionsUsed"] = sorted(self._used)
        if "scenes" in whole:
            whole["scene"] = 0
        style: Json = {"separators": (",", ":")} if self.embedded else {"indent": 1}
        try:
            written = json.dumps(whole, allow_nan=False, **style)
        except ValueError:
            wrong = next(_not_finite(whole, ""))
            raise SceneError(f"{self.output.path}: expected finite numbers, got {wrong}") from None
        if not self.embedded:
            self.output.text(self.output.path.name, written + "\n")
            return
        text = written.encode()
        text += b" " * (-len(text) % 4)
        chunks = [struct.pack("<II", len(text), _JSON), text]
        if self._size:
            chunks += [struct.pack("<II", self._size, _BIN), *self._buffer]
        size = 12 + sum(map(len, chunks))
        if size > _SIZE_MOST:
            raise SceneError(f"{self.output.path}: expected less than 4 GiB, got {size:,} bytes; use .gltf")
        self.output.content(self.output.path.name, [struct.pack("<III", _GLB, 2, size), *chunks])


def _not_finite(value: Any, place: str) -> Iterator[str]:
    """Numbers of JSON that are not finite, with their places."""
    if isinstance(value, float) and not math.isfinite(value):
        yield f"{value} in {place.removeprefix('.')}"
    elif isinstance(value, dict):
        for name, one in value.items():
            yield from _not_finite(one, f"{place}.{name}")
    elif isinstance(value, list | tuple):
        for number, one in enumerate(value):
            yield from _not_finite(one, f"{place}[{number}]")
