"""Building blocks of procedural meshes: grids, lathes, boxes, smooth normals, joining."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from scenes.arithmetic import arccos, arctan2, cos, norm, product, sin
from scenes.canonical import Mesh

Array = NDArray[np.float64]
Indices = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class SurfaceMesh:
    """A triangle mesh under construction, in double precision.

    Attributes:
        vertices: ``(v, 3)`` metres.
        faces: ``(f, 3)``, counter-clockwise seen from outside.
        normals: ``(v, 3)`` unit shading normals.
        uvs: ``(v, 2)``.
    """

    vertices: Array
    faces: Indices
    normals: Array
    uvs: Array

    def mesh(self, source: str) -> Mesh:
        """The surface as a canonical mesh, without degenerate triangles and unused vertices."""
        # after rounding: single precision makes some more triangles degenerate
        vertices = self.vertices.astype(np.float32).astype(np.float64)
        a, b, c = (vertices[self.faces[:, corner]] for corner in range(3))
        area = 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1)
        longest = np.max([np.linalg.norm(p - q, axis=1) for p, q in ((a, b), (b, c), (c, a))], axis=0)
        faces = self.faces[area > 1e-5 * longest**2 + 1e-12]
        slim = replace(self, faces=faces).compact()
        return Mesh(
            vertices=slim.vertices.astype(np.float32),
            faces=slim.faces.astype(np.int32),
            normals=slim.normals.astype(np.float32),
            uvs=slim.uvs.astype(np.float32),
            source=source,
        )

    def compact(self) -> SurfaceMesh:
        """The surface without unused vertices."""
        used = np.zeros(len(self.vertices), bool)
        used[self.faces] = True
        faces = (np.cumsum(used) - 1)[self.faces]
        return SurfaceMesh(self.vertices[used], faces, self.normals[used], self.uvs[used])


def unit(vectors: Array) -> Array:
    """Rows scaled to unit length; zero rows become ``+z``."""
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return np.where(length > 1e-12, vectors / np.maximum(length, 1e-12), np.array([0.0, 0.0, 1.0]))


def smooth_normals(vertices: Array, faces: Indices, weld_m: float = 1e-6, piece: Indices | None = None) -> Array:
    """Normals averaged over the faces around each point, weighted by angle; coincident vertices share normals.

    Args:
        vertices: ``(v, 3)``.
        faces: ``(f, 3)``.
        weld_m: vertices closer than about this count as one point.
        piece: ``(v,)`` number of the piece of each vertex; vertices of different pieces share no normals.
    """
    place = _places(np.round(vertices / weld_m).astype(np.int64), piece)
    sums = np.zeros((place.max() + 1, 3))
    corners = vertices[faces]
    face_normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    proper = np.linalg.norm(face_normal, axis=1) > 1e-12
    face_normal = unit(face_normal)
    for corner in range(3):
        ahead = unit(corners[:, (corner + 1) % 3] - corners[:, corner])
        behind = unit(corners[:, (corner + 2) % 3] - corners[:, corner])
        angle = arccos(np.clip((ahead * behind).sum(axis=1), -1.0, 1.0)) * proper
        np.add.at(sums, place[faces[:, corner]], face_normal * angle[:, None])
    return unit(sums[place])


def _places(cells: Indices, piece: Indices | None) -> Indices:
    """Numbers ``(v,)`` that are equal where the rows of ``cells``, ``(v, 3)``, and the pieces are equal."""
    keys = np.array([*cells.T, *([] if piece is None else [piece])])
    order = np.lexsort(keys)
    fresh = (keys[:, order[1:]] != keys[:, order[:-1]]).any(axis=0)
    place = np.empty(len(order), np.int64)
    place[order] = np.concatenate([[0], np.cumsum(fresh)])
    return place


def from_faces(vertices: Array, faces: Indices, uvs: Array | None = None) -> SurfaceMesh:
    """A smooth surface from bare triangles."""
    vertices = np.asarray(vertices, np.float64)
    faces = np.asarray(faces, np.int64)
    uvs = np.zeros((len(vertices), 2)) if uvs is None else np.asarray(uvs, np.float64)
    return SurfaceMesh(vertices, faces, smooth_normals(vertices, faces), uvs)


def flat(surface: SurfaceMesh) -> SurfaceMesh:
    """The surface with separate triangles, each with its face normal."""
    vertices = surface.vertices[surface.faces].reshape(-1, 3)
    a, b, c = vertices[0::3], vertices[1::3], vertices[2::3]
    normals = np.repeat(unit(np.cross(b - a, c - a)), 3, axis=0)
    faces = np.arange(len(vertices)).reshape(-1, 3)
    return SurfaceMesh(vertices, faces, normals, surface.uvs[surface.faces].reshape(-1, 2))


def grid(points: Array) -> SurfaceMesh:
    """A surface through a grid of points.

    Args:
        points: ``(m, n, 3)``; the outside is where ``∂/∂m × ∂/∂n`` points. uv runs from 0 to 1 along ``(m, n)``.
    """
    return grids(points[None])


def grids(nets: Array) -> SurfaceMesh:
    """Surfaces through grids ``(k, m, n, 3)`` as in :func:`grid`, joined with sharp edges between them."""
    count, rows, columns = nets.shape[:3]
    index = np.arange(count * rows * columns).reshape(count, rows, columns)
    a, b, c, d = index[:, :-1, :-1], index[:, 1:, :-1], index[:, 1:, 1:], index[:, :-1, 1:]
    halves = [np.stack(corners, -1).reshape(count, -1, 3) for corners in ((a, b, c), (a, c, d))]
    vertices, faces = np.asarray(nets, np.float64).reshape(-1, 3), np.concatenate(halves, axis=1).reshape(-1, 3)
    u, v = np.meshgrid(np.linspace(0.0, 1.0, rows), np.linspace(0.0, 1.0, columns), indexing="ij")
    uvs = np.tile(np.stack([u, v], -1).reshape(-1, 2), (count, 1))
    piece = np.repeat(np.arange(count), rows * columns)
    return SurfaceMesh(vertices, faces, smooth_normals(vertices, faces, piece=piece), uvs)


def lathe(profile: Array, segments: int, crease_deg: float = 35.0) -> SurfaceMesh:
    """The surface of revolution of a profile about the y axis.

    Args:
        profile: ``(n, 2)`` points (radius, y); the outside lies to the right of the profile's direction in the plane
            with the radius to the right and y up.
        segments: number of segments around the axis.
        crease_deg: corners of the profile sharper than this stay sharp.
    """
    turn = np.linspace(0.0, 2.0 * np.pi, segments + 1)
    heading = np.unwrap(arctan2(*np.diff(profile, axis=0).T[::-1]))
    sharp = np.flatnonzero(np.abs(np.diff(heading)) > np.radians(crease_deg)) + 1
    strips = []
    for begin, end in zip([0, *sharp], [*sharp, len(profile) - 1], strict=True):
        part = profile[begin : end + 1]
        ring = np.stack([sin(turn), np.zeros_like(turn), cos(turn)], -1)
        points = part[None, :, :1] * ring[:, None] + part[None, :, 1:] * np.array([0.0, 1.0, 0.0])
        strips.append(grid(points))
    return join(strips)


def box(lower: Sequence[float], upper: Sequence[float]) -> SurfaceMesh:
    """An axis-aligned box with flat faces; uv in metres along the faces."""
    return boxes([(lower, upper)])


def boxes(spans: Sequence[tuple[Sequence[float], Sequence[float]]]) -> SurfaceMesh:
    """Boxes by their lower and upper corners, joined: like :func:`box`, but all at once."""
    ends = np.asarray(spans, np.float64)
    corners = np.empty((len(ends), 3, 2, 2, 2, 3))  # box, axis, side, net
    for axis in range(3):
        u, v = (axis + 1) % 3, (axis + 2) % 3
        net = corners[:, axis]
        net[..., axis] = ends[:, :, None, None, axis]
        net[..., u], net[..., v] = ends[:, None, :, None, u], ends[:, None, None, :, v]
        net[:, 0] = net[:, 0].transpose(0, 2, 1, 3).copy()  # reversed: the lower side faces down the axis
    sheets = grids(corners.reshape(-1, 2, 2, 3))
    # u is always the horizontal axis of a wall and v its height
    uvs = np.stack([corners[:, axis][..., pair] for axis, pair in enumerate(([1, 2], [0, 2], [0, 1]))], axis=1)
    return replace(sheets, uvs=uvs.reshape(-1, 2))


def extrude(outline: Array, lower: float, upper: float) -> SurfaceMesh:
    """A convex polygon ``(n, 2)``, counter-clockwise, raised from ``z = lower`` to ``upper``; flat sides and caps."""
    count = len(outline)
    ring = np.arange(count)
    after = (ring + 1) % count
    vertices = np.concatenate([np.column_stack([outline, np.full(count, z)]) for z in (lower, upper)])
    walls = np.concatenate(
        [np.stack([ring, after, after + count], -1), np.stack([ring, after + count, ring + count], -1)]
    )
    fan = np.stack([np.zeros(count - 2, np.int64), np.arange(1, count - 1), np.arange(2, count)], -1)
    return flat(from_faces(vertices, np.concatenate([walls, fan + count, fan[:, ::-1]])))


def tube(
    start: Sequence[float], end: Sequence[float], radius: float, end_radius: float, sides: int = 10
) -> SurfaceMesh:
    """A closed, tapered round bar between two points, metres."""
    begin, finish = np.asarray(start, np.float64), np.asarray(end, np.float64)
    length = norm(finish - begin)
    profile = np.array([[0.0, 0.0], [radius, 0.0], [end_radius, length], [0.0, length]])
    bar = lathe(profile, sides)
    along = (finish - begin) / length
    helper = np.array([1.0, 0.0, 0.0]) if abs(along[0]) < 0.8 else np.array([0.0, 0.0, 1.0])
    side = unit(np.cross(helper, along))
    return transformed(bar, np.stack([side, along, np.cross(side, along)], -1), begin)


def ellipsoid(center: Sequence[float], radii: Sequence[float], rings: int = 10, segments: int = 16) -> SurfaceMesh:
    """An ellipsoid with its axes along x, y and z."""
    ball = _ball(rings, segments)
    scale = np.asarray(radii, np.float64)
    vertices = ball.vertices * scale + np.asarray(center, np.float64)
    return replace(ball, vertices=vertices, normals=unit(ball.normals / scale))


@lru_cache(maxsize=8)
def _ball(rings: int, segments: int) -> SurfaceMesh:
    """A unit ball; it is shared, so it must not be changed in place."""
    turn = np.linspace(np.pi, 0.0, rings + 1)
    return lathe(np.stack([sin(turn), cos(turn)], -1), segments)


def transformed(
    surface: SurfaceMesh, rotation: Array, translation: Sequence[float] | Array = (0.0, 0.0, 0.0)
) -> SurfaceMesh:
    """The surface rotated by a matrix ``(3, 3)`` and translated; a reflection also reverses its faces."""
    faces = surface.faces if np.linalg.det(rotation) > 0.0 else surface.faces[:, ::-1]
    vertices = product(surface.vertices, rotation.T) + np.asarray(translation, np.float64)
    return SurfaceMesh(vertices, faces, product(surface.normals, rotation.T), surface.uvs)


def moved(surface: SurfaceMesh, translation: Sequence[float] | Array) -> SurfaceMesh:
    """The surface translated."""
    return transformed(surface, np.eye(3), translation)


def mirrored_y(surface: SurfaceMesh) -> SurfaceMesh:
    """The mirror image across the plane ``y = 0``."""
    return transformed(surface, np.diag([1.0, -1.0, 1.0]))


def join(parts: Sequence[SurfaceMesh]) -> SurfaceMesh:
    """All parts as one surface."""
    first = np.cumsum([0] + [len(part.vertices) for part in parts[:-1]])
    return SurfaceMesh(
        np.concatenate([part.vertices for part in parts]),
        np.concatenate([part.faces + offset for part, offset in zip(parts, first, strict=True)]),
        np.concatenate([part.normals for part in parts]),
        np.concatenate([part.uvs for part in parts]),
    )
