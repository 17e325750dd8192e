"""A kd-tree, a tree of boxes and no structure find the same hits, and count their work."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from renderer.frames import render_tiles
from renderer.layout.sizes import KD_DEPTH_MAX
from renderer.rays.single_rays import SingleRays
from renderer.sampling.plan import SamplePlan
from renderer.tables.accelerators import LEAF_TRIANGLES, STRUCTURES, build_kdtree
from renderer.trace import Renderer
from scenes import catalog
from scenes.effects import scenes as effects
from tests.renderer.builders import sphere_mesh


def soup(count: int, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """Triangles anywhere, of many sizes; some lie in planes of the axes, some have no area."""
    rng = np.random.default_rng(seed)
    center, size = rng.uniform(-0.9, 0.9, (count, 1, 3)), 0.01 + 0.3 * rng.random((count, 1, 1)) ** 3
    corners = center + size * rng.standard_normal((count, 3, 3))
    for axis in range(3):
        some = rng.random(count) < 0.1
        corners[some, :, axis] = np.round(corners[some, :1, axis], 1)
    flat = rng.random(count) < 0.03
    corners[flat, 1] = corners[flat, 0]
    return corners.reshape(-1, 3).astype(np.float32), np.arange(3 * count, dtype=np.int32).reshape(-1, 3)


def rays(count: int, seed: int = 1) -> tuple[np.ndarray, np.ndarray]:
    """From inside and outside; some along the axes and in planes that the mesh has triangles in."""
    rng = np.random.default_rng(seed)
    origin = rng.uniform(-2.0, 2.0, (count, 3))
    direction = rng.standard_normal((count, 3))
    for axis in range(3):
        some = rng.random(count) < 0.1
        direction[some, axis] = 0.0
        origin[some, axis] = np.round(origin[some, axis], 1)
    direction[rng.random(count) < 0.1] = (0.0, -1.0, 0.0)
    return origin.astype(np.float32), direction.astype(np.float32)


def same(a, b) -> bool:
    return all(np.array_equal(getattr(a, name), getattr(b, name)) for name in ("face", "t", "u", "v"))


@pytest.mark.parametrize("count", [1, 9, 10, 300, 3000])
def test_all_structures_find_the_same_to_the_bit(count: int) -> None:
    vertices, faces = soup(count, count)
    origin, direction = rays(4000)
    found = [SingleRays(vertices, faces, structure).counted(origin, direction) for structure in STRUCTURES]
    assert (found[0][0].face >= 0).any()
    for hits, _ in found[1:]:
        assert same(hits, found[0][0])
    blocked = [
        SingleRays(vertices, faces, s).counted(origin, direction, 0.7, nearest=False)[0].face for s in STRUCTURES
    ]
    assert np.array_equal(blocked[0], blocked[1]) and np.array_equal(blocked[0], blocked[2])


@given(st.integers(1, 60), st.integers(0, 10**6), st.floats(1e-3, 1e3))
@settings(max_examples=30, deadline=None)
def test_any_soup_of_any_size(count: int, seed: int, scale: float) -> None:
    vertices, faces = soup(count, seed)
    origin, direction = rays(300, seed)
    found = [
        SingleRays(vertices * np.float32(scale), faces, structure).closest(origin * np.float32(scale), direction)
        for structure in STRUCTURES
    ]
    assert same(found[0], found[1]) and same(found[0], found[2])


def test_rays_that_run_along_the_planes_of_the_tree() -> None:
    mesh = sphere_mesh(24)
    tree = build_kdtree(mesh.vertices, mesh.faces)
    inner = tree.nodes[tree.nodes["axis"] < 3]
    origin, direction = np.zeros((len(inner), 3), np.float32), np.zeros((len(inner), 3), np.float32)
    for number, node in enumerate(inner):
        origin[number, node["axis"]] = node["split"]
        origin[number, (node["axis"] + 1) % 3] = 2.0
        direction[number, (node["axis"] + 1) % 3] = -1.0
    found = [SingleRays(mesh.vertices, mesh.faces, structure).closest(origin, direction) for structure in STRUCTURES]
    assert (found[0].face >= 0).mean() > 0.9
    assert same(found[0], found[1]) and same(found[0], found[2])


def test_brute_force_tests_every_triangle() -> None:
    vertices, faces = soup(77)
    origin, direction = rays(500)
    work = SingleRays(vertices, faces, "brute").counted(origin, direction)[1]
    assert (work.node_visits, work.triangle_tests) == (0, 500 * 77)


def walked_slowly(tree, origin: np.ndarray, direction: np.ndarray, t_hit: float) -> tuple[int, int]:
    """Visits and tests of a ray that is known to end at ``t_hit``, by clipping it to every node's cell in turn.

    Cells are those that the ray passes before its end, in any order; a walk that stops at the hit visits no others.
    """
    visits = tests = 0
    stack = [(0, 0.0, t_hit)]
    while stack:
        number, near, far = stack.pop()
        node = tree.nodes[number]
        visits += 1
        if node["axis"] == 3:
            tests += int(node["count"])
            continue
        axis = node["axis"]
        start, end = (origin[axis] + direction[axis] * t for t in (near, far))
        if min(start, end) <= node["split"]:
            span = near, far
            if start > node["split"]:
                span = max(near, (node["split"] - origin[axis]) / direction[axis]), far
            elif end > node["split"]:
                span = near, min(far, (node["split"] - origin[axis]) / direction[axis])
            stack.append((int(node["first"]), *span))
        if max(start, end) >= node["split"]:
            span = near, far
            if start < node["split"]:
                span = max(near, (node["split"] - origin[axis]) / direction[axis]), far
            elif end < node["split"]:
                span = near, min(far, (node["split"] - origin[axis]) / direction[axis])
            stack.append((int(node["first"]) + 1, *span))
    return visits, tests


def test_the_kd_trees_counts_are_those_of_a_slow_walk() -> None:
    """A walk in order may look into the cell of its hit's leaf before it knows where that is: a little more."""
    vertices, faces = soup(200, 3)
    tree, fast = build_kdtree(vertices, faces), SingleRays(vertices, faces, "kdtree")
    origin, direction = np.random.default_rng(8).standard_normal((2, 300, 3)).astype(np.float32)
    hits = fast.closest(origin, direction)
    for number in range(300):
        one = origin[number : number + 1], direction[number : number + 1]
        work = fast.counted(*one)[1]
        t_hit = float(hits.t[number]) if hits.face[number] >= 0 else 1e4
        visits, tests = walked_slowly(tree, *(part[0].astype(np.float64) for part in one), t_hit)
        assert visits <= work.node_visits <= visits + 2 * KD_DEPTH_MAX, number
        if hits.face[number] < 0:
            assert (work.node_visits, work.triangle_tests) == (visits, tests), number


