"""PLY files: valid files are read, and false headers are refused before anything is allocated."""

from __future__ import annotations

import struct

import numpy as np
import pytest
import trimesh

from scenes.canonical import Mesh, SceneError
from scenes.formats.geometry.ply_files import read_ply
from scenes.formats.geometry.ply_writing import ply_bytes
from scenes.formats.losses import LossReport

ASCII = b"""ply
format ascii 1.0
comment made by hand
element vertex 5
property float x
property float y
property float z
element face 2
property list uchar int vertex_indices
end_header
0 0 0
1 0 0
1 1 0
0 1 0
0 0 1
4 0 1 2 3
3 0 1 4
"""


def test_convex_polygons_are_fans() -> None:
    mesh = read_ply(ASCII, "a.ply", LossReport())
    np.testing.assert_array_equal(mesh.faces, [[0, 1, 2], [0, 2, 3], [0, 1, 4]])
    assert mesh.normals is None and mesh.uvs is None


@pytest.mark.parametrize(("order", "sign"), [("little", "<"), ("big", ">")])
def test_binary_with_faces_of_several_sizes(order: str, sign: str) -> None:
    header = ASCII[: ASCII.index(b"end_header")].replace(b"ascii", f"binary_{order}_endian".encode()) + b"end_header\n"
    points = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1]], sign + "f4").tobytes()
    faces = (
        b"\x04" + np.array([0, 1, 2, 3], sign + "i4").tobytes() + b"\x03" + np.array([0, 1, 4], sign + "i4").tobytes()
    )
    found, wanted = read_ply(header + points + faces, "a.ply", LossReport()), read_ply(ASCII, "a.ply", LossReport())
    np.testing.assert_array_equal(found.faces, wanted.faces)
    np.testing.assert_array_equal(found.vertices, wanted.vertices)


@pytest.mark.parametrize("parts", [(False, False), (True, False), (False, True), (True, True)])
def test_what_is_written_is_read_again_here_and_by_the_mesh_library(parts: tuple[bool, bool], tmp_path) -> None:
    rng = np.random.default_rng(1)
    normals = rng.standard_normal((9, 3)).astype(np.float32)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    uvs = rng.random((9, 2)).astype(np.float32)
    faces = rng.permuted(np.tile(np.arange(9), (7, 1)), axis=1)[:, :3].astype(np.int32)
    mesh = Mesh(rng.random((9, 3)).astype(np.float32), faces, normals if parts[0] else None, uvs if parts[1] else None)
    found = read_ply(ply_bytes(mesh), "a.ply", LossReport())
    np.testing.assert_array_equal(found.vertices, mesh.vertices)
    np.testing.assert_array_equal(found.faces, mesh.faces)
    for a, b in ((found.normals, mesh.normals), (found.uvs, mesh.uvs)):
        assert (a is None) == (b is None) and (a is None or b is None or np.allclose(a, b, atol=1e-6))
    (tmp_path / "a.ply").write_bytes(ply_bytes(mesh))
    other = trimesh.load_mesh(tmp_path / "a.ply", process=False)
    np.testing.assert_allclose(other.vertices, mesh.vertices)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (b"ply\n", b"plx\n", "expected a PLY file"),
        (b"vertex 5", b"vertex 4000000000", "expected 4000000000 of 'vertex' as its header says, got fewer"),
        (b"face 2", b"face 3", "expected 3 of 'face'"),
        (b"4 0 1 2 3", b"4 0 1 2 7", "expected indices from 0 to 4, got 7"),
        (b"4 0 1 2 3", b"4 0 1 2 -2", "expected indices from 0 to 4, got -2"),
        (b"4 0 1 2 3", b"2.5 0 1\n3 0 1 2", "expected a number of corners, got 2.5"),
        (b"4 0 1 2 3", b"-1 0 1\n3 0 1 2", "expected a number of corners, got -1"),
        (b"vertex_indices", b"corners", "expected a list of vertex indices in 'face'"),
        (b"0 0 1\n4", b"0 0 nan\n4", "expected finite vertices"),
        (b"0 0 1\n4", b"0 0 1e308\n4", "expected finite vertices"),
        (b"0 0 1\n4", b"0 0 x\n4", "expected numbers behind the PLY header"),
        (b"property float z", b"property floaty z", "expected a line of a PLY header"),
        (b"format ascii 1.0\n", b"", "expected a format"),
        (b"property float z\n", b"", "expected"),
        (b"end_header", b"end_head", "expected a PLY file"),
    ],
)
def test_files_that_are_not_what_they_say(old: bytes, new: bytes, message: str) -> None:
    assert old in ASCII
    with pytest.raises(SceneError, match=message):
        read_ply(ASCII.replace(old, new, 1), "a.ply", LossReport())


