"""Large meshes, pictures and numbers of instances: the rows of small ones."""

import numpy as np
import pytest

from analysis.bench.large import CYCLES, cycle_config, cycle_row, instance_rows, instances, memory_row, mesh_rows
from analysis.bench.options import BenchOptions
from analysis.bench.scenes import bumpy_globe
from analysis.command.progress import Task
from renderer.tables import merging

OPTIONS = BenchOptions(only=("large",), resolution_px=64, batch_size=16, repetitions=7)


def test_the_globe_is_closed_and_faces_outwards() -> None:
    mesh = bumpy_globe(4000)
    assert 3500 < len(mesh.faces) < 4500
    corners = mesh.vertices[mesh.faces].astype(np.float64)
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert (np.einsum("ij,ij->i", normal, corners.mean(axis=1)) > 0.0).mean() > 0.98
    # the holes at the poles are tiny: the surface encloses the volume of a sphere with bumps
    volume = np.einsum("ij,ij->i", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])).sum() / 6.0
    assert volume == pytest.approx(4.0 / 3.0 * np.pi, rel=0.03)


def test_rows_of_meshes() -> None:
    pytest.importorskip("embreex")
    rows = {row.name: row for row in mesh_rows(OPTIONS, Task(), (1000, 4000))}
    size = f"{len(bumpy_globe(4000).faces):,} triangles"
    for name in ("building a tree", "camera rays", "random directions"):
        row = rows[f"{name}, {size}"]
        assert row.ours > 0.0 and row.peer and row.ratio and row.peer_name.startswith("Embree")
    assert "not installed" not in rows[f"camera rays, {size}"].note
    span = "1,000 to 4,000 triangles"
    assert rows[f"building trees of {span}"].peer_name == "limit"
    assert rows[f"camera rays through {span}"].note.startswith("1,000: ")


def test_memory_of_a_tree() -> None:
    row = memory_row(200_000)
    assert 60.0 < row.ours < 2000.0 and "the tree itself" in row.note


def test_instances_share_their_mesh(monkeypatch: pytest.MonkeyPatch) -> None:
    from renderer.trace import Renderer

    monkeypatch.setattr(merging, "COPIED_FACES_MAX", 0)  # as for meshes of a million triangles
    mesh = bumpy_globe(4000)
    one, many = (Renderer(instances(mesh, count), threads=1).buffers.data for count in (1, 16))
    assert one.tree_nodes.shape == many.tree_nodes.shape and one.tree_blocks.shape == many.tree_blocks.shape
    rows = list(instance_rows(OPTIONS, Task(), 1000, (1, 4)))
    assert [row.unit for row in rows] == ["exponent", "exponent", "M samples/s"]
    assert rows[2].ours > 0.0


def test_cycles_of_growing_pictures() -> None:
    row = cycle_row(OPTIONS, Task(), ((64, 4), (128, 16)))
    assert row.group == "large" and row.repetitions == 7 and row.note.startswith("4,096: ")


def test_cycles_of_the_measured_sizes_have_room_for_a_batch() -> None:
    for side, batch in CYCLES:
        config = cycle_config(side, batch)
        assert config.cache_size == 16 * batch and config.resolution_px == side
