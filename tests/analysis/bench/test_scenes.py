"""Scenes and batches of the benchmark."""

from pathlib import Path

import numpy as np
import pytest
import torch

from analysis.bench.options import BenchOptions
from analysis.bench.scenes import bumpy_scene, bumpy_sphere, camera_rays, driving_scenes, in_rows, morton_batches
from renderer.trace import Renderer
from tsar.selection import sample_positions

SMALL = BenchOptions(Path("unused"), resolution_px=64, batch_size=6)


def test_batches_cover_the_picture_once_in_morton_order() -> None:
    batches = morton_batches(SMALL, 3.0)
    assert [batch.level.shape[0] for batch in batches] == [6, 5, 5]
    for batch in batches:
        assert torch.equal(batch.position, sample_positions(batch.level, batch.index, 16))
    assert [batch.time_s for batch in batches] == [0.5, 1.5, 2.5]
    everything = torch.cat([batch.position.reshape(-1, 2) for batch in batches])
    assert everything.unique(dim=0).shape[0] == everything.shape[0] == 64 * 64


def test_rows_hold_the_same_samples_from_top_to_bottom() -> None:
    batch = morton_batches(SMALL, 3.0)[1]
    rows = in_rows(batch)
    x, y = rows.position.reshape(-1, 2).T
    key = y * 1000 + x
    assert (key.diff() > 0).all()
    assert torch.equal(
        key.sort().values, (batch.position[..., 1] * 1000 + batch.position[..., 0]).flatten().sort().values
    )
    assert rows.time_s == batch.time_s


@pytest.mark.parametrize("subdivisions", [2, 4])
def test_the_mesh_is_closed_and_faces_outwards(subdivisions: int) -> None:
    mesh = bumpy_sphere(subdivisions)
    assert len(mesh.faces) == 20 * 4**subdivisions
    edges = np.sort(mesh.faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    assert (np.unique(edges, axis=0, return_counts=True)[1] == 2).all()
    a, b, c = (mesh.vertices[mesh.faces[:, corner]] for corner in range(3))
    assert (np.einsum("ij,ij->i", np.cross(b - a, c - a), a + b + c) > 0.0).all()
    radius = np.linalg.norm(mesh.vertices, axis=1)
    assert radius.min() < 0.96 and radius.max() > 1.04


def test_rays_of_the_benchmark_are_the_camera_s() -> None:
    """A picture made of the rays' hits on the sphere's outline is our renderer's."""
    import trimesh

    scene, mesh = bumpy_scene(3), bumpy_sphere(3)
    batches = morton_batches(SMALL, 0.0)
    renderer = Renderer(scene, threads=1)
    origin, direction = camera_rays(batches[0])
    surface = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)
    hit = surface.ray.intersects_any(origin, direction)
    shaded = renderer.trace(batches[0]).color.reshape(-1, 3).numpy().sum(axis=1) > 0.0
    assert 0.5 < hit.mean() < 0.95
    # what is hit may lie in shadow, what is missed is black
    assert not (shaded & ~hit).any() and (shaded & hit).mean() > 0.5 * hit.mean()


def test_scenes_are_those_asked_for() -> None:
    assert list(driving_scenes(BenchOptions(scenes=("chase",)))) == ["chase"]
    with pytest.raises(ValueError, match="nonsense"):
        driving_scenes(BenchOptions(scenes=("nonsense",)))
