"""Rays through one mesh: compared with brute force, watertight, and independent of the other rays of a packet."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from renderer.rays.queries import RayQueries
from renderer.rays.single_rays import SingleRays
from tests.oracles.ray_triangles import nearest_hits


def bumpy(subdivisions: int) -> tuple[np.ndarray, np.ndarray]:
    """Vertices and faces of a closed, dented ball."""
    ball = trimesh.creation.icosphere(subdivisions=subdivisions)
    dents = 1.0 + 0.15 * np.sin(ball.vertices @ (5.0, 0.0, 2.0)) * np.sin(ball.vertices @ (0.0, 7.0, 6.0))
    return (ball.vertices * dents[:, None]).astype(np.float32), np.asarray(ball.faces, np.int32)


def camera_rays(side: int) -> tuple[np.ndarray, np.ndarray]:
    """Rays from one point through a square, in blocks of 4 x 4."""
    index = np.arange(side * side)
    block, within = index // 16, index % 16
    x = block % (side // 4) * 4 + within % 4
    y = block // (side // 4) * 4 + within // 4
    direction = np.stack([(x + 0.5) / side - 0.5, (y + 0.5) / side - 0.5, np.full(len(x), -1.1)], axis=1)
    origin = np.broadcast_to(np.array([0.1, -0.05, 2.6]), direction.shape)
    return origin.astype(np.float32), direction.astype(np.float32)


def random_rays(count: int, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    return rng.uniform(-1.2, 1.2, (count, 3)).astype(np.float32), rng.normal(size=(count, 3)).astype(np.float32)


RAYS = {"camera": camera_rays(48), "random": random_rays(2000)}


@pytest.mark.parametrize("kind", RAYS)
def test_hits_are_those_of_brute_force(kind: str) -> None:
    vertices, faces = bumpy(3)
    origin, direction = RAYS[kind]
    hits = RayQueries(vertices, faces).closest(origin, direction)
    t, face = nearest_hits(vertices, faces, origin, direction)
    assert 0.2 < (face >= 0).mean() < 1.0
    same = hits.face == face
    assert same.mean() > 0.998  # a ray at an edge may see either side of it
    assert np.array_equal(hits.face >= 0, face >= 0)
    met = face >= 0
    np.testing.assert_allclose(hits.t[met], t[met], rtol=2e-5, atol=2e-6)
    corners = vertices[faces[hits.face[met]]].astype(np.float64)
    weights = np.stack([hits.u, hits.v, 1.0 - hits.u - hits.v], axis=1)[met]
    along = origin[met] + hits.t[met, None] * direction[met]
    np.testing.assert_allclose((corners * weights[..., None]).sum(axis=1), along, atol=5e-6)


@pytest.mark.parametrize("kind", RAYS)
def test_blocked_says_whether_there_is_a_hit_before_the_end(kind: str) -> None:
    vertices, faces = bumpy(3)
    queries = RayQueries(vertices, faces)
    origin, direction = RAYS[kind]
    hits = queries.closest(origin, direction)
    met = hits.face >= 0
    assert np.array_equal(queries.blocked(origin, direction), met)
    assert queries.blocked(origin[met], direction[met], hits.t[met] * 1.001).all()
    assert not queries.blocked(origin[met], direction[met], hits.t[met] * 0.999).any()
    assert not (queries.closest(origin, direction, 1e-6).face >= 0).any()


@pytest.mark.parametrize("subdivisions", [5, 6])  # the second is large enough for rays to take turns
def test_a_ray_does_not_depend_on_its_company(subdivisions: int) -> None:
    vertices, faces = bumpy(subdivisions)
    queries = RayQueries(vertices, faces)
    origin, direction = (np.concatenate(parts) for parts in zip(*RAYS.values(), strict=True))
    order = np.random.default_rng(1).permutation(len(origin))
    together, apart = queries.closest(origin, direction), queries.closest(origin[order], direction[order])
    threads = RayQueries(vertices, faces, threads=3).closest(origin, direction)
    alone = SingleRays(vertices, faces).closest(origin, direction)
    for name in ("face", "t", "u", "v"):
        assert np.array_equal(getattr(together, name)[order], getattr(apart, name)), name
        assert np.array_equal(getattr(together, name), getattr(threads, name)), name
        met = alone.face >= 0  # the weights of a miss are undefined
        assert np.array_equal(getattr(together, name)[met], getattr(alone, name)[met]), name
    assert np.array_equal(together.face, alone.face)
    reach = np.random.default_rng(2).uniform(0.0, 4.0, len(origin)).astype(np.float32)
    blocked = queries.blocked(origin, direction, reach)
    assert 0.1 < blocked.mean() < 0.9
    assert np.array_equal(blocked[order], queries.blocked(origin[order], direction[order], reach[order]))


def framelets(rng: np.random.Generator, distance: float, width: float, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Rays of squares of 16 x 16 in Morton order, each square from one point at a distance towards some axis."""
    index = np.arange(256)
    x, y = (sum((index >> 2 * bit + axis & 1) << bit for bit in range(4)) / 16.0 - 0.5 for axis in (0, 1))
    origin, direction = [], []
    for number in range(count):
        towards = np.roll(rng.normal(size=3) * (0.2, 0.2, 0.0) + (0.0, 0.0, (-1.0) ** number), number // 2 % 3)
        across = np.cross(towards, rng.normal(size=3))
        up = np.cross(towards, across)
        aim = rng.uniform(-0.8, 0.8, 3) + width * (x[:, None] * across + y[:, None] * up) / np.linalg.norm(up)
        start = rng.uniform(-0.8, 0.8, 3) - distance * towards
        origin.append(np.broadcast_to(start, aim.shape)), direction.append(aim - start)
    return np.concatenate(origin).astype(np.float32), np.concatenate(direction).astype(np.float32)


@pytest.mark.parametrize("subdivisions", [4, 6])  # the second is large enough for leaves to wait
@pytest.mark.parametrize("distance", [0.3, 3.0, 1e2, 1e4])
@pytest.mark.parametrize("width", [0.0, 1e-6, 0.1, 1.0])
def test_rays_of_a_framelet_meet_what_each_meets_alone(subdivisions: int, distance: float, width: float) -> None:
    vertices, faces = bumpy(subdivisions)
    queries, rng = RayQueries(vertices, faces), np.random.default_rng(7)
    origin, direction = framelets(rng, distance, width, 24)
    reach = np.where(rng.random(len(origin)) < 0.9, 1e30, rng.uniform(-0.5, 2.0, len(origin))).astype(np.float32)
    for kept in (slice(None), rng.random(len(origin)) < 0.8):  # without some, packets are no squares any more
        start, towards, end = origin[kept], direction[kept], reach[kept]
        order = rng.permutation(len(start))
        together, alone = (
            queries.closest(start, towards, end),
            queries.closest(start[order], towards[order], end[order]),
        )
        for name in ("face", "t", "u", "v"):
            assert np.array_equal(getattr(together, name)[order], getattr(alone, name)), name
        blocked = queries.blocked(start, towards, end)
        assert np.array_equal(blocked[order], queries.blocked(start[order], towards[order], end[order]))
        # shadow rays: from the points that are met back to the common origin
        met = together.face >= 0
        assert met.any()
        back = -towards[met] * together.t[met, None] * np.float32(0.999)
        point = start[met] - back
        again = rng.permutation(len(point))
        shadow = queries.blocked(point, back, 1.0)
        assert np.array_equal(shadow[again], queries.blocked(point[again], back[again], 1.0))


@pytest.mark.parametrize("distance", [0.3, 3.0, 1e2, 1e4])
@pytest.mark.parametrize("width", [0.0, 1e-6, 1e-2])
def test_neighbours_at_an_edge_meet_what_each_meets_alone(distance: float, width: float) -> None:
    vertices, faces = bumpy(4)
    rng = np.random.default_rng(5)
    middle = vertices[faces[:, :2]].mean(axis=1).astype(np.float64)
    outwards = rng.normal(size=middle.shape)
    outwards /= np.linalg.norm(outwards, axis=1, keepdims=True)
    at, start = (np.repeat(points, 16, axis=0) for points in (middle, middle + distance * outwards))
    at += width * rng.normal(size=at.shape)
    start += width * distance * rng.normal(size=at.shape)
    origin, direction = start.astype(np.float32), (at - start).astype(np.float32)
    order = rng.permutation(len(at))  # the directions of a packet then have nothing in common
    queries = RayQueries(vertices, faces)
    together, alone = queries.closest(origin, direction), queries.closest(origin[order], direction[order])
    for name in ("face", "t", "u", "v"):
        assert np.array_equal(getattr(together, name)[order], getattr(alone, name)), name
    near = np.full(len(at), 1.0 - 1e-3, np.float32)
    blocked = queries.blocked(origin, direction, near)
    assert np.array_equal(blocked[order], queries.blocked(origin[order], direction[order], near))
    assert (together.face >= 0).mean() > 0.9


@pytest.mark.parametrize("spoilt", ["origin", "direction", "reach"])
@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_a_nonfinite_ray_spoils_no_other(spoilt: str, value: float) -> None:
    vertices, faces = bumpy(3)
    queries = RayQueries(vertices, faces)
    origin, direction = camera_rays(16)
    reach = np.full(len(origin), 1e30, np.float32)
    good = queries.closest(origin, direction, reach)
    {"origin": origin, "direction": direction, "reach": reach}[spoilt][5::16] = value
    bad = queries.closest(origin, direction, reach)
    others = np.arange(len(origin)) % 16 != 5
    assert np.array_equal(bad.face[others], good.face[others]) and np.array_equal(bad.t[others], good.t[others])
    if value != np.inf or spoilt != "reach":
        assert (bad.face[~others] == -1).all()


@pytest.mark.parametrize("distance", [3.0, 1e2, 1e4])
@pytest.mark.parametrize("shared", [True, False])
def test_nothing_leaks_through_edges_and_corners(distance: float, shared: bool) -> None:
    vertices, faces = bumpy(4)
    vertices = vertices / np.abs(vertices).max()
    rng = np.random.default_rng(3)
    ends = vertices[faces[:, [0, 1]]].astype(np.float64)
    at = ends[:, 0] + rng.random((len(ends), 1)).round(1) * (ends[:, 1] - ends[:, 0])
    outwards = rng.normal(size=3) if shared else rng.normal(size=at.shape)
    origin = at + distance * outwards / np.linalg.norm(outwards, axis=-1, keepdims=True)
    # the target lies on the closed surface: from outside, the ray must meet it or something before it
    direction = (at * 0.999 - origin).astype(np.float32)
    hits = RayQueries(vertices, faces).closest(origin.astype(np.float32), direction)
    assert (hits.face >= 0).all()


def test_equal_distances_go_to_the_lower_number_in_trees_of_any_shape() -> None:
    corner = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], np.float32)
    for count in (1, 4, 5, 8, 9, 3000):
        queries = RayQueries(corner, np.tile([[0, 1, 2]], (count, 1)))
        origin = np.tile(np.array([[0.2, 0.3, 1.0]], np.float32), (32, 1))
        direction = np.tile(np.array([[0.0, 0.0, -2.0]], np.float32), (32, 1))
        direction[::3] = (0.01, 0.0, -2.0)
        hits = queries.closest(origin, direction)
        assert (hits.face == 0).all() and np.allclose(hits.t, 0.5)
        origin[1::2, 2], direction[1::2, 2] = -1.0, 2.0  # from both sides: these are walked one by one
        alone = queries.closest(origin, direction)
        assert (alone.face == 0).all() and np.allclose(alone.t, 0.5) and queries.blocked(origin, direction).all()


