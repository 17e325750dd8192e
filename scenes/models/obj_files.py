"""Reader of OBJ files: one part for each material.

trimesh, which reads STL here, silently drops smoothing groups, images with options, and the texture coordinates of a
material if one of its faces has none.

Source: Wavefront, "OBJ file format" (Advanced Visualizer manual, appendix B1).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from scenes.canonical import Instance, Material, Mesh, Phong, SceneError
from scenes.canonical.values import vertices_of
from scenes.formats.geometry.polygons import triangles_of
from scenes.formats.losses import LossReport
from scenes.loading import decode_srgb
from scenes.models.mtl_files import Entry, entries, material_of
from scenes.models.plain_files import GREY
from scenes.models.smoothing import corner_normals, with_corners
from scenes.models.sources import Sources, joined_lines, text_of
from scenes.models.vertex_colours import coloured

_NAMED = ("usemtl", "mtllib")  # whose names may contain a number sign
_UNREAD = ("curv", "curv2", "surf", "vp", "p", "l", "lod", "shadow_obj", "trace_obj", "call")


@dataclass
class _Group:
    """Polygons of one material: their corners in sequence, the number of corners of each, and smoothing groups."""

    corners: list[str] = field(default_factory=list)
    counts: list[int] = field(default_factory=list)
    smoothing: list[int] = field(default_factory=list)


@dataclass
class _File:
    """The parsed lines of a file."""

    points: list[str] = field(default_factory=list)
    uvs: list[str] = field(default_factory=list)
    normals: list[str] = field(default_factory=list)
    groups: dict[str, _Group] = field(default_factory=dict)
    libraries: list[str] = field(default_factory=list)
    unread: set[str] = field(default_factory=set)
    few: int = 0  # faces of fewer than three corners


def read_obj(sources: Sources, report: LossReport, facets: bool = False) -> tuple[Instance, ...]:
    """One part for each material of an OBJ file, in the order of their first faces; for path tracing with ``facets``.

    Parts without normals have flat faces, except for faces in a smoothing group (``s``), which have smooth normals.
    Colours after the coordinates of vertices are assumed to be sRGB.

    Raises:
        SceneError: the file cannot be read, or an image of its materials.
    """
    stem = sources.path.stem
    file = _parsed(text_of(sources.path))
    for keyword in sorted(file.unread):
        report.add(stem, f"lines of the kind {keyword!r}")
    if file.few:
        report.add(stem, f"faces of fewer than three corners ({file.few})")
    materials = _materials(file, sources, report, facets)
    points = _table(file.points, (3, 4, 6, 7, 8), "v")
    uvs, normals = _table(file.uvs, (1, 2, 3), "vt"), _table(file.normals, (3,), "vn")
    if not np.isfinite(points[:, :3]).all():
        raise SceneError("vertices hold non-finite values")
    parts = []
    for name, group in file.groups.items():
        if name and name not in materials:
            report.add(f"{stem}/{name}", "a material that no library has", "grey")
        where, material = f"{stem}/{name or stem}", materials.get(name, GREY)
        mesh, material = _part(group, points, uvs, normals, material, str(sources.path), where, report)
        if mesh is not None:
            parts.append(Instance(mesh, material, name=where))
    return tuple(parts)


def _parsed(text: str) -> _File:
    file, group, smoothing = _File(), None, 0
    name = ""
    for number, line in enumerate(joined_lines(text).splitlines(), start=1):
        keyword, rest = (*line.split(maxsplit=1), "", "")[:2]
        if "#" in rest and keyword not in _NAMED:
            rest = rest.partition("#")[0]
        if keyword == "v":
            file.points.append(rest)
        elif keyword == "vt":
            file.uvs.append(rest)
        elif keyword == "vn":
            file.normals.append(rest)
        elif keyword in ("f", "fo"):
            corners = rest.split()
            if len(corners) < 3:
                file.few += 1
                continue
            if group is None:
                group = file.groups.setdefault(name, _Group())
            if "-" in rest:
                counts = len(file.points), len(file.uvs), len(file.normals)
                corners = [_absolute(word, counts, number) for word in corners]
            group.corners += corners
            group.counts.append(len(corners))
            group.smoothing.append(smoothing)
        elif keyword == "usemtl":
            name, group = " ".join(rest.split()), None
        elif keyword == "s" and rest:
            word = rest.split()[0]
            smoothing = int(word) if word.isdecimal() else int(word == "on")
        elif keyword == "mtllib":
            file.libraries.append(rest.strip().strip('"'))
        elif keyword in _UNREAD:
            file.unread.add(keyword)
    return file


def _absolute(corner: str, counts: Sequence[int], number: int) -> str:
    """A corner with absolute indices; negative ones are relative to the last line before."""
    parts = corner.split("/")
    try:
        made = [str(int(part) + count + 1) if part[:1] == "-" else part for part, count in zip(parts, counts)]  # noqa: B905
    except ValueError:
        raise SceneError(f"cannot be read: line {number}: expected indices, got {corner!r:.40}") from None
    return "/".join(made)


def _table(rows: list[str], widths: Sequence[int], keyword: str) -> NDArray[np.float64]:
    """Numbers of lines; missing ones are 0."""
    if not rows:
        return np.zeros((0, widths[-1]))
    counts = [len(row.split()) for row in rows]
    if not set(counts) <= set(widths):
        wrong = next(row for row, count in zip(rows, counts, strict=True) if count not in widths)
        raise SceneError(
            f"cannot be read: expected {widths[0]} to {widths[-1]} numbers behind {keyword}, got {wrong!r:.40}"
        )
    width = max(counts)
    filled = (row + " 0" * (width - count) for row, count in zip(rows, counts, strict=True))
    try:
        return np.loadtxt(filled, np.float64, ndmin=2, comments=None)
    except ValueError as error:
        raise SceneError(f"cannot be read: {error}") from None


def _materials(file: _File, sources: Sources, report: LossReport, facets: bool) -> dict[str, Material]:
    """Materials of all libraries that faces have; of several with one name the first is used."""
    found: dict[str, Entry] = {}
    for line in file.libraries:
        # a name may contain spaces, and a line several names
        names = [line] if sources.find(line) is not None else line.split() or [line]
        for name in names:
            path = sources.known(name, sources.path.stem, report, "the materials")
            found = entries("" if path is None else text_of(path)) | found
    return {name: _material(name, found[name], sources, report, facets) for name in file.groups if name in found}


def _material(name: str, entry: Entry, sources: Sources, report: LossReport, facets: bool) -> Material:
    try:
        return material_of(name, entry, sources, report, facets)
    except SceneError as error:
        raise SceneError(f"material {name}: {error}") from None


def _part(
    group: _Group,
    points: NDArray[np.float64],
    uvs: NDArray[np.float64],
    normals: NDArray[np.float64],
    material: Material,
    source: str,
    where: str,
    report: LossReport,
) -> tuple[Mesh | None, Material]:
    """The triangles of a group."""
    index = _indices(group, (len(points), len(uvs), len(normals)))
    triangles = triangles_of(points[:, :3], index[:, 0], np.asarray(group.counts, np.int64))
    if triangles.uncovered:
        report.add(where, f"{triangles.uncovered} concave polygons of many corners", "fans about their first corner")
    faces = triangles.corners
    if not len(faces):
        return None, material
    at, texture, normal = (index[faces, column] for column in range(3))
    corners = points[at][..., :3]
    shading = _shading(corners, normal, normals, np.asarray(group.smoothing)[triangles.polygon])
    coordinates = uvs[texture][..., :2] if len(uvs) and (texture >= 0).any() else None
    if coordinates is not None:
        if coordinates.shape[-1] < 2:
            coordinates = np.concatenate([coordinates, np.zeros_like(coordinates)], axis=-1)
        coordinates = np.where((texture >= 0)[..., None], coordinates, 0.0).astype(np.float32)
    baked = None
    if points.shape[1] >= 6 and material is GREY:
        made, baked = coloured(decode_srgb(_eight_bits(points[:, 3:6]))[at], source)
        material, coordinates = Phong(made), coordinates if baked is None else baked
    if shading is None and coordinates is None:
        used, place = np.unique(at, return_inverse=True)
        return Mesh(vertices_of(points[used, :3]), place.reshape(-1, 3).astype(np.int32), source=source), material
    given = (texture >= 0).all() or coordinates is None
    keys = (at * (len(uvs) + 1) + texture + 1) * (len(normals) + 1) + normal + 1
    alike = given and baked is None and (shading is None or bool((normal >= 0).all()))
    return with_corners(corners, shading, coordinates, source, keys if alike else None), material


def _eight_bits(colors: NDArray[np.float64]) -> NDArray[np.uint8]:
    scale = 255.0 if colors.max() <= 1.0 else 1.0
    return np.clip(np.rint(colors * scale), 0, 255).astype(np.uint8)


def _indices(group: _Group, counts: Sequence[int]) -> NDArray[np.int64]:
    """Indices of point, texture coordinates and normal of each corner, from 0; -1 for none.

    Raises:
        SceneError: an index is not a number or out of range.
    """
    place = {corner: number for number, corner in enumerate(dict.fromkeys(group.corners))}
    fields = ((*corner.split("/"), "", "")[:3] for corner in place)
    try:
        rows = np.array([[int(part) - 1 if part else -1 for part in parts] for parts in fields], np.int64)
    except (ValueError, OverflowError) as error:
        raise SceneError(
            f"cannot be read: expected indices of a corner, got {str(error).rpartition(': ')[2]}"
        ) from None
    wrong = (rows[:, 0] < 0) | (rows < -1).any(axis=1) | (rows >= counts).any(axis=1)
    if wrong.any():
        corner = list(place)[int(np.argmax(wrong))]
        raise SceneError(f"cannot be read: a face refers to {corner!r:.40}, of {counts[0]} vertices")
    return rows[[place[corner] for corner in group.corners]]


def _shading(
    corners: NDArray[np.float64], normal: NDArray[np.int64], normals: NDArray[np.float64], smoothing: NDArray[np.int64]
) -> NDArray[np.float32] | None:
    """Normals ``(f, 3, 3)`` at the corners; None if all faces are flat."""
    given = normal >= 0
    if not given.any() and not smoothing.any():
        return None
    if not len(normals):
        return corner_normals(corners, groups=smoothing)
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    unit = (normals / np.where(length > 0.0, length, 1.0)).astype(np.float32)
    usable = given & (length[:, 0] > 0.0)[normal]
    if usable.all():
        return unit[normal]
    return np.where(usable[..., None], unit[normal], corner_normals(corners, groups=smoothing))
