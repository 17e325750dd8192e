"""What PLY, STL and OBJ files of other programs hold beside their shape."""

from __future__ import annotations

import struct
from pathlib import Path

import pytest
from PIL import Image

from scenes.canonical import ImageTexture, SceneError
from scenes.formats.geometry import ply_files
from scenes.formats.losses import LossReport
from scenes.models import read_model

VERTICES = "element vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
FACES = "element face 1\nproperty list uchar int vertex_indices\n"
POINTS = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n"


def ply(folder: Path, header: str, body: str) -> Path:
    path = folder / "in.ply"
    path.write_text(f"ply\nformat ascii 1.0\n{header}end_header\n{body}")
    return path


def test_a_picture_that_a_ply_file_names_is_drawn(tmp_path: Path) -> None:
    """MeshLab names it in a comment."""
    header = "comment TextureFile my t.png\n" + VERTICES + "property float s\nproperty float t\n" + FACES
    path, report = ply(tmp_path, header, "0 0 0 0 0\n1 0 0 1 0\n1 1 0 1 1\n3 0 1 2\n"), LossReport()
    read_model(path, report)
    assert "the picture 'my t.png', which is missing: grey" in report.text()
    Image.new("RGB", (2, 2), (255, 0, 0)).save(tmp_path / "my t.png")
    report = LossReport()
    (part,) = read_model(path, report)
    assert isinstance(part.material.diffuse, ImageTexture) and not report.losses
    assert part.material.diffuse.image[0, 0].tolist() == [1.0, 0.0, 0.0]


def test_what_a_ply_file_has_for_its_faces_is_said(tmp_path: Path) -> None:
    header = (
        "comment TextureFile t.png\n" + VERTICES + FACES + "property uchar red\nproperty list uchar float texcoord\n"
    )
    report = LossReport()
    read_model(ply(tmp_path, header, "0 0 0\n1 0 0\n1 1 0\n3 0 1 2 255 6 0 0 1 0 1 1\n"), report)
    assert "colours of faces" in report.text()
    assert "the picture 't.png', for which vertices have no coordinates: grey" in report.text()


def test_colours_of_stl_are_a_loss(tmp_path: Path) -> None:
    triangle = struct.pack("<12fH", 0, 0, 1, 0, 0, 0, 1, 0, 0, 1, 1, 0, 0x801F)
    report = LossReport()
    path = tmp_path / "in.stl"
    path.write_bytes(b"COLOR=\xff\0\0\xff".ljust(80, b"\0") + struct.pack("<I", 1) + triangle)
    (part,) = read_model(path, report)
    assert len(part.shape.faces) == 1 and "colours of an STL file: grey" in report.text()


@pytest.mark.parametrize("end", ["\n", "\r\n"])
@pytest.mark.parametrize("text", [POINTS + "f 1 2 \\ \n3 4\n", "# C:\\models\\\n" + POINTS + "f 1 2\\\n 3 4\n"])
def test_lines_go_on_behind_a_backslash_but_for_comments(text: str, end: str, tmp_path: Path) -> None:
    path = tmp_path / "in.obj"
    path.write_bytes(text.replace("\n", end).encode())
    (part,) = read_model(path)
    assert len(part.shape.faces) == 2


def test_lines_of_a_library_go_on_too(tmp_path: Path) -> None:
    (tmp_path / "in.mtl").write_bytes(b"# D:\\\r\nnewmtl a\r\nKd 1 \\\r\n0 0\r\n")
    (tmp_path / "in.obj").write_text("mtllib in.mtl\n" + POINTS + "usemtl a\nf 1 2 3\n")
    (part,) = read_model(tmp_path / "in.obj")
    assert part.material.diffuse.value == (1.0, 0.0, 0.0)


@pytest.mark.parametrize("count", [0, 0xFFFFFFFF])
@pytest.mark.parametrize("header", [b"\0", b" "])
def test_an_stl_file_that_does_not_count_its_triangles_has_those_it_holds(
    count: int, header: bytes, tmp_path: Path
) -> None:
    triangle = struct.pack("<12fH", 0, 0, 1, 0, 0, 0, 1, 0, 0, 1, 1, 0, 0)
    path, report = tmp_path / "in.stl", LossReport()
    path.write_bytes(header * 80 + struct.pack("<I", count) + triangle * 2 + b"rest")
    (part,) = read_model(path, report)
    assert len(part.shape.faces) == 2
    assert f"a header that counts {count} triangles: the 2 of the file" in report.text()
    path.write_bytes(header * 80 + struct.pack("<I", 0))
    with pytest.raises(SceneError):
        read_model(path)


@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
def test_lines_of_ply_end_as_on_any_system(end: str, tmp_path: Path) -> None:
    """The first coordinate of the binary file starts with the byte of a line feed."""
    head = f"ply\nformat binary_little_endian 1.0\n{VERTICES}{FACES}end_header\n"
    first = struct.unpack("<f", b"\x0a\x0a\x80\x3f")[0]
    body = struct.pack("<9fB3i", first, 0, 0, 1, 0, 0, 1, 1, 0, 3, 0, 1, 2)
    (tmp_path / "in.ply").write_bytes(head.replace("\n", end).encode() + body)
    (part,) = read_model(tmp_path / "in.ply")
    assert part.shape.vertices[0, 0] == pytest.approx(first)
    text = f"ply\nformat ascii 1.0\n{VERTICES}{FACES}end_header\n0 0 0\n1 0 0\n1 1 0\n3 0 1 2\n"
    (tmp_path / "in.ply").write_bytes(text.replace("\n", end).encode())
    (part,) = read_model(tmp_path / "in.ply")
    assert len(part.shape.faces) == 1


def test_every_property_of_ply_that_is_not_read_is_said(tmp_path: Path) -> None:
    header = VERTICES + "property uchar alpha\nproperty float quality\n" + FACES
    header += "property int material_index\nelement edge 1\nproperty int vertex1\nproperty int vertex2\n"
    header += "element material 1\nproperty uchar ambient_red\n"
    body = "0 0 0 {} 1\n1 0 0 255 1\n1 1 0 255 1\n3 0 1 2 0\n0 1\n7\n"
    report = LossReport()
    read_model(ply(tmp_path, header, body.format(10)), report)
    assert {loss.what: loss.picture for loss in report.losses} == {
        "the property 'alpha' of 'vertex'": True,
        "the property 'quality' of 'vertex'": False,
        "the property 'material_index' of 'face'": True,
        "1 elements of the kind 'edge'": False,
        "1 elements of the kind 'material'": True,
    }
    report = LossReport()
    read_model(ply(tmp_path, header, body.format(255)), report)
    assert "alpha" not in report.text()  # it is opaque


def test_the_header_of_a_ply_file_is_read_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    calls = []
    found = ply_files.header_of
    monkeypatch.setattr(ply_files, "header_of", lambda *given: calls.append(given) or found(*given))
    header = VERTICES + "property uchar red\nproperty uchar green\nproperty uchar blue\n" + FACES
    read_model(ply(tmp_path, header, "0 0 0 1 2 3\n1 0 0 1 2 3\n1 1 0 1 2 3\n3 0 1 2\n"))
    assert len(calls) == 1
