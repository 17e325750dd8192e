"""Reader of PLY meshes from untrusted files.

The mesh library also reads PLY, but it allocates memory by the header's counts and adds normals if a file has none.
Here counts are first compared with the length of the file, and no normals are added.

Source: G. Turk, "The PLY Polygon File Format" (1994).
"""

from __future__ import annotations

import struct
import warnings
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scenes.canonical import Mesh, SceneError
from scenes.canonical.values import vertices_of
from scenes.formats.geometry.polygons import triangles_of

_TYPES = {
    "char": "i1", "int8": "i1", "uchar": "u1", "uint8": "u1", "short": "i2", "int16": "i2", "ushort": "u2",
    "uint16": "u2", "int": "i4", "int32": "i4", "uint": "u4", "uint32": "u4", "float": "f4", "float32": "f4",
    "double": "f8", "float64": "f8",
}  # fmt: skip
_ORDERS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}
_UVS = (("u", "v"), ("s", "t"), ("texture_u", "texture_v"), ("texture_s", "texture_t"))
_COLOURS = (("red", "green", "blue"), ("r", "g", "b"), ("diffuse_red", "diffuse_green", "diffuse_blue"))
_CORNERS_MAX = 64


@dataclass(frozen=True)
class _Element:
    name: str
    count: int
    properties: tuple[tuple[str, str, str], ...]  # name, type, and type of the count for lists


def read_ply(content: bytes, name: str) -> Mesh:
    """The mesh of a file's content.

    Raises:
        SceneError: it is not a PLY file, or does not match its header.
    """
    return read_coloured_ply(content, name)[0]


def read_coloured_ply(content: bytes, name: str) -> tuple[Mesh, NDArray[np.uint8] | None]:
    """Like :func:`read_ply`, with the colours ``(v, 3)`` of the vertices, eight bits per channel, if there are any."""
    tables = _tables(content, name)
    vertex, colors = tables.get("vertex", {}), None
    for names in _COLOURS:
        if colors is None and set(names) <= set(vertex):
            kinds = {part[0]: part[1] for element in _header(content, name)[1] for part in element.properties}
            columns = np.stack([vertex[part] for part in names], axis=1)
            scale = 255.0 if kinds[names[0]][0] == "f" else 1.0 / 257.0 if kinds[names[0]] == "u2" else 1.0
            colors = np.clip(np.rint(columns * scale), 0, 255).astype(np.uint8)
    return _mesh(tables, name), colors


def _tables(content: bytes, name: str) -> dict[str, dict[str, NDArray]]:
    """Columns of each element by name; for faces, their corners."""
    order, elements, body = _header(content, name)
    numbers = _numbers(body, name) if order == "" else None
    tables: dict[str, dict[str, NDArray]] = {}
    at = 0
    for element in elements:
        if any(kind for _, _, kind in element.properties):
            if element.name != "face":
                raise SceneError(f"{name}: expected lists in faces only, got some in {element.name!r}")
            if numbers is None:
                faces, at = _binary_faces(body, at, element, order, name)
            else:
                faces, at = _ascii_faces(numbers, at, element, name)
            tables["face"] = dict(zip(("corners", "counts"), faces, strict=True))
        elif numbers is None:
            tables[element.name], at = _binary_columns(body, at, element, order, name)
        else:
            tables[element.name], at = _ascii_columns(numbers, at, element, name)
    return tables


def _header(content: bytes, name: str) -> tuple[str, list[_Element], memoryview]:
    end = content.find(b"end_header", 0, 1 << 16)
    newline = content.find(b"\n", end)
    if not content.startswith(b"ply") or end < 0 or newline < 0:
        raise SceneError(f"{name}: expected a PLY file, got {content[:8]!r}")
    order, elements = None, []
    for line in content[:end].decode("ascii", "replace").splitlines()[1:]:
        parts = line.split()
        if not parts or parts[0] in ("comment", "obj_info"):
            continue
        if parts[0] == "format" and len(parts) == 3 and parts[1] in _ORDERS:
            order = _ORDERS[parts[1]]
        elif parts[0] == "element" and len(parts) == 3 and parts[2].isdecimal():
            elements.append(_Element(parts[1], int(parts[2]), ()))
        elif parts[0] == "property" and elements and len(parts) == 3 and parts[1] in _TYPES:
            elements[-1] = _with(elements[-1], (parts[2], _TYPES[parts[1]], ""))
        elif parts[0] == "property" and elements and len(parts) == 5 and {parts[2], parts[3]} <= set(_TYPES):
            elements[-1] = _with(elements[-1], (parts[4], _TYPES[parts[3]], _TYPES[parts[2]]))
        else:
            raise SceneError(f"{name}: expected a line of a PLY header, got {line[:40]!r}")
    if order is None:
        raise SceneError(f"{name}: expected a format in the PLY header, got none")
    return order, elements, memoryview(content)[newline + 1 :]