def test_slivers_and_points_are_harmless() -> None:
    rng = np.random.default_rng(0)
    vertices = np.concatenate(
        [rng.normal(size=(300, 3)), np.zeros((3, 3)), np.geomspace(1e-12, 1.0, 600)[:, None] * np.ones(3)]
    )
    faces = np.concatenate([np.arange(900).reshape(-1, 3), [[5, 5, 5], [7, 7, 8]], np.tile([[300, 301, 302]], (40, 1))])
    origin, direction = random_rays(500)
    hits = RayQueries(vertices, faces).closest(origin, direction)
    _, face = nearest_hits(vertices.astype(np.float32), faces, origin, direction)
    assert np.isfinite(hits.t).all() and ((hits.face >= 0) == (face >= 0)).mean() > 0.99


def test_rays_along_axes_and_in_the_planes_of_boxes() -> None:
    box = trimesh.creation.box((2.0, 2.0, 2.0))
    queries = RayQueries(box.vertices, box.faces)
    for axis in range(3):
        for sign in (1.0, -1.0):
            direction = np.zeros((17, 3))
            direction[:, axis] = sign
            origin = -3.0 * direction
            origin[:, (axis + 1) % 3] = np.linspace(-1.0, 1.0, 17)
            hits = queries.closest(origin, direction)
            assert (hits.face >= 0).all() and np.allclose(hits.t, 2.0)


