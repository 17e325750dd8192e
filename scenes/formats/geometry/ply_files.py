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
from scenes.formats.geometry.checked import check_numbers, checked_mesh
from scenes.formats.geometry.ply_headers import Element, Header, header_of
from scenes.formats.geometry.polygons import triangles_of, triangles_of_strips
from scenes.formats.losses import LossReport

UVS = (("u", "v"), ("s", "t"), ("texture_u", "texture_v"), ("texture_s", "texture_t"))
COLOURS = (("red", "green", "blue"), ("r", "g", "b"), ("diffuse_red", "diffuse_green", "diffuse_blue"))
SURFACES = ("face", "tristrips")
_UNSEEN = ("edge",)  # elements that no picture shows


def read_ply(content: bytes, name: str, report: LossReport) -> Mesh:
    """The mesh of a file's content: its faces and its strips of triangles.

    Args:
        content: of the file.
        name: of the file, for messages.
        report: receives the losses.

    Raises:
        SceneError: it is not a PLY file, or does not match its header.
    """
    return read_ply_model(content, name, report).mesh


@dataclass(frozen=True)
class PlyModel:
    """What a file holds.

    Attributes:
        mesh: its faces and its strips of triangles.
        colors: of the vertices ``(v, 3)``, eight bits per channel; None if there are none.
        vertex: all columns of the vertices by name.
        header: of the file.
    """

    mesh: Mesh
    colors: NDArray[np.uint8] | None
    vertex: dict[str, NDArray]
    header: Header


def read_ply_model(content: bytes, name: str, report: LossReport) -> PlyModel:
    """Like :func:`read_ply`, with what the file holds beside its mesh."""
    header = header_of(content, name)
    tables = _tables(header, name, report)
    vertex, colors = tables.get("vertex", {}), None
    for names in COLOURS:
        if colors is None and set(names) <= set(vertex):
            columns = np.stack([vertex[part] for part in names], axis=1)
            colors = eight_bits(columns, header.kind_of("vertex", names[0]))
    return PlyModel(_mesh(tables, name, report), colors, vertex, header)


def eight_bits(values: NDArray, kind: str) -> NDArray[np.uint8]:
    """Colours or opacities of a type of PLY files as eight bits: fractions, or whole numbers of 8 or 16 bits."""
    scale = 255.0 if kind[0] == "f" else 1.0 / 257.0 if kind == "u2" else 1.0
    return np.clip(np.rint(values * scale), 0, 255).astype(np.uint8)


def _tables(header: Header, name: str, report: LossReport) -> dict[str, dict[str, NDArray]]:
    """Columns of each element by name; for faces and strips, their corners."""
    order, body = header.order, header.body
    numbers = _numbers(body, name) if order == "" else None
    tables: dict[str, dict[str, NDArray]] = {}
    at = 0
    for element in header.elements:
        if element.count and element.name not in ("vertex", *SURFACES):
            seen = element.name not in _UNSEEN
            report.add(name, f"{element.count} elements of the kind {element.name!r}", picture=seen)
        if any(kind for _, _, kind in element.properties):
            if numbers is None:
                faces, at = _binary_faces(body, at, element, order, name)
            else:
                faces, at = _ascii_faces(numbers, at, element, name)
            if element.name in SURFACES:
                tables[element.name] = dict(zip(("corners", "counts"), faces, strict=True))
        elif numbers is None:
            tables[element.name], at = _binary_columns(body, at, element, order, name)
        else:
            tables[element.name], at = _ascii_columns(numbers, at, element, name)
    return tables


def _ascii_columns(
    numbers: NDArray[np.float64], at: int, element: Element, name: str
) -> tuple[dict[str, NDArray], int]:
    """Columns of an element without lists, and the start of the next element."""
    width = len(element.properties)
    end = at + element.count * width
    _enough(len(numbers), end, element, name)
    table = numbers[at:end].reshape(element.count, width)
    return {part[0]: table[:, column] for column, part in enumerate(element.properties)}, end


def _binary_columns(
    body: memoryview, at: int, element: Element, order: str, name: str
) -> tuple[dict[str, NDArray], int]:
    """The same for binary rows; columns are views of the content."""
    row = np.dtype([(f"{column}", order + part[1]) for column, part in enumerate(element.properties)])
    end = at + element.count * row.itemsize
    _enough(len(body), end, element, name)
    rows = np.frombuffer(body, row, element.count, at) if element.count else np.zeros(0, row)
    return {part[0]: rows[f"{column}"] for column, part in enumerate(element.properties)}, end