def _with(element: _Element, added: tuple[str, str, str]) -> _Element:
    return _Element(element.name, element.count, (*element.properties, added))


def _ascii_columns(
    numbers: NDArray[np.float64], at: int, element: _Element, name: str
) -> tuple[dict[str, NDArray], int]:
    """Columns of an element without lists, and the start of the next element."""
    width = len(element.properties)
    end = at + element.count * width
    _enough(len(numbers), end, element, name)
    table = numbers[at:end].reshape(element.count, width)
    return {part[0]: table[:, column] for column, part in enumerate(element.properties)}, end


def _binary_columns(
    body: memoryview, at: int, element: _Element, order: str, name: str
) -> tuple[dict[str, NDArray], int]:
    """The same for binary rows; columns are views of the content."""
    row = np.dtype([(f"{column}", order + part[1]) for column, part in enumerate(element.properties)])
    end = at + element.count * row.itemsize
    _enough(len(body), end, element, name)
    rows = np.frombuffer(body, row, element.count, at) if element.count else np.zeros(0, row)
    return {part[0]: rows[f"{column}"] for column, part in enumerate(element.properties)}, end


def _enough(there: int, wanted: int, element: _Element, name: str) -> None:
    if wanted > there:
        raise SceneError(f"{name}: expected {element.count} of {element.name!r} as its header says, got fewer")


def _numbers(body: memoryview, name: str) -> NDArray[np.float64]:
    """All numbers of a text; raises SceneError if it contains anything else."""
    text = body.tobytes().strip()
    if not text:
        return np.zeros(0)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        try:
            return np.fromstring(text, dtype=np.float64, sep=" ")
        except (DeprecationWarning, ValueError):
            raise SceneError(f"{name}: expected numbers behind the PLY header") from None


def _binary_faces(body: memoryview, at: int, element: _Element, order: str, name: str) -> tuple[_Polygons, int]:
    """Polygons of faces; fast if all faces have equally many corners, as usual."""
    lists = [part for part in element.properties if part[2]]
    wanted = next((part for part in lists if part[0].startswith("vertex_ind")), None)
    if wanted is None:
        raise SceneError(f"{name}: expected a list of vertex indices in faces")
    if element.count == 0:
        return (np.zeros(0), np.zeros(0, np.int64)), at
    position = element.properties.index(wanted)
    before = np.dtype([(f"{n}", order + part[1]) for n, part in enumerate(element.properties[:position])]).itemsize
    counter = np.dtype(order + wanted[2])
    _enough(len(body), at + before + counter.itemsize, element, name)

    def row(corners: int) -> np.dtype:
        fields: list[tuple] = []
        for number, (_, kind, count_kind) in enumerate(element.properties):
            if count_kind:
                fields += [("count", order + count_kind), ("corners", order + kind, (corners,))]
            else:
                fields.append((f"{number}", order + kind))
        return np.dtype(fields)

    corners = int(np.frombuffer(body, counter, 1, at + before)[0])
    if len(lists) == 1 and 3 <= corners <= _CORNERS_MAX and at + element.count * row(corners).itemsize <= len(body):
        rows = np.frombuffer(body, row(corners), element.count, at)
        if (rows["count"] == corners).all():
            return _alike(rows["corners"]), at + element.count * row(corners).itemsize
    heads = [struct.Struct(order + np.dtype(part[2] or part[1]).char) for part in element.properties]
    sizes = [(head.size, np.dtype(part[1]).itemsize) for head, part in zip(heads, element.properties, strict=True)]
    places = _places(element, wanted, at, len(body), sizes, lambda n, at: heads[n].unpack_from(body, at)[0], name)
    content, kind = np.frombuffer(body, np.uint8), np.dtype(order + wanted[1])

    def rings(starts: NDArray[np.int64], corners: int) -> NDArray:
        return content[starts[:, None] + np.arange(corners * kind.itemsize)].view(kind)

    return _polygons(*places[:2], rings), places[2]


def _ascii_faces(numbers: NDArray[np.float64], at: int, element: _Element, name: str) -> tuple[_Polygons, int]:
    """Like :func:`_binary_faces`, for text."""
    if len(element.properties) == 1 and element.count and at < len(numbers):
        corners = numbers[at]
        end = at + element.count * (int(corners) + 1) if 3 <= corners <= _CORNERS_MAX else len(numbers) + 1
        if end <= len(numbers):
            rows = numbers[at:end].reshape(element.count, -1)
            if (rows[:, 0] == corners).all():
                return _alike(rows[:, 1:]), end
    wanted = next((part for part in element.properties if part[2] and part[0].startswith("vertex_ind")), None)
    sizes = [(1, 1)] * len(element.properties)
    starts, counts, end = _places(element, wanted, at, len(numbers), sizes, lambda _, at: numbers[at], name)
    return _polygons(starts, counts, lambda starts, corners: numbers[starts[:, None] + np.arange(corners)]), end


