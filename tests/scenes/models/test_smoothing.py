"""Normals for meshes without any: flat, smooth up to an angle, and of PLY with colours."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh

from scenes.canonical import ConstantTexture, Instance, Mesh, Phong
from scenes.models import place_model, read_model
from scenes.models.smoothing import corner_normals, smoothed

BOX = trimesh.creation.box()
CORNERS = np.asarray(BOX.vertices, np.float64)[np.asarray(BOX.faces)]


def test_an_angle_decides_which_edges_are_smooth() -> None:
    flat = np.cross(CORNERS[:, 1] - CORNERS[:, 0], CORNERS[:, 2] - CORNERS[:, 0])
    expected = np.repeat(flat[:, None] / np.linalg.norm(flat, axis=1)[:, None, None], 3, axis=1)
    for angle in (0.0, 80.0):
        assert corner_normals(CORNERS, angle) == pytest.approx(expected, abs=1e-6)
    round_ones = corner_normals(CORNERS, 100.0)
    outwards = CORNERS / np.linalg.norm(CORNERS, axis=2, keepdims=True)
    assert (round_ones * outwards).sum(axis=2).min() > 0.8
    assert np.linalg.norm(round_ones, axis=2) == pytest.approx(np.ones((12, 3)))


def test_a_sphere_has_the_normals_of_a_sphere() -> None:
    ball = trimesh.creation.icosphere(3)
    corners = np.asarray(ball.vertices, np.float64)[np.asarray(ball.faces)]
    assert corner_normals(corners, 60.0) == pytest.approx(corners, abs=0.02)


def test_triangles_without_area_have_normals_too() -> None:
    assert corner_normals(np.zeros((1, 3, 3)), 90.0).tolist() == [[[0.0, 0.0, 1.0]] * 3]


def test_meshes_with_normals_stay_and_shared_ones_are_made_once(tmp_path: Path) -> None:
    plain = Mesh(np.asarray(BOX.vertices, np.float32), np.asarray(BOX.faces, np.int32))
    grey = Phong(ConstantTexture((0.5, 0.5, 0.5)))
    kept = Mesh(plain.vertices, plain.faces, np.tile(np.float32((0, 0, 1)), (8, 1)))
    parts = smoothed([Instance(plain, grey), Instance(plain, grey), Instance(kept, grey)], 95.0)
    assert parts[0].shape is parts[1].shape and parts[2].shape is kept
    assert parts[0].shape.normals is not None and len(parts[0].shape.vertices) == 8
    BOX.export(tmp_path / "box.stl")
    assert read_model(tmp_path / "box.stl")[0].shape.normals is None
    assert place_model(tmp_path / "box.stl", np.eye(4), smooth_deg=95.0)[0].shape.normals is not None


def test_colours_of_ply(tmp_path: Path) -> None:
    """Whole numbers in text, where none is above 1, and lists besides the corners."""
    text = "ply\nformat ascii 1.0\nelement vertex 3\n" + "".join(f"property float {axis}\n" for axis in "xyz")
    text += "".join(f"property uchar {name}\n" for name in ("red", "green", "blue"))
    text += "element face 1\nproperty list uchar int vertex_indices\nend_header\n"
    path = tmp_path / "a.ply"
    path.write_text(text + "0 0 0 1 1 1\n1 0 0 1 1 1\n0 1 0 1 1 1\n3 0 1 2\n")
    assert read_model(path)[0].material.diffuse.value == pytest.approx((1 / 255 / 12.92,) * 3)
    path.write_text(text + "0 0 0 255 0 0\n1 0 0 0 255 0\n0 1 0 0 0 255\n3 0 1 2\n")
    texels = read_model(path)[0].material.diffuse.image.reshape(-1, 3).tolist()
    assert all(color in texels for color in ([1, 0, 0], [0, 1, 0], [0, 0, 1]))


def test_ply_faces_may_have_texture_coordinates_of_their_own(tmp_path: Path) -> None:
    head = "ply\nformat binary_little_endian 1.0\nelement vertex 3\nproperty float x\nproperty float y\n"
    head += "property float z\nelement face 1\nproperty list uchar float texcoord\n"
    head += "property list uchar int vertex_indices\nend_header\n"
    body = np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0)], "<f4").tobytes()
    body += bytes([6]) + np.zeros(6, "<f4").tobytes() + bytes([3]) + np.array([0, 1, 2], "<i4").tobytes()
    path = tmp_path / "a.ply"
    path.write_bytes(head.encode() + body)
    assert read_model(path)[0].shape.faces.tolist() == [[0, 1, 2]]
