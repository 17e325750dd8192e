"""The container of a glTF 2.0 file: its JSON, its buffers, and the values of its accessors.

trimesh, which reads STL here, drops sparse accessors, samplers, texture transforms and all but the first texture
coordinates; pygltflib reads only the JSON and leaves accessors to its callers.

Source: Khronos Group, "glTF 2.0 specification", sections 3.6 (buffers, views, accessors) and 4 (GLB).
"""

from __future__ import annotations

import base64
import io
import json
import struct
from typing import Any
from urllib.parse import unquote_to_bytes

import numpy as np
from numpy.typing import NDArray

from scenes.canonical import SceneError
from scenes.models.gltf_records import COMPONENTS, WHOLE, WIDTHS, Records
from scenes.models.json_records import described, misplaced, require
from scenes.models.sources import Sources

_GLB, _JSON, _BIN = 0x46546C67, 0x4E4F534A, 0x004E4942
_COUNT_MAX, _ZEROS_MAX = 1 << 28, 1 << 22
_WHOLE_MAX = float(1 << 53)


class GltfData:
    """A glTF or GLB file.

    Attributes:
        json: parsed JSON object; whole numbers are ``int``, and null is absent.
        records: what its objects must be.
    """

    def __init__(self, sources: Sources) -> None:
        """Reads the file.

        Raises:
            SceneError: it is not a glTF 2 file, or one of its values is not what the format has there.
        """
        self.sources = sources
        content = sources.path.read_bytes()
        self._glb_buffer: bytes | None = None
        text = self._chunks(content) if content[:4] == b"glTF" else content
        self.json: dict[str, Any] = _parsed(text)
        asset = self.json.get("asset") if isinstance(self.json, dict) else None
        version = asset.get("version", "") if isinstance(asset, dict) else ""
        if not (isinstance(version, str) and version.startswith("2.")):
            got = version if isinstance(version, str) else described(version)
            raise SceneError(f"cannot be read: asset.version: expected glTF 2, got version {got or 'none'}")
        require(self.json, WHOLE)
        self.records = Records(self.json)
        self._checked: set[tuple[str, int]] = set()
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

    def at(self, name: str, index: int) -> dict[str, Any]:
        """An object of such a list, whose index was checked; the object is checked at its first use.

        Raises:
            SceneError: one of its values is not what the format has there.
        """
        found = self.items(name)[index]
        if (name, index) not in self._checked:
            require(found, self.records.of[name], f"{name}[{index}]")
            self._checked.add((name, index))
        return found

    def resource(self, uri: str, place: str, what: str) -> bytes:
        """The bytes of a URI: embedded data, or a file beside it."""
        if uri.startswith("data:"):
            kind, _, data = uri.partition(",")
            if not kind.endswith(";base64"):  # escapes, which RFC 2397 has in its place
                return unquote_to_bytes(data)
            try:
                return base64.b64decode(data)
            except ValueError:
                raise SceneError(f"cannot be read: {place}.uri: expected data in base64") from None
        return self.sources.require(uri, what).read_bytes()

    def view(self, index: int) -> bytes:
        """The bytes of a buffer view."""
        view = self.at("bufferViews", index)
        number = view["buffer"]
        if number not in self._buffers:
            buffer = self.at("buffers", number)
            uri, place = buffer.get("uri"), f"buffers[{number}]"
            whole = self._glb_buffer if uri is None else self.resource(uri, place, "a buffer at")
            self._buffers[number] = whole if whole is not None else b""
        start, length = view.get("byteOffset", 0), view["byteLength"]
        found = self._buffers[number][start : start + length]
        if len(found) < length:
            raise misplaced(f"bufferViews[{index}]", f"{length} bytes of buffer {number} at {start}", len(found))
        return found

    def indices(self, index: int, of: str) -> NDArray[np.int64]:
        """The elements ``(count, width)`` of an accessor of whole numbers; other arguments are as for :meth:`numbers`.

        Raises:
            SceneError: they are not whole.
        """
        if COMPONENTS[self.at("accessors", index)["componentType"]][1] != "u":
            got = self.at("accessors", index)["componentType"]
            raise misplaced(f"accessors[{index}].componentType", f"5121, 5123 or 5125 for {of}", got)
        return self.numbers(index, of, ("VEC4",) if of.startswith("JOINTS") else ("SCALAR",)).astype(np.int64)

    def numbers(self, index: int, of: str, types: tuple[str, ...], finite: bool = True) -> NDArray[np.float64]:
        """The elements ``(count, width)`` of an accessor; normalised integers are converted to fractions.

        Args:
            index: index of the accessor.
            of: what the elements are, for messages.
            types: types that the accessor may have.
            finite: whether elements that are not finite are an error.

        Raises:
            SceneError: the accessor has another type, too many elements, or refers beyond its buffer.
        """
        accessor, place = self.at("accessors", index), f"accessors[{index}]"
        if accessor["type"] not in types:
            raise misplaced(f"{place}.type", f"{' or '.join(types)} for {of}", accessor["type"])
        found = self._elements(accessor, place)
        if finite and not np.isfinite(found).all():
            raise misplaced(place, f"finite numbers for {of}", found[~np.isfinite(found)][0])
        return found

    def _elements(self, accessor: dict[str, Any], place: str) -> NDArray[np.float64]:
        width, kind = WIDTHS[accessor["type"]], np.dtype(COMPONENTS[accessor["componentType"]])
        count, most = accessor["count"], _COUNT_MAX if "bufferView" in accessor else _ZEROS_MAX
        if count > most:
            raise misplaced(f"{place}.count", f"at most {most} elements", count)
        if "bufferView" in accessor:
            view = self.at("bufferViews", accessor["bufferView"])
            start, stride = accessor.get("byteOffset", 0), view.get("byteStride", 0)
            found = _strided(self.view(accessor["bufferView"]), start, count, width, kind, stride, place)
        else:
            found = np.zeros((count, width), kind)
        if "sparse" in accessor:
            found = self._replaced(found, accessor["sparse"], kind, f"{place}.sparse")
        if not accessor.get("normalized", False):
            return found.astype(np.float64)
        most = float(np.iinfo(kind).max) if kind.kind in "iu" else 1.0
        return np.maximum(found.astype(np.float64) / most, -1.0)

    def _replaced(self, dense: NDArray[Any], sparse: dict[str, Any], kind: np.dtype, place: str) -> NDArray[Any]:
        """Elements with those of a sparse accessor replaced."""
        count, indices, values = sparse["count"], sparse["indices"], sparse["values"]
        index_kind = np.dtype(COMPONENTS[indices["componentType"]])
        starts = [part.get("byteOffset", 0) for part in (indices, values)]
        at = _strided(self.view(indices["bufferView"]), starts[0], count, 1, index_kind, 0, f"{place}.indices")
        rows = _strided(self.view(values["bufferView"]), starts[1], count, dense.shape[1], kind, 0, f"{place}.values")
        if len(at) and not (at >= 0).all() & (at < len(dense)).all():
            raise misplaced(f"{place}.indices", f"indices from 0 to {len(dense) - 1}", f"{at.min():g} to {at.max():g}")
        made = dense.copy()
        made[at[:, 0].astype(np.int64)] = rows
        return made

    def image_file(self, index: int) -> str:
        """The file name of an image; empty if it is embedded."""
        uri = self.at("images", index).get("uri", "")
        return "" if uri.startswith("data:") else uri

    def image_bytes(self, index: int) -> tuple[str, io.BytesIO | None]:
        """The file name of an image and None, or a name for messages and the embedded content."""
        name, image = self.image_file(index), self.at("images", index)
        if name:
            return name, None
        uri = image.get("uri", "")
        if not uri and "bufferView" not in image:
            raise misplaced(f"images[{index}]", "a uri or a bufferView", "none")
        content = self.resource(uri, f"images[{index}]", "an image at") if uri else self.view(image["bufferView"])
        return f"{self.sources.path} image {index}", io.BytesIO(content)