def _places(
    element: _Element,
    wanted: tuple[str, str, str] | None,
    at: int,
    there: int,
    sizes: list[tuple[int, int]],
    count_at: Callable[[int, int], float],
    name: str,
) -> tuple[NDArray[np.int64], NDArray[np.int64], int]:
    """Start of the wanted list of each face, its number of corners, and the start of the next element."""
    starts, counts = [], []
    for _ in range(element.count):
        for number, part in enumerate(element.properties):
            corners, (head, size) = 1, sizes[number]
            if part[2]:
                _enough(there, at + head, element, name)
                corners = count_at(number, at)
                if not ((3 if part is wanted else 0) <= corners <= _CORNERS_MAX and corners == int(corners)):
                    raise SceneError(f"{name}: expected faces of 3 to {_CORNERS_MAX} corners, got {corners:g}")
                at += head
                if part is wanted:
                    starts.append(at)
                    counts.append(corners)
            at += int(corners) * size
    _enough(there, at, element, name)
    return np.array(starts, np.int64), np.array(counts, np.int64), at


_Polygons = tuple[NDArray, NDArray[np.int64]]
"""Indices of the vertices of all corners, and the number of corners of each polygon."""


def _polygons(
    starts: NDArray[np.int64], counts: NDArray[np.int64], rings: Callable[[NDArray[np.int64], int], NDArray]
) -> _Polygons:
    """Polygons in their order; those with equally many corners are read together."""
    corners = np.zeros(int(counts.sum()))
    places = np.cumsum(counts) - counts
    for count in np.unique(counts).tolist():
        here = np.flatnonzero(counts == count)
        corners[places[here, None] + np.arange(count)] = rings(starts[here], count)
    return corners, counts


def _alike(rings: NDArray) -> _Polygons:
    """Polygons ``(n, corners)`` with equally many corners."""
    return rings.ravel(), np.full(len(rings), rings.shape[1])


def _mesh(tables: dict[str, dict[str, NDArray]], name: str) -> Mesh:
    vertex, face = tables.get("vertex", {}), tables.get("face", {})
    if not {"x", "y", "z"} <= set(vertex) or "corners" not in face:
        raise SceneError(f"{name}: expected vertices with x, y and z, and faces")
    points = np.stack([vertex[axis] for axis in "xyz"], axis=1)
    normals = np.stack([vertex[f"n{axis}"] for axis in "xyz"], axis=1) if "nx" in vertex else None
    uvs = next((np.stack([vertex[u], vertex[v]], axis=1) for u, v in _UVS if u in vertex and v in vertex), None)
    corners, counts = face["corners"], face["counts"]
    if (counts == 3).all():
        return checked_mesh(points, corners.reshape(-1, 3), normals, uvs, name)
    _check_numbers(points, corners, normals, uvs, name)
    triangles = triangles_of(points.astype(np.float64), corners.astype(np.int64), counts)
    if triangles.uncovered:
        warnings.warn(f"{name}: {triangles.uncovered} concave polygons are fans about their first corner", stacklevel=2)
    return checked_mesh(points, corners[triangles.corners], normals, uvs, name)


def checked_mesh(points: NDArray, faces: NDArray, normals: NDArray | None, uvs: NDArray | None, name: str) -> Mesh:
    """A mesh of numbers from a file.

    Raises:
        SceneError: a number is not finite or too great, an index is invalid, or there is no face.
    """
    _check_numbers(points, faces, normals, uvs, name)
    unit = None
    if normals is not None:
        lengths = np.linalg.norm(normals, axis=1, keepdims=True)
        unit = np.where(lengths > 1e-20, normals / np.maximum(lengths, 1e-20), (0.0, 0.0, 1.0)).astype(np.float32)
    return Mesh(
        vertices_of(points),
        faces.astype(np.int32).reshape(-1, 3),
        unit,
        None if uvs is None else uvs.astype(np.float32),
        name,
    )


def _check_numbers(points: NDArray, faces: NDArray, normals: NDArray | None, uvs: NDArray | None, name: str) -> None:
    for what, array in (("vertices", points), ("normals", normals), ("texture coordinates", uvs)):
        if array is not None and not (np.abs(array) < 1e30).all():
            raise SceneError(f"{name}: expected finite {what}")
    if len(faces) and not ((faces >= 0) & (faces < len(points))).all():
        raise SceneError(f"{name}: expected indices below {len(points)}, got {faces.max():g}")