def test_binary_headers_that_lie() -> None:
    mesh = Mesh(np.eye(3, dtype=np.float32), np.array([[0, 1, 2]], np.int32))
    content = ply_bytes(mesh)
    for old, new in ((b"vertex 3", b"vertex 99999999999"), (b"face 1", b"face 99999999999"), (b"face 1", b"face 2")):
        with pytest.raises(SceneError, match="as its header says, got fewer"):
            read_ply(content.replace(old, new, 1), "a.ply", LossReport())
    for cut in range(len(content)):
        with pytest.raises(SceneError):
            read_ply(content[:cut], "a.ply", LossReport())


@pytest.mark.parametrize("order", ["ascii", "binary_little_endian", "binary_big_endian"])
def test_concave_polygons_are_covered_once(order: str) -> None:
    """An L, whose fan about its first corner would leave it, and a triangle."""
    points = [(0, 2), (0, 0), (2, 0), (2, 1), (1, 1), (1, 2)]
    faces = [(0, 1, 2, 3, 4, 5), (0, 1, 2)]
    head = f"ply\nformat {order} 1.0\nelement vertex 6\nproperty double x\nproperty short y\nproperty uchar z\n"
    head += "element face 2\nproperty list uchar ushort vertex_index\nend_header\n"
    if order == "ascii":
        rows = [f"{x} {y} 0" for x, y in points] + [f"{len(face)} {' '.join(map(str, face))}" for face in faces]
        body = "\n".join(rows).encode()
    else:
        sign = "<" if "little" in order else ">"
        body = b"".join(struct.pack(f"{sign}dhB", x, y, 0) for x, y in points)
        body += b"".join(struct.pack(f"{sign}B{len(face)}H", len(face), *face) for face in faces)
    mesh = read_ply(head.encode() + body, "a.ply", LossReport())
    corners = mesh.vertices[mesh.faces][..., :2].astype(np.float64)
    edges = corners[:, 1:] - corners[:, :1]
    areas = 0.5 * (edges[:, 0, 0] * edges[:, 1, 1] - edges[:, 0, 1] * edges[:, 1, 0])
    assert len(areas) == 5 and (areas > 0.0).all() and areas[:4].sum() == pytest.approx(3.0)
    np.testing.assert_array_equal(mesh.faces[4], [0, 1, 2])


@pytest.mark.parametrize("order", ["<", ">", ""])
def test_strips_of_triangles(order: str) -> None:
    """As in the models of Stanford: a negative index begins a strip anew, and every second triangle is turned over."""
    strips = [[0, 1, 2, 3, -1, 4, 5, 5, 6, 4, -1, 0, 1], [1, 2, 6]]
    form = {"<": "binary_little_endian", ">": "binary_big_endian", "": "ascii"}[order]
    head = f"ply\nformat {form} 1.0\nelement vertex 7\nproperty float x\nproperty float y\nproperty float z\n"
    head += f"element tristrips {len(strips)}\nproperty list int int vertex_indices\nend_header\n"
    points = np.random.default_rng(0).random((7, 3)).astype(np.float32)
    if order:
        rows = [np.array([len(strip), *strip], order + "i4").tobytes() for strip in strips]
        body = points.astype(order + "f4").tobytes() + b"".join(rows)
    else:
        lines = [*(" ".join(map(repr, row)) for row in points.astype(float).tolist())]
        body = "\n".join([*lines, *(" ".join(map(str, [len(one), *one])) for one in strips)]).encode()
    report = LossReport()
    mesh = read_ply(head.encode() + body, "a.ply", report)
    np.testing.assert_array_equal(mesh.faces, [[0, 1, 2], [2, 1, 3], [5, 6, 4], [1, 2, 6]])
    np.testing.assert_array_equal(mesh.vertices, points)
    assert not report.losses


def test_faces_of_few_corners_and_other_lists_are_losses() -> None:
    content = ASCII.replace(b"face 2", b"face 5").replace(b"4 0 1 2 3", b"0\n2 0 1\n4 0 1 2 3\n1 2")
    content = content.replace(
        b"end_header", b"element range_grid 2\nproperty list uchar int vertex_indices\nend_header"
    )
    report = LossReport()
    mesh = read_ply(content + b"1 0\n0\n", "a.ply", report)
    np.testing.assert_array_equal(mesh.faces, [[0, 1, 2], [0, 2, 3], [0, 1, 4]])
    assert [loss.what for loss in report.losses] == [
        "2 elements of the kind 'range_grid'", "faces of fewer than three corners (3)",
    ]  # fmt: skip


def test_a_polygon_of_many_corners() -> None:
    angle = 2.0 * np.pi * np.arange(100) / 100
    ring = "".join(f"{np.cos(a)} {np.sin(a)} 0\n" for a in angle)
    head = ASCII[: ASCII.index(b"end_header")].replace(b"vertex 5", b"vertex 100").replace(b"face 2", b"face 1")
    mesh = read_ply(
        head + b"end_header\n" + ring.encode() + b"100 " + " ".join(map(str, range(100))).encode(),
        "a.ply",
        LossReport(),
    )
    assert len(mesh.faces) == 98
