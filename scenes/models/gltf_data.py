"""The container of a glTF 2.0 file: its JSON, its buffers, and the values of its accessors.

trimesh, which reads STL here, drops sparse accessors, samplers, texture transforms and all but the first texture
coordinates; pygltflib reads only the JSON and leaves accessors to its callers.

Source: Khronos Group, "glTF 2.0 specification", sections 3.6 (buffers, views, accessors) and 4 (GLB).
"""

from __future__ import annotations

import base64
import binascii
import io
import json
import struct
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scenes.canonical import SceneError
from scenes.models.sources import Sources

_TYPES = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
_WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT2": 4, "MAT3": 9, "MAT4": 16}
_GLB, _JSON, _BIN = 0x46546C67, 0x4E4F534A, 0x004E4942
_COUNT_MAX = 1 << 28


class GltfData:
    """A glTF or GLB file.

    Attributes:
        json: parsed JSON object.
    """

    def __init__(self, sources: Sources) -> None:
        """Reads the file.

        Raises:
            SceneError: it is not a glTF 2 file.
        """
        self.sources = sources
        content = sources.path.read_bytes()
        self._glb_buffer: bytes | None = None
        text = self._chunks(content) if content[:4] == b"glTF" else content
        try:
            self.json: dict[str, Any] = json.loads(text.decode("utf-8-sig"))
        except ValueError:
            raise SceneError("cannot be read: expected JSON") from None
        asset = self.json.get("asset") if isinstance(self.json, dict) else None
        version = str(asset.get("version", "")) if isinstance(asset, dict) else ""
        if not version.startswith("2."):
            raise SceneError(f"cannot be read: expected glTF 2, got version {version or 'none'}")
        self._buffers: dict[int, bytes] = {}

    def _chunks(self, content: bytes) -> bytes:
        """The JSON of a GLB file; its buffer is kept."""
        if len(content) < 20 or struct.unpack_from("<I", content, 4)[0] != 2:
            raise SceneError("cannot be read: expected GLB of version 2")
        at, text = 12, b""
        while at + 8 <= len(content):
            length, kind = struct.unpack_from("<II", content, at)
            chunk = content[at + 8 : at + 8 + length]
            if len(chunk) < length:
                raise SceneError(f"cannot be read: expected a chunk of {length} bytes, got {len(chunk)}")
            if kind == _JSON:
                text = chunk
            elif kind == _BIN and self._glb_buffer is None:
                self._glb_buffer = chunk
            at += 8 + length
        return text

    def items(self, name: str) -> list[dict[str, Any]]:
        """The objects of a top-level list, such as ``nodes``."""
        return self.json.get(name, [])

    def at(self, name: str, index: Any) -> dict[str, Any]:
        """An object of such a list.

        Raises:
            SceneError: there is no such object.
        """
        items = self.items(name)
        if not isinstance(index, int) or not 0 <= index < len(items):
            raise SceneError(f"cannot be read: expected an index of {name} below {len(items)}, got {index}")
        return items[index]

    def resource(self, uri: str, what: str) -> bytes:
        """The bytes of a URI: embedded data, or a file beside it."""
        if uri.startswith("data:"):
            try:
                return base64.b64decode(uri.partition(",")[2])
            except binascii.Error:
                raise SceneError(f"cannot be read: {what}: expected data in base64") from None
        return self.sources.require(uri, what).read_bytes()

    def view(self, index: Any) -> bytes:
        """The bytes of a buffer view."""
        view = self.at("bufferViews", index)
        number = view.get("buffer", 0)
        if number not in self._buffers:
            buffer = self.at("buffers", number)
            whole = self._glb_buffer if "uri" not in buffer else self.resource(buffer["uri"], "a buffer at")
            self._buffers[number] = whole if whole is not None else b""
        start, length = view.get("byteOffset", 0), view["byteLength"]
        found = self._buffers[number][start : start + length]
        if start < 0 or len(found) < length:
            raise SceneError(f"cannot be read: expected {length} bytes of buffer {number} at {start}, got {len(found)}")
        return found

    def numbers(self, index: Any) -> NDArray[np.float64]:
        """The elements ``(count, width)`` of an accessor; normalised integers are converted to fractions."""
        accessor = self.at("accessors", index)
        width, kind = _WIDTHS[accessor["type"]], np.dtype(_TYPES[accessor["componentType"]])
        count = accessor["count"]
        if not 0 <= count <= _COUNT_MAX:
            raise SceneError(f"cannot be read: expected at most {_COUNT_MAX} elements of an accessor, got {count}")
        if "bufferView" in accessor:
            view = self.at("bufferViews", accessor["bufferView"])
            found = _strided(
                self.view(accessor["bufferView"]), accessor.get("byteOffset", 0), count, width, kind,
                view.get("byteStride", 0),
            )  # fmt: skip
        else:
            found = np.zeros((count, width), kind)
        if "sparse" in accessor:
            found = self._replaced(found, accessor["sparse"], kind)
        if not accessor.get("normalized", False):
            return found.astype(np.float64)
        most = float(np.iinfo(kind).max) if kind.kind in "iu" else 1.0
        return np.maximum(found.astype(np.float64) / most, -1.0)

    def _replaced(self, dense: NDArray[Any], sparse: dict[str, Any], kind: np.dtype) -> NDArray[Any]:
        """Elements with those of a sparse accessor replaced."""
        count, indices, values = sparse["count"], sparse["indices"], sparse["values"]
        index_kind = np.dtype(_TYPES[indices["componentType"]])
        places = _strided(self.view(indices["bufferView"]), indices.get("byteOffset", 0), count, 1, index_kind, 0)
        rows = _strided(self.view(values["bufferView"]), values.get("byteOffset", 0), count, dense.shape[1], kind, 0)
        if len(places) and places.max() >= len(dense):
            raise SceneError("cannot be read: an element of a sparse accessor lies beyond it")
        made = dense.copy()
        made[places[:, 0]] = rows
        return made

    def image_bytes(self, index: Any) -> tuple[str, io.BytesIO | None]:
        """The file name of an image and None, or a name for messages and the embedded content."""
        image = self.at("images", index)
        uri = image.get("uri", "")
        if uri and not uri.startswith("data:"):
            return uri, None
        content = self.resource(uri, "an image at") if uri else self.view(image["bufferView"])
        return f"{self.sources.path} image {index}", io.BytesIO(content)


def _strided(content: bytes, start: int, count: int, width: int, kind: np.dtype, stride: int) -> NDArray[Any]:
    """Rows of numbers. Deviation: columns of matrices of one-byte and two-byte elements are assumed to be packed."""
    size = kind.itemsize * width
    stride = stride or size
    if start < 0 or stride < size or (count and start + stride * (count - 1) + size > len(content)):
        raise SceneError(f"cannot be read: expected {count} elements of {size} bytes in {len(content)} bytes")
    if not count:
        return np.zeros((0, width), kind)
    rows = np.ndarray((count, width), kind, content, start, (stride, kind.itemsize))
    return rows.copy()
