"""The tree of boxes over instances."""

import numpy as np
import pytest

from renderer.tables.hierarchy import box_tree
from scenes.canonical import Emissive, Instance, PerspectiveCamera, Scene, Sphere
from tests.oracles.brute_force_tracer import camera_rays, track_matrix
from tests.renderer.builders import colors, grid, look_at, place, turning_track


def _boxes(count: int, spread: float) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(count)
    center, half = spread * rng.normal(size=(count, 3)), rng.uniform(0.1, 1.0, (count, 3))
    return center - half, center + half


@pytest.mark.parametrize("count", [1, 2, 3, 17, 100])
@pytest.mark.parametrize("spread", [0.0, 1.0, 20.0])
def test_layout(count: int, spread: float) -> None:
    """Every item once; a subtree ends behind what lies in its box, and nowhere else."""
    lower, upper = _boxes(count, spread)
    nodes = box_tree(lower, upper, 1e4)
    assert sorted(node.item for node in nodes if node.item >= 0) == list(range(count))
    for index, node in enumerate(nodes):
        assert index < node.skip <= len(nodes)
        below = [inner for inner in nodes[index : node.skip] if inner.item >= 0]
        if node.item >= 0:
            assert node.skip == index + 1
            assert (node.lower == lower[node.item]).all() and (node.upper == upper[node.item]).all()
        else:
            assert len(below) > 1
            assert (node.lower == np.min([b.lower for b in below], axis=0)).all()
            assert (node.upper == np.max([b.upper for b in below], axis=0)).all()
        assert all(inner.skip <= node.skip for inner in nodes[index : node.skip])


def test_boxes_that_spare_nothing_are_left_out() -> None:
    lower, upper = np.zeros((4, 3)), np.ones((4, 3))
    assert [node.item >= 0 for node in box_tree(lower, upper, 3.0)] == [True] * 4
    assert box_tree(lower, upper, 300.0)[0].item == -1


def test_nested_and_equal_boxes_end() -> None:
    size = 2.0 ** -np.arange(900.0)[:, None] * np.ones(3)
    assert sum(node.item >= 0 for node in box_tree(-size, size, 1.0)) == 900
    assert len(box_tree(np.zeros((500, 3)), np.zeros((500, 3)), 1.0)) >= 500


@pytest.mark.parametrize("moving", [False, True])
def test_many_spheres_are_found(moving: bool) -> None:
    rng = np.random.default_rng(2)
    center, radius = rng.normal(size=(200, 3)), rng.uniform(0.02, 0.2, 200)
    track = turning_track(1, keys=1) if moving else None
    shapes = [
        Instance(Sphere(r), Emissive((i + 1.0, 0, 0)), place(c), track)
        for i, (c, r) in enumerate(zip(center, radius, strict=True))
    ]
    scene = Scene(PerspectiveCamera(look_at((0.5, 1.0, 6.0), (0, 0, 0)), 40.0), tuple(shapes))
    position = grid(48).astype(np.float32).astype(np.float64)
    origin, direction = camera_rays(scene, position, 0.0)
    if moving:
        center = center @ track_matrix(track, 0.0)[:3, :3].T + track_matrix(track, 0.0)[:3, 3]
    offset = origin[:, None] - center
    b = np.einsum("ijk,ik->ij", offset, direction)
    root = b * b - (offset**2).sum(-1) + radius**2
    with np.errstate(invalid="ignore"):
        t = np.where(root >= 0, -b - np.sqrt(root), np.inf)
    expected = np.where(np.isfinite(t.min(1)), t.argmin(1) + 1, 0)
    assert (colors(scene, position)[:, 0] != expected).sum() <= 3
    assert (expected > 0).mean() > 0.3