def test_odd_queries_are_refused() -> None:
    vertices, faces = bumpy(1)
    for odd in (np.zeros((0, 3), int), np.zeros((2, 4), int)):
        with pytest.raises(ValueError, match=r"expected vertices \(v, 3\) and faces \(f, 3\)"):
            RayQueries(vertices, odd)
    with pytest.raises(ValueError, match="expected indices below 42, got 0 to 42"):
        RayQueries(vertices, [[0, 1, 42]])
    with pytest.raises(ValueError, match="finite numbers below"):
        RayQueries(np.full((3, 3), np.nan), [[0, 1, 2]])
    with pytest.raises(ValueError, match="threads: expected at least 1, got 0"):
        RayQueries(vertices, faces, threads=0)
    queries = RayQueries(vertices, faces)
    with pytest.raises(ValueError, match=r"expected origins and directions \(n, 3\)"):
        queries.closest(np.zeros((4, 3)), np.zeros((5, 3)))
    assert queries.closest(np.zeros((0, 3)), np.zeros((0, 3))).face.shape == (0,)


@pytest.mark.filterwarnings("error")
def test_arrays_that_cannot_be_written_are_read_in_silence_and_an_empty_list_is_answered() -> None:
    rays = RayQueries(*bumpy(1))
    origin, direction = random_rays(40)
    expected = rays.closest(origin, direction, 2.0)
    for values in (origin, direction):
        values.flags.writeable = False
    found = rays.closest(origin, direction, 2.0)
    assert np.array_equal(found.face, expected.face) and np.array_equal(found.t, expected.t)
    nothing = np.empty((0, 3), np.float32)
    assert len(rays.closest(nothing, nothing).face) == 0 == len(rays.blocked(nothing, nothing, 1.0))
