"""Closed meshes let no ray through: rays aimed exactly at edges, corners and faces, from near and from far."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
from numpy.typing import NDArray

from renderer.rays.queries import RayQueries
from renderer.rays.single_rays import SingleRays
from renderer.trace import Renderer
from scenes.canonical import Emissive, Instance, Matte, Mesh, PerspectiveCamera, Scene, Sphere
from tests.renderer.builders import WHITE, batch, look_at, place, sphere_mesh
from tests.renderer.rays.test_queries import bumpy
from tests.renderer.test_scale import _edge_positions

Points = NDArray[np.float64]
FACING = 0.1
"""Least cosine at which all faces around a place look at a ray's origin: beyond, the ray may pass it by rounding."""
SLACK = 4e-6
"""Greatest distance of a hit behind its place, relative to the distance of the origin: a few steps of float32."""


@dataclass(frozen=True)
class Solid:
    """A closed, dented ball within [-1, 1]³, its edges, and the normals of the faces around each corner."""

    vertices: NDArray[np.float32]
    faces: NDArray[np.int32]
    edges: NDArray[np.int64]
    around: Points

    @staticmethod
    def made(subdivisions: int) -> Solid:
        vertices, faces = bumpy(subdivisions)
        vertices = (vertices / np.abs(vertices).max()).astype(np.float32)
        a, b, c = (vertices[faces[:, k]].astype(np.float64) for k in range(3))
        normal = np.cross(b - a, c - a)
        normal /= np.linalg.norm(normal, axis=1, keepdims=True)
        edges = np.unique(np.sort(np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]), 1), axis=0)
        order = np.argsort(faces.reshape(-1), kind="stable")
        of, first = order // 3, np.searchsorted(faces.reshape(-1)[order], np.arange(len(vertices) + 1))
        degree = np.diff(first)
        lists = np.minimum(np.arange(degree.max()), degree[:, None] - 1) + first[:-1, None]
        return Solid(vertices, faces, edges.astype(np.int64), normal[of[lists]])

    def rays(
        self, count: int, distance: tuple[float, float], share: float | None, rng: np.random.Generator
    ) -> tuple[NDArray[np.float32], NDArray[np.float32], Points]:
        """Rays at a share of the way along edges, anywhere along them for None, from random sides and distances.

        Returns:
            Origins, directions as long as the way to the edge, and that length; those alone that come from outside.
        """
        ends = self.edges[rng.integers(len(self.edges), size=count)]
        a, b = (self.vertices[ends[:, k]].astype(np.float64) for k in range(2))
        at = a + (rng.random((count, 1)) if share is None else share) * (b - a)
        away = rng.normal(size=(count, 3))
        away *= np.exp(rng.uniform(*np.log(distance), (count, 1))) / np.linalg.norm(away, axis=1, keepdims=True)
        origin = (at + away).astype(np.float32)
        direction = (at - origin.astype(np.float64)).astype(np.float32)
        length = np.linalg.norm(direction.astype(np.float64), axis=1)
        unit = (direction / length[:, None])[:, None]
        facing = [-(self.around[ends[:, k]] * unit).sum(-1).max(1) for k in range(2 if share != 0.0 else 1)]
        seen = np.minimum.reduce(facing) > FACING
        return origin[seen], direction[seen], length[seen]


RANGES = {"near": (1.0, 10.0), "far": (10.0, 300.0), "farther": (300.0, 1e4), "beyond": (1e4, 1e5)}
"""Distances of origins in halves of the solid's size."""


def leaks(trace, solid: Solid, count: int, seed: int, farthest: str = "beyond") -> tuple[int, int]:
    """Number of rays, and of those that missed the surface at which they were aimed."""
    rng, traced, lost = np.random.default_rng(seed), 0, 0
    for name, distance in RANGES.items():
        for share in (None, 0.0, 0.5):
            origin, direction, length = solid.rays(count, distance, share, rng)
            hits = trace(origin, direction)
            behind = (hits.t - 1.0) * length
            # a dent may lie before the edge, never behind it
            lost += int(((hits.face < 0) | (behind > SLACK * np.maximum(length, 1.0))).sum())
            traced += len(origin)
        if name == farthest:
            break
    return traced, lost


@pytest.mark.parametrize("kind", ["packets", "bvh", "kdtree"])
def test_a_closed_mesh_lets_nothing_through(kind: str) -> None:
    solid = Solid.made(4)
    if kind == "packets":
        trace = RayQueries(solid.vertices, solid.faces).closest
    else:
        trace = SingleRays(solid.vertices, solid.faces, kind).closest  # pyright: ignore[reportArgumentType]
    traced, lost = leaks(trace, solid, 20_000, seed=1)
    assert traced > 40_000 and lost == 0


def test_a_hole_is_found() -> None:
    """The check above detects a missing face."""
    solid = Solid.made(2)
    trace = RayQueries(solid.vertices, solid.faces[1:]).closest
    _, lost = leaks(trace, solid, 20_000, seed=2, farthest="near")
    assert lost > 10


@pytest.mark.slow
def test_none_of_a_hundred_million_rays_passes_a_closed_mesh() -> None:
    """At exact edges and corners from 1 to 10,000 sizes away, 300 and more among them."""
    solid, traced, lost, turn = Solid.made(4), 0, 0, 0
    trace = RayQueries(solid.vertices, solid.faces).closest
    while traced < 100_000_000:
        found = leaks(trace, solid, 500_000, seed=100 + turn, farthest="farther")
        traced, lost, turn = traced + found[0], lost + found[1], turn + 1
        assert lost == 0, f"{lost} of {traced} rays"