def _enough(there: int, wanted: int, element: Element, name: str) -> None:
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


def _binary_faces(body: memoryview, at: int, element: Element, order: str, name: str) -> tuple[_Polygons, int]:
    """Polygons of faces; fast if all faces have equally many corners, as usual."""
    lists = [part for part in element.properties if part[2]]
    wanted = _indices_of(element, name)
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
    if len(lists) == 1 and 3 <= corners and at + element.count * row(corners).itemsize <= len(body):
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


def _indices_of(element: Element, name: str) -> tuple[str, str, str]:
    """The list of an element that holds its corners; the first list of one that is not a surface.

    Raises:
        SceneError: a surface has no such list.
    """
    lists = [part for part in element.properties if part[2]]
    found = [part for part in lists if part[0].startswith("vertex_ind")]
    if not found and element.name in SURFACES:
        raise SceneError(f"{name}: expected a list of vertex indices in {element.name!r}")
    return (found or lists)[0]


def _ascii_faces(numbers: NDArray[np.float64], at: int, element: Element, name: str) -> tuple[_Polygons, int]:
    """Like :func:`_binary_faces`, for text."""
    if len(element.properties) == 1 and element.count and at < len(numbers):
        corners = numbers[at]
        end = at + element.count * (int(corners) + 1) if 3 <= corners < len(numbers) else len(numbers) + 1
        if end <= len(numbers):
            rows = numbers[at:end].reshape(element.count, -1)
            if (rows[:, 0] == corners).all():
                return _alike(rows[:, 1:]), end
    wanted = _indices_of(element, name)
    sizes = [(1, 1)] * len(element.properties)
    starts, counts, end = _places(element, wanted, at, len(numbers), sizes, lambda _, at: numbers[at], name)
    return _polygons(starts, counts, lambda starts, corners: numbers[starts[:, None] + np.arange(corners)]), end


def _places(
    element: Element,
    wanted: tuple[str, str, str],
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
                if not (0 <= corners <= there and corners == int(corners)):
                    raise SceneError(f"{name}: expected a number of corners, got {corners:g}")
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


def _mesh(tables: dict[str, dict[str, NDArray]], name: str, report: LossReport) -> Mesh:
    vertex = tables.get("vertex", {})
    polygons, strips = tables.get("face"), tables.get("tristrips")
    if not {"x", "y", "z"} <= set(vertex) or polygons is strips is None:
        raise SceneError(f"{name}: expected vertices with x, y and z, and faces")
    points = np.stack([vertex[axis] for axis in "xyz"], axis=1)
    normals = np.stack([vertex[f"n{axis}"] for axis in "xyz"], axis=1) if "nx" in vertex else None
    uvs = next((np.stack([vertex[u], vertex[v]], axis=1) for u, v in UVS if u in vertex and v in vertex), None)
    faces = [np.zeros((0, 3))]
    if polygons is not None:
        faces.append(_triangles(points, polygons["corners"], polygons["counts"], normals, uvs, name, report))
    if strips is not None:
        faces.append(triangles_of_strips(strips["corners"], strips["counts"]))
    return checked_mesh(points, np.concatenate(faces), normals, uvs, name)


def _triangles(
    points: NDArray,
    corners: NDArray,
    counts: NDArray[np.int64],
    normals: NDArray | None,
    uvs: NDArray | None,
    name: str,
    report: LossReport,
) -> NDArray:
    """Indices ``(f, 3)`` of the triangles of polygons."""
    if (counts == 3).all():
        return corners.reshape(-1, 3)
    few = counts < 3
    if few.any():
        report.add(name, f"faces of fewer than three corners ({few.sum()})")
        corners, counts = corners[~np.repeat(few, counts)], counts[~few]
    check_numbers(points, corners, normals, uvs, name)
    triangles = triangles_of(points.astype(np.float64), corners.astype(np.int64), counts)
    if triangles.uncovered:
        what = f"{triangles.uncovered} concave polygons of many corners"
        report.add(name, what, "fans about their first corner")
    return corners[triangles.corners]
