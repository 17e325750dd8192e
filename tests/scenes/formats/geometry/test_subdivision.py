"""Subdivision surfaces beside limits in closed form, those of another library, and what never changes."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
import trimesh

from scenes.canonical import Mesh
from scenes.formats.geometry.subdivision import LEVELS, Cage, Refined, Scheme, levels_of, loop_surface, refined

POINTS = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], np.float64)
QUADS = np.array([(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)])
RIM = np.array([(0, 1), (1, 3), (3, 2), (2, 0)])


def cage(faces: np.ndarray, edges=(), sharpness=(), corners=(), count: int = 0) -> Cage:
    count = count or int(faces.max()) + 1
    of_corners = np.zeros(count)
    of_corners[list(dict(corners))] = list(dict(corners).values())
    pairs = np.array(edges, np.int64).reshape(-1, 2)
    return Cage(
        count, np.full(len(faces), faces.shape[1]), faces.ravel(), pairs, np.array(sharpness, np.float64), of_corners
    )


def limits(surface: Refined, points: np.ndarray) -> np.ndarray:
    """Limits of points of quads without boundary: Halstead, Kass and DeRose 1993, eq. 12."""
    quads = surface.cage.indices.reshape(-1, 4)
    sums, valence = np.zeros((len(points), 3)), np.zeros(len(points))
    for turn in range(4):
        own, beside, across, other = (quads[:, (turn + k) % 4] for k in range(4))
        np.add.at(sums, own, 2.0 * (points[beside] + points[other]) + points[across])
        np.add.at(valence, own, 1.0)
    n = valence[:, None]
    return (n**2 * points + sums) / (n * (n + 5.0))


def test_limits_of_a_cube_do_not_depend_on_the_level() -> None:
    found = []
    for levels in (1, 3):
        surface = refined(cage(QUADS), "catmullClark", levels)
        assert len(surface.cage.counts) == 6 * 4**levels and (np.bincount(surface.polygon) == 4**levels).all()
        found.append(limits(surface, surface.smooth @ POINTS)[:26])
    first = dataclasses.replace(refined(cage(QUADS), "catmullClark", LEVELS), cage=cage(QUADS))
    assert found[0] == pytest.approx(found[1], abs=1e-12)
    assert found[0][:8] == pytest.approx(limits(first, POINTS), abs=1e-12)


def test_loops_scheme_is_that_of_another_library() -> None:
    ball = trimesh.creation.icosahedron()
    points, faces = trimesh.remesh.subdivide_loop(ball.vertices, ball.faces, LEVELS)
    surface = refined(cage(np.array(ball.faces)), "loop", LEVELS)
    ours = surface.smooth @ np.array(ball.vertices)
    assert len(surface.cage.counts) == len(faces)
    assert np.unique(ours.round(9), axis=0) == pytest.approx(np.unique(points.round(9), axis=0), abs=1e-8)
    corners = ours[surface.cage.indices.reshape(-1, 3)]
    areas = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert (np.einsum("ij,ij->i", areas, corners[:, 0]) > 0.0).all(), "all face outwards"


@pytest.mark.parametrize("scheme", ["catmullClark", "loop"])
def test_a_plane_stays_a_plane_and_its_boundary_its_edge(scheme: Scheme) -> None:
    side = 4
    grid = np.arange(side * side).reshape(side, side)
    quads = np.stack([grid[:-1, :-1], grid[1:, :-1], grid[1:, 1:], grid[:-1, 1:]], -1).reshape(-1, 4)
    faces = quads if scheme == "catmullClark" else np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
    points = np.stack([*np.divmod(np.arange(side * side), side), np.zeros(side * side)], 1).astype(np.float64)
    surface = refined(cage(faces), scheme, LEVELS)
    found = surface.smooth @ points
    assert found[:, 2] == pytest.approx(0.0) and found[:, :2].min() == 0.0 and found[:, :2].max() == side - 1.0
    for matrix in (surface.smooth, surface.linear, surface.corners):
        assert np.asarray(matrix.sum(axis=1)) == pytest.approx(1.0)
    at_corners = surface.corners @ points[faces.ravel()]
    assert at_corners == pytest.approx((surface.linear @ points)[surface.cage.indices], abs=1e-12)


def test_sharp_edges_keep_their_place_and_end_at_their_level() -> None:
    """A rim that is always sharp becomes the spline of its four points; one of one level is one step of it."""
    always = refined(cage(QUADS, RIM, [np.inf] * 4), "catmullClark", LEVELS).smooth @ POINTS
    assert always[always[:, 0] < -0.999].shape[0] > 32, "the side of the rim is flat"
    assert always[0] == pytest.approx((-1.0, -2 / 3, -2 / 3), abs=0.01), "the limit is the cubic spline of the rim"
    soft, once = (refined(cage(QUADS, RIM, [s] * 4), "catmullClark", LEVELS).smooth @ POINTS for s in (0.0, 1.0))
    half = refined(cage(QUADS, RIM, [0.5] * 4), "catmullClark", LEVELS).smooth @ POINTS
    assert soft[0, 0] > half[0, 0] > once[0, 0] > always[0, 0]


def test_a_cube_of_sharp_corners_and_edges_stays_a_cube() -> None:
    edges = [(a, b) for a in range(8) for b in range(a) if bin(a ^ b).count("1") == 1]
    found = refined(cage(QUADS, edges, [10.0] * 12), "catmullClark", LEVELS).smooth @ POINTS
    assert np.abs(found).max(axis=1) == pytest.approx(1.0)
    pinned = refined(cage(QUADS, corners={7: np.inf}.items()), "catmullClark", LEVELS).smooth @ POINTS
    assert pinned[7] == pytest.approx((1.0, 1.0, 1.0)) and np.abs(pinned[0]).max() < 0.6


def test_a_single_quad_has_corners_or_not() -> None:
    one, points = cage(np.array([(0, 1, 2, 3)])), POINTS[[0, 2, 6, 4]]
    assert (refined(one, "catmullClark", LEVELS).smooth @ points)[:4] == pytest.approx(points)
    assert np.abs((refined(one, "catmullClark", LEVELS, sharp_corners=False).smooth @ points)[:4, :2]).max() < 0.8


def test_large_cages_get_fewer_levels() -> None:
    few = cage(QUADS)
    many = dataclasses.replace(few, counts=np.full(300_000, 4), indices=np.zeros(1_200_000, np.int64))
    assert levels_of(few, "catmullClark") == 3 and levels_of(many, "catmullClark") == 0
    some = dataclasses.replace(few, counts=np.full(60_000, 4), indices=np.arange(240_000))
    assert levels_of(some, "catmullClark") == 2


def test_polygons_of_many_corners_and_points_of_many_polygons_get_fewer_levels() -> None:
    """Each point beside them depends on all of their points: 2,000 corners took 4 GB."""
    for many, levels in ((400, 3), (1000, 2), (2000, 1), (4000, 0)):
        fan = np.stack([np.arange(many), (np.arange(many) + 1) % many, np.full(many, many)], axis=1)
        assert (levels_of(cage(np.arange(many)[None]), "catmullClark"), levels_of(cage(fan), "loop")) == (levels,) * 2


def test_a_mesh_becomes_its_surface_by_loop() -> None:
    ball = trimesh.creation.icosphere(1)
    mesh = Mesh(np.array(ball.vertices, np.float32), np.array(ball.faces, np.int32), None, np.ones((42, 2), np.float32))
    found, levels = loop_surface(mesh, 2)
    assert levels == 2 and len(found.faces) == 16 * len(mesh.faces) and found.normals is not None
    outwards = found.vertices / np.linalg.norm(found.vertices, axis=1, keepdims=True)
    assert (found.normals * outwards).sum(axis=1).min() > 0.999 and found.uvs == pytest.approx(1.0)
    assert np.array_equal(loop_surface(mesh, 0)[0].vertices, mesh.vertices) and loop_surface(mesh, 9)[1] == LEVELS
