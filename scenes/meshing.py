"""Building blocks of procedural meshes: grids, lathes, boxes, smooth normals, joining, and cutting along curves."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from scenes.canonical import Mesh

Array = NDArray[np.float64]
Indices = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Surface:
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
        """The surface as a canonical mesh, without triangles of no area and without unused vertices."""
        # as they will be: single precision flattens some more
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

    def compact(self) -> Surface:
        """The surface without vertices of no triangle."""
        used, faces = np.unique(self.faces, return_inverse=True)
        return Surface(self.vertices[used], faces.reshape(-1, 3), self.normals[used], self.uvs[used])


def unit(vectors: Array) -> Array:
    """Rows scaled to length one; rows of no length become ``+z``."""
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return np.where(length > 1e-12, vectors / np.maximum(length, 1e-12), np.array([0.0, 0.0, 1.0]))


def smooth_normals(vertices: Array, faces: Indices, weld_m: float = 1e-6) -> Array:
    """Normals averaged over the faces around each place, weighted by angle; coincident vertices share theirs.

    Args:
        vertices: ``(v, 3)``.
        faces: ``(f, 3)``.
        weld_m: vertices closer than about this count as one place.
    """
    _, place = np.unique(np.round(vertices / weld_m).astype(np.int64), axis=0, return_inverse=True)
    place = place.reshape(-1)
    sums = np.zeros((place.max() + 1, 3))
    corners = vertices[faces]
    face_normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    proper = np.linalg.norm(face_normal, axis=1) > 1e-12
    face_normal = unit(face_normal)
    for corner in range(3):
        ahead = unit(corners[:, (corner + 1) % 3] - corners[:, corner])
        behind = unit(corners[:, (corner + 2) % 3] - corners[:, corner])
        angle = np.arccos(np.clip(np.einsum("ij,ij->i", ahead, behind), -1.0, 1.0)) * proper
        np.add.at(sums, place[faces[:, corner]], face_normal * angle[:, None])
    return unit(sums[place])


def from_faces(vertices: Array, faces: Indices, uvs: Array | None = None) -> Surface:
    """A smooth surface from bare triangles."""
    vertices = np.asarray(vertices, np.float64)
    faces = np.asarray(faces, np.int64)
    uvs = np.zeros((len(vertices), 2)) if uvs is None else np.asarray(uvs, np.float64)
    return Surface(vertices, faces, smooth_normals(vertices, faces), uvs)


def flat(surface: Surface) -> Surface:
    """The surface with each triangle on its own and facing one way."""
    vertices = surface.vertices[surface.faces].reshape(-1, 3)
    a, b, c = vertices[0::3], vertices[1::3], vertices[2::3]
    normals = np.repeat(unit(np.cross(b - a, c - a)), 3, axis=0)
    faces = np.arange(len(vertices)).reshape(-1, 3)
    return Surface(vertices, faces, normals, surface.uvs[surface.faces].reshape(-1, 2))


def grid(points: Array) -> Surface:
    """A surface through a net of points.

    Args:
        points: ``(m, n, 3)``; outside is where ``∂/∂m × ∂/∂n`` points. uv runs from 0 to 1 along ``(m, n)``.
    """
    rows, columns = points.shape[:2]
    index = np.arange(rows * columns).reshape(rows, columns)
    a, b, c, d = index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:]
    faces = np.concatenate([np.stack([a, b, c], -1).reshape(-1, 3), np.stack([a, c, d], -1).reshape(-1, 3)])
    u, v = np.meshgrid(np.linspace(0.0, 1.0, rows), np.linspace(0.0, 1.0, columns), indexing="ij")
    return from_faces(points.reshape(-1, 3), faces, np.stack([u, v], -1).reshape(-1, 2))


def lathe(profile: Array, segments: int, crease_deg: float = 35.0) -> Surface:
    """A profile turned about the y axis.

    Args:
        profile: ``(n, 2)`` of (radius, y); outside lies to the right of the profile's direction in the plane with
            radius to the right and y up.
        segments: around.
        crease_deg: profile corners sharper than this are not smoothed over.
    """
    turn = np.linspace(0.0, 2.0 * np.pi, segments + 1)
    heading = np.unwrap(np.arctan2(*np.diff(profile, axis=0).T[::-1]))
    sharp = np.flatnonzero(np.abs(np.diff(heading)) > np.radians(crease_deg)) + 1
    strips = []
    for begin, end in zip([0, *sharp], [*sharp, len(profile) - 1], strict=True):
        part = profile[begin : end + 1]
        ring = np.stack([np.sin(turn), np.zeros_like(turn), np.cos(turn)], -1)
        points = part[None, :, :1] * ring[:, None] + part[None, :, 1:] * np.array([0.0, 1.0, 0.0])
        strips.append(grid(points))
    return join(strips)


def box(lower: Sequence[float], upper: Sequence[float]) -> Surface:
    """An axis-aligned box with flat faces; uv in metres along the faces."""
    low, high = np.asarray(lower, np.float64), np.asarray(upper, np.float64)
    sides = []
    for axis in range(3):
        u, v = (axis + 1) % 3, (axis + 2) % 3
        for side in (0, 1):
            corners = np.zeros((2, 2, 3))
            corners[..., axis] = (low, high)[side][axis]
            for i, j in np.ndindex(2, 2):
                corners[i, j, u], corners[i, j, v] = (low, high)[i][u], (low, high)[j][v]
            sheet = grid(corners if side else corners.transpose(1, 0, 2))
            # u is always the horizontal axis of a wall and v its height
            pair = (u, v) if axis != 1 else (v, u)
            sides.append(replace(sheet, uvs=sheet.vertices[:, pair]))
    return join(sides)


def extrude(outline: Array, lower: float, upper: float) -> Surface:
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


def tube(start: Sequence[float], end: Sequence[float], radius: float, end_radius: float, sides: int = 10) -> Surface:
    """A closed, tapering round bar between two points, metres."""
    begin, finish = np.asarray(start, np.float64), np.asarray(end, np.float64)
    length = float(np.linalg.norm(finish - begin))
    profile = np.array([[0.0, 0.0], [radius, 0.0], [end_radius, length], [0.0, length]])
    bar = lathe(profile, sides)
    along = (finish - begin) / length
    helper = np.array([1.0, 0.0, 0.0]) if abs(along[0]) < 0.8 else np.array([0.0, 0.0, 1.0])
    side = unit(np.cross(helper, along))
    return transformed(bar, np.stack([side, along, np.cross(side, along)], -1), begin)


def ellipsoid(center: Sequence[float], radii: Sequence[float], rings: int = 10, segments: int = 16) -> Surface:
    """An ellipsoid with its axes along x, y and z."""
    turn = np.linspace(np.pi, 0.0, rings + 1)
    ball = lathe(np.stack([np.sin(turn), np.cos(turn)], -1), segments)
    scale = np.asarray(radii, np.float64)
    vertices = ball.vertices * scale + np.asarray(center, np.float64)
    return replace(ball, vertices=vertices, normals=unit(ball.normals / scale))


def transformed(surface: Surface, rotation: Array, translation: Sequence[float] | Array = (0.0, 0.0, 0.0)) -> Surface:
    """The surface turned by ``(3, 3)`` and shifted; a reflection also turns its faces round."""
    faces = surface.faces if np.linalg.det(rotation) > 0.0 else surface.faces[:, ::-1]
    vertices = surface.vertices @ rotation.T + np.asarray(translation, np.float64)
    return Surface(vertices, faces, surface.normals @ rotation.T, surface.uvs)


def moved(surface: Surface, translation: Sequence[float] | Array) -> Surface:
    """The surface shifted."""
    return transformed(surface, np.eye(3), translation)


def mirrored_y(surface: Surface) -> Surface:
    """The mirror image across the plane ``y = 0``."""
    return transformed(surface, np.diag([1.0, -1.0, 1.0]))


def join(parts: Sequence[Surface]) -> Surface:
    """All parts as one surface."""
    first = np.cumsum([0] + [len(part.vertices) for part in parts[:-1]])
    return Surface(
        np.concatenate([part.vertices for part in parts]),
        np.concatenate([part.faces + offset for part, offset in zip(parts, first, strict=True)]),
        np.concatenate([part.normals for part in parts]),
        np.concatenate([part.uvs for part in parts]),
    )


def cut(surface: Surface, value: Array) -> tuple[Surface, Surface]:
    """Cuts a surface along the zero line of a function, splitting the triangles it crosses.

    Args:
        surface: what to cut.
        value: ``(v,)`` the function at the vertices, linear in between.

    Returns:
        The part where the function is negative, and the rest; normals and uv are interpolated on the cut.
    """
    value = np.where(np.abs(value) < 1e-9, 1e-9, value)
    below = value < 0.0
    count = below[surface.faces].sum(axis=1)
    inside = [surface.faces[count == 3]]
    outside = [surface.faces[count == 0]]
    crossed = surface.faces[(count == 1) | (count == 2)]
    if len(crossed) == 0:
        return replace(surface, faces=inside[0]).compact(), replace(surface, faces=outside[0]).compact()
    lone = below[crossed] == (below[crossed].sum(axis=1) == 1)[:, None]
    shift = (np.argmax(lone, axis=1)[:, None] + np.arange(3)) % 3
    a, b, c = np.take_along_axis(crossed, shift, axis=1).T  # a is alone on its side
    both = np.sort(np.concatenate([np.stack([a, b], -1), np.stack([a, c], -1)]), axis=1)
    edges, which = np.unique(both, axis=0, return_inverse=True)
    low, high = edges.T
    share = (value[low] / (value[low] - value[high]))[:, None]
    fresh = which.reshape(-1) + len(surface.vertices)
    ab, ac = fresh[: len(a)], fresh[len(a) :]

    def blend(array: Array) -> Array:
        return np.concatenate([array, array[low] * (1.0 - share) + array[high] * share])

    tip = np.stack([a, ab, ac], -1)
    rest = np.concatenate([np.stack([ab, b, c], -1), np.stack([ab, c, ac], -1)])
    tip_below = below[a]
    inside += [tip[tip_below], rest[np.tile(~tip_below, 2)]]
    outside += [tip[~tip_below], rest[np.tile(tip_below, 2)]]
    whole = Surface(blend(surface.vertices), np.concatenate(inside), unit(blend(surface.normals)), blend(surface.uvs))
    return whole.compact(), replace(whole, faces=np.concatenate(outside)).compact()


def carve(surface: Surface, *sides: Callable[[Array], Array]) -> tuple[Surface, Surface]:
    """Cuts out where every one of several functions of the vertices ``(v, 3)`` is negative, one after the other, so
    that corners between them stay sharp.

    Returns:
        What was cut out, and the rest.
    """
    inside, rest = surface, []
    for side in sides:
        inside, outside = cut(inside, side(inside.vertices))
        rest.append(outside)
    return inside, join(rest)


def boundary_edges(surface: Surface) -> Indices:
    """Edges ``(k, 2)`` that belong to one triangle only, in that triangle's direction."""
    edges = np.concatenate([surface.faces[:, [i, (i + 1) % 3]] for i in range(3)])
    key, place, count = np.unique(np.sort(edges, axis=1), axis=0, return_index=True, return_counts=True)
    del key
    return edges[place[count == 1]]