@pytest.mark.parametrize("count", [2, 16, 70])
def test_limits_of_the_kd_tree(count: int) -> None:
    mesh = sphere_mesh(count)
    tree, count = build_kdtree(mesh.vertices, mesh.faces), len(mesh.faces)
    leaves = tree.nodes[tree.nodes["axis"] == 3]
    assert tree.depth <= KD_DEPTH_MAX
    held = tree.blocks[:, 36:].view(np.int32)
    assert set(np.unique(held)) - {-1} == set(range(count))  # none is lost
    # others are at the greatest depth, or fans that no plane parts at a gain
    assert (leaves["count"] <= LEAF_TRIANGLES).mean() > 0.85
    assert len(tree.nodes) == 2 * len(leaves) - 1


def test_the_first_plane_is_the_cheapest_of_the_candidates() -> None:
    vertices, faces = soup(300, 9)
    root = build_kdtree(vertices, faces).nodes[0]
    corners = vertices[faces].astype(np.float64)
    lower, upper = corners.min(axis=1), corners.max(axis=1)
    low, high = lower.min(axis=0), upper.max(axis=0)

    def surface(side: np.ndarray) -> float:
        return 2.0 * (side[0] * side[1] + side[1] * side[2] + side[2] * side[0])

    costs = {}
    for axis in range(3):
        for number in range(1, 33):
            plane = low[axis] + (high[axis] - low[axis]) * number / 33.0
            below, above = high - low, high - low
            below[axis], above[axis] = plane - low[axis], high[axis] - plane
            held = (lower[:, axis] < plane).sum() * surface(below) + (upper[:, axis] > plane).sum() * surface(above)
            costs[axis, plane] = 1.0 + held / surface(high - low)
    (axis, plane), _ = min(costs.items(), key=lambda item: item[1])
    assert (root["axis"], root["split"]) == (axis, np.float32(plane))


@pytest.mark.parametrize("scene", [catalog.load("fly-by"), effects.load("glass")], ids=["fly-by", "glass"])
def test_pictures_are_the_same_and_the_work_is_counted(scene) -> None:
    plan, pictures, work = SamplePlan(4), {}, {}
    for structure in STRUCTURES:
        renderer = Renderer(scene, packets=False, specialise=False, structure=structure, count_work=True)
        pictures[structure], counters = render_tiles(renderer, plan, range(9), (48, 48), 1.0)
        work[structure] = counters["triangle_tests"]
        renderer.close()
    for structure in STRUCTURES[1:]:
        assert torch.equal(pictures[structure], pictures["bvh"])
    if scene.name == "fly-by":
        assert 0 < work["kdtree"] < 0.1 * work["brute"] and 0 < work["bvh"] < 0.1 * work["brute"]


def test_what_cannot_be_asked_for() -> None:
    scene = effects.load("plain")
    with pytest.raises(ValueError, match="structure: expected one of bvh, kdtree, brute, warp, got 'octree'"):
        Renderer(scene, structure="octree")  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="count_work"):
        Renderer(scene, structure="warp", count_work=True)