def test_rays_along_every_axis_and_through_corners_of_a_cube() -> None:
    """Zero components of the direction, edges that are seen end on, and diagonals, from near and far."""
    corner = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], np.float32)
    faces = [[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1], [2, 3, 7], [2, 7, 6], [0, 2, 6],
             [0, 6, 4], [1, 5, 7], [1, 7, 3]]  # fmt: skip
    queries, singles = RayQueries(corner, faces), SingleRays(corner, faces)
    ways = np.array([[x, y, z] for x in (-1, 0, 1) for y in (-1, 0, 1) for z in (-1, 0, 1) if x or y or z], float)
    grid = np.array([[u, v] for u in np.linspace(-1, 1, 9) for v in np.linspace(-1, 1, 9)])
    for distance in (2.0, 300.0, 1e4):
        for way in ways:
            axis = int(np.abs(way).argmax())
            target = np.insert(grid, axis, -way[axis], axis=1)  # on the face that is met first, its border included
            target = np.where(way == 0.0, target, 0.999 * target * np.where(np.arange(3) == axis, 1 / 0.999, 1.0))
            origin = (target - distance * way).astype(np.float32)
            direction = np.broadcast_to(way, origin.shape).astype(np.float32)
            for trace in (queries.closest, singles.closest):
                hits = trace(origin, direction)
                assert (hits.face >= 0).all(), (distance, way)
                assert np.abs(hits.t - distance).max() <= 4e-7 * distance + 2e-3


def test_rays_from_a_surface_leave_it_and_grazing_ones_are_not_lost() -> None:
    """From points of a closed mesh, moved by a millionth outwards: what goes outwards is free, what goes in is not."""
    solid = Solid.made(3)
    convex = (solid.vertices / np.linalg.norm(solid.vertices, axis=1, keepdims=True)).astype(np.float32)
    queries, rng = RayQueries(convex, solid.faces), np.random.default_rng(4)
    a, b, c = (convex[solid.faces[:, k]].astype(np.float64) for k in range(3))
    normal = np.cross(b - a, c - a)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    middle = (a + b + c) / 3.0
    across = np.cross(normal, rng.normal(size=normal.shape))
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    for lean in (1e-3, 1e-2, 1.0):
        start = (middle + 1e-6 * normal).astype(np.float32)
        assert not queries.blocked(start, (across + lean * normal).astype(np.float32)).any()
        hits = queries.closest((middle + 1e-6 * normal).astype(np.float32), (across - lean * normal).astype(np.float32))
        assert (hits.face >= 0).all() and (hits.t < 1e-6 / lean + 1e-3).mean() > 0.99


def test_coincident_faces_and_needles() -> None:
    """Of coincident faces the first is hit; needles and points neither hide other faces nor give NaN."""
    rng = np.random.default_rng(6)
    quad = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]], np.float32)
    faces = np.concatenate([np.tile([[0, 1, 2], [0, 2, 3]], (50, 1))])
    needles = rng.uniform(-1, 1, (400, 1, 3)) + np.array([[[0, 0, 0.0]], [[1e-7, 0, 0]], [[0.5, 0.5, 0]]]).reshape(3, 3)
    needles[..., 2] = rng.uniform(0.5, 1.0, (400, 1))
    vertices = np.concatenate([quad, needles.reshape(-1, 3)]).astype(np.float32)
    thin = np.arange(4, 4 + 1200).reshape(-1, 3)
    degenerate = np.stack([thin[:, 0], thin[:, 0], thin[:, 1]], axis=1)
    all_faces = np.concatenate([faces, thin, degenerate])
    origin = np.concatenate([rng.uniform(-0.99, 0.99, (4000, 2)), np.full((4000, 1), 3.0)], axis=1)
    origin[::4, 1] = origin[::4, 0]  # along the diagonal that the faces share
    direction = np.broadcast_to([0.0, 0.0, -1.0], origin.shape)
    hits = RayQueries(vertices, all_faces).closest(origin, direction)
    assert np.isfinite([hits.t, hits.u, hits.v]).all() and (hits.face >= 0).all()
    through = hits.face < len(faces)
    assert through.mean() > 0.99 and set(hits.face[through]) <= {0, 1}
    np.testing.assert_allclose(hits.t[through], 3.0, rtol=1e-6)


@pytest.mark.parametrize("distance", [2.0, 300.0, 1e4])
@pytest.mark.parametrize("packets", [True, False])
def test_pictures_of_closed_meshes_show_nothing_of_what_is_within(distance: float, packets: bool) -> None:
    """A lamp in a dark ball, seen through the very edges of the ball's faces."""
    smooth = sphere_mesh(32)
    ball = Mesh(np.round(smooth.vertices, 6) + np.float32(0.0), smooth.faces)  # closes the seam
    matrix = place((0.3, -0.2, 0.1), (0.3, 0.5, 0.1))
    middle = matrix[:3, 3]
    camera = PerspectiveCamera(
        look_at(middle + distance * np.array([0.48, 0.6, 0.64]), middle), 2.0 * np.degrees(np.arctan(1.1 / distance))
    )
    lamp = Instance(Sphere(0.9), Emissive((1.0, 1.0, 1.0)), matrix)
    renderer = Renderer(Scene(camera, (Instance(ball, Matte(WHITE), matrix), lamp)), packets=packets)
    position = _edge_positions(ball, camera, matrix)
    assert len(position) > 10_000
    found = renderer.trace(batch(position)).color
    assert bool((found == 0.0).all())
    renderer.close()