def _strided(
    content: bytes, start: int, count: int, width: int, kind: np.dtype, stride: int, place: str
) -> NDArray[Any]:
    """Rows of numbers. Deviation: columns of matrices of one-byte and two-byte elements are assumed to be packed."""
    size = kind.itemsize * width
    stride = stride or size
    if stride < size or (count and start + stride * (count - 1) + size > len(content)):
        apart = f" every {stride}" if stride != size else ""
        raise misplaced(place, f"{count} elements of {size} bytes{apart} at {start}", f"{len(content)} bytes")
    if not count:
        return np.zeros((0, width), kind)
    rows = np.ndarray((count, width), kind, content, start, (stride, kind.itemsize))
    return rows.copy()


def _number(text: str) -> float:
    """A number; ``4.0`` is a whole one, as in the JSON schema of the format, and ``-0.0`` keeps its sign."""
    value = float(text)
    return int(value) if value.is_integer() and abs(value) < _WHOLE_MAX and (value or text[0] != "-") else value


def _given(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    """An object without the properties that are null."""
    return {name: value for name, value in pairs if value is not None}


def _parsed(content: bytes) -> Any:
    try:
        return json.loads(content.decode("utf-8-sig"), parse_float=_number, object_pairs_hook=_given)
    except json.JSONDecodeError as error:
        where = f"line {error.lineno}, column {error.colno}"
        raise SceneError(f"cannot be read: {where}: expected JSON ({error.msg})") from None
    except UnicodeDecodeError as error:
        raise SceneError(f"cannot be read: byte {error.start}: expected JSON in UTF-8") from None
    except ValueError:
        raise SceneError("cannot be read: expected JSON with numbers of less than 4300 digits") from None
    except RecursionError:
        raise SceneError("cannot be read: expected JSON, got too many lists or objects within each other") from None
