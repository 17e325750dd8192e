"""OBJ and MTL: options of maps, several libraries, encodings, illumination, smoothing groups."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import OpenEXR
import pytest
from PIL import Image

from renderer import render
from scenes.canonical import ConstantTexture, Emissive, Glass, Instance, Masked, NormalMapped, Phong, SceneError
from scenes.catalog import Look
from scenes.formats.appearance.folding import mean_of
from scenes.formats.losses import LossReport
from scenes.models import read_model
from scenes.models.mtl_files import map_of
from tests.scenes.models.files import CASES

SQUARE = "v -1 -1 0\nv 1 -1 0\nv 1 1 0\nv -1 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n"
FACE = "f 1/1 2/2 3/3 4/4\n"
ROOF = "v -1 0 0\nv 0 0 1\nv 0 1 1\nv -1 1 0\nv 1 0 0\nv 1 1 0\n"
"""Two squares that meet in the edge from the second to the third point."""


def model(folder: Path, library: str | bytes, text: str = "") -> Path:
    content = library if isinstance(library, bytes) else library.encode()
    (folder / "in.mtl").write_bytes(content)
    path = folder / "in.obj"
    path.write_text("mtllib in.mtl\n" + SQUARE + (text or "usemtl a\n" + FACE))
    return path


def test_a_map_with_options_is_read() -> None:
    (part,) = read_model(CASES / "map-options" / "in.obj")
    texture = part.material.diffuse
    assert texture.image.shape[2] == 3 and texture.uv_scale == (2.0, 2.0) and texture.wrap == "clamp"


@pytest.mark.parametrize(
    ("line", "name", "options"),
    [
        ("t.png", "t.png", {}),
        ("-s 2 2 1 -o 0.5 -clamp on old bricks.png", "old bricks.png", {"-s": 3, "-o": 1, "-clamp": 1}),
        ("-s 2 7", "7", {"-s": 1}),
        ("-bm 0.2 -mm 0 1 C:\\maps\\t.png", "C:\\maps\\t.png", {"-bm": 1, "-mm": 2}),
        ("-blendu on -type sphere  two  blanks.png", "two  blanks.png", {"-blendu": 1, "-type": 1}),
    ],
)
def test_options_end_where_the_name_begins(line: str, name: str, options: dict[str, int]) -> None:
    found = map_of(line)
    assert found.name == name and {option: len(values) for option, values in found.options.items()} == options


def test_options_change_coordinates_and_values_or_are_reported(tmp_path: Path) -> None:
    Image.new("RGB", (2, 2), (255, 0, 255)).save(tmp_path / "t.png")
    report = LossReport()
    path = model(tmp_path, "newmtl a\nmap_Kd -o 0.25 0.5 -mm 0.5 0.25 -cc on C:\\maps\\t.png\nmap_Ks t.png\n")
    texture = read_model(path, report)[0].material.diffuse
    assert texture.uv_offset == (0.25, 0.5) and texture.image[0, 0] == pytest.approx((0.75, 0.5, 0.75))
    assert "the option -cc" in report.text() and "map_ks" in report.text()


@pytest.mark.parametrize("line", ["mtllib first.mtl second.mtl", "mtllib first.mtl\nmtllib second.mtl",
                                  "mtllib my own.mtl\nmtllib second.mtl"])  # fmt: skip
def test_several_libraries(line: str, tmp_path: Path) -> None:
    for name in ("first.mtl", "my own.mtl"):
        (tmp_path / name).write_text("newmtl a\nKd 1 0 0\n")
    (tmp_path / "second.mtl").write_text("newmtl a\nKd 0 1 0\nnewmtl b\nKd 0 0 1\n")
    path = tmp_path / "in.obj"
    path.write_text(f"{line}\n{SQUARE}usemtl a\n{FACE}usemtl b\n{FACE}usemtl gone\n{FACE}")
    report = LossReport()
    parts = read_model(path, report)
    colors = [part.material.diffuse.value for part in parts]
    assert colors == [(1.0, 0.0, 0.0), (0.0, 0.0, 1.0), (0.5, 0.5, 0.5)]
    assert "in/gone: a material that no library has: grey" in report.text()


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16", "latin-1"])
def test_any_encoding(encoding: str, tmp_path: Path) -> None:
    Image.new("RGB", (2, 2), (255, 255, 255)).save(tmp_path / "grün.png")
    path = model(tmp_path, "newmtl wände\r\nmap_Kd grün.png\r\n".encode(encoding))
    path.write_bytes(f"mtllib in.mtl\n# ä\n{SQUARE}usemtl wände\n{FACE}".encode(encoding))
    (part,) = read_model(path)
    assert part.material.diffuse.image.shape == (2, 2, 3) and part.name == "in/wände"


@pytest.mark.parametrize(
    ("lines", "expected"),
    [
        ("illum 0", Emissive((0.5, 0.25, 0.0))),
        ("illum 1\nKs 1 1 1\nNs 50", Phong(ConstantTexture((0.5, 0.25, 0.0)))),
        ("illum 2\nKs 0.5 0.5 0.5\nNs 50", Phong(ConstantTexture((0.5, 0.25, 0.0)), (0.5, 0.5, 0.5), 50.0)),
        ("illum 4\nTf 0.5 1 1", Glass(transmittance=ConstantTexture((0.5, 1.0, 1.0)), thin=True)),
        ("illum 7\nNi 1.33", Glass(transmittance=ConstantTexture((1.0, 1.0, 1.0)), ior=1.33)),
        ("d 0.25", Glass(transmittance=ConstantTexture((0.875, 0.8125, 0.75)), thin=True)),
        ("Tr 0.75", Glass(transmittance=ConstantTexture((0.875, 0.8125, 0.75)), thin=True)),
        ("d 1.0", Phong(ConstantTexture((0.5, 0.25, 0.0)))),
        ("Ke 0 3 0", Emissive((0.0, 3.0, 0.0))),
        ("Ke 0 0 0", Phong(ConstantTexture((0.5, 0.25, 0.0)))),
    ],
)
def test_illumination_opacity_and_emission(lines: str, expected: object, tmp_path: Path) -> None:
    assert read_model(model(tmp_path, f"newmtl a\nKd 0.5 0.25 0\n{lines}\n"))[0].material == expected


@pytest.mark.parametrize(("kind", "grazing"), [(3, 0.4), (5, 1.0)])
def test_mirrors(kind: int, grazing: float, tmp_path: Path) -> None:
    material = read_model(model(tmp_path, f"newmtl a\nKd 0.5 0.5 0.5\nKs 0.4 0.2 0\nNs 9\nillum {kind}\n"))[0].material
    assert (material.fresnel_min, material.fresnel_max) == (0.4, grazing)
    assert material.mirror_tint == pytest.approx((1.0, 0.5, 0.0))


def test_metal_of_the_extension_and_colours_of_one_number(tmp_path: Path) -> None:
    metal = read_model(model(tmp_path, "newmtl a\nKd 0.5\nPm 1\nPr 0.1\n"))[0].material
    assert metal.fresnel_min == 1.0 and metal.mirror_tint == (0.5, 0.5, 0.5)


def test_faces_without_normals_are_flat_but_in_smoothing_groups(tmp_path: Path) -> None:
    path = tmp_path / "in.obj"
    faces = "f 1 2 3 4\nf 2 5 6 3\n"
    path.write_text(ROOF + faces)
    assert read_model(path)[0].shape.normals is None
    path.write_text(ROOF + "s 1\n" + faces)
    (part,) = read_model(path)
    ridge = np.abs(part.shape.vertices[:, 0]) < 0.5
    assert part.shape.normals[ridge] == pytest.approx(np.tile((0.0, 0.0, 1.0), (ridge.sum(), 1)), abs=1e-6)
    path.write_text(ROOF + "s 1\nf 1 2 3 4\ns 2\nf 2 5 6 3\n")
    (part,) = read_model(path)
    assert np.abs(part.shape.normals[:, 0]) == pytest.approx(np.full(len(part.shape.normals), np.sqrt(0.5)))


def test_normals_of_the_file_are_kept_corner_by_corner(tmp_path: Path) -> None:
    path = tmp_path / "in.obj"
    path.write_text(SQUARE + "vn 0 0 2\nvn 0 1 0\nf 1//1 2//1 3//2\nf -4/-4/-2 3 4\n")
    mesh = read_model(path)[0].shape
    normals = [mesh.normals[face].tolist() for face in mesh.faces]
    assert normals == [[[0, 0, 1], [0, 0, 1], [0, 1, 0]], [[0, 0, 1]] * 3]
    assert mesh.vertices[mesh.faces[1]].tolist() == [[-1, -1, 0], [1, 1, 0], [-1, 1, 0]]


def test_colours_behind_vertices(tmp_path: Path) -> None:
    path = tmp_path / "in.obj"
    path.write_text("v 0 0 0 1 0 0\nv 1 0 0 1 0 0\nv 0 1 0 1 0 0\nf 1 2 3\n")
    assert read_model(path)[0].material == Phong(ConstantTexture((1.0, 0.0, 0.0)))


@pytest.mark.parametrize(("text", "message"), [
    ("f 1 2 x\n", "expected indices of a corner, got 'x'"), ("f 1 2 0\n", "a face refers to '0'"),
    ("f 1 2 -9\n", "a face refers to"), ("v 1 x 2\nf 1 2 3\n", "could not convert"),
    ("v 1\nf 1 2 3\n", "3 to 8 numbers"),
])  # fmt: skip
def test_faults_are_named_in_one_line(text: str, message: str, tmp_path: Path) -> None:
    path = tmp_path / "in.obj"
    path.write_text(SQUARE + text)
    with pytest.raises(SceneError, match=message):
        read_model(path)
    (tmp_path / "in.mtl").write_text("newmtl a\nKd 1 x 1\n")
    path.write_text("mtllib in.mtl\n" + SQUARE + "usemtl a\n" + FACE)
    with pytest.raises(SceneError, match="material a: expected a number, got 'x'"):
        read_model(path)


def test_of_a_library_only_what_faces_have_is_read(tmp_path: Path) -> None:
    """Wrong numbers and images that are missing do not matter in other materials."""
    (tmp_path / "in.mtl").write_text("newmtl b\nKd 1 x 1\nnewmtl c\nmap_Kd none.png\nnewmtl a\nKd 1 0 0\n")
    (tmp_path / "in.obj").write_text("mtllib in.mtl\n" + SQUARE + "usemtl a\n" + FACE)
    report = LossReport()
    (part,) = read_model(tmp_path / "in.obj", report)
    assert part.material.diffuse.value == (1.0, 0.0, 0.0)
    assert not report.losses


def test_faces_of_fewer_than_three_corners_are_a_loss(tmp_path: Path) -> None:
    path, report = tmp_path / "in.obj", LossReport()
    path.write_text(SQUARE + "f 1 2\nf\nf -1\n" + FACE)
    (part,) = read_model(path, report)
    assert len(part.shape.faces) and "in: faces of fewer than three corners (3): left out" in report.text()
    path.write_text(SQUARE + "f 1 2\n")
    with pytest.raises(SceneError, match="expected at least one face"):
        read_model(path)


def area(part: Instance) -> float:
    corners = part.shape.vertices[part.shape.faces]
    return 0.5 * np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1).sum()


@pytest.mark.parametrize(
    ("points", "expected"),
    [([(0, 0), (2, 0), (2, 1), (1, 1), (1, 2), (0, 2)], 3.0), ([(0.5, 1), (0, 0), (2, 1), (0, 2)], 1.5)],
)
@pytest.mark.parametrize("first", [0, 1, 2])
def test_concave_polygons_are_covered_once(points: list, expected: float, first: int, tmp_path: Path) -> None:
    path = tmp_path / "in.obj"
    corners = (np.roll(np.arange(len(points)), first) + 1).tolist()
    path.write_text("".join(f"v {x} {y} 0\n" for x, y in points) + f"f {' '.join(map(str, corners))}\n")
    (part,) = read_model(path)
    assert len(part.shape.faces) == len(points) - 2 and area(part) == pytest.approx(expected)


def test_comments_at_ends_of_lines_and_quoted_libraries(tmp_path: Path) -> None:
    (tmp_path / "in.mtl").write_text("newmtl a#1\nKd 1 0 0\n")
    path = tmp_path / "in.obj"
    path.write_text('mtllib "in.mtl"\n' + SQUARE.replace("\n", " # a line\n") + "usemtl a#1\nf 1 2 3 4# a face\n")
    (part,) = read_model(path)
    assert area(part) == pytest.approx(4.0) and part.material.diffuse == ConstantTexture((1.0, 0.0, 0.0))


def test_names_of_files_may_differ_in_case(tmp_path: Path) -> None:
    (tmp_path / "Maps").mkdir()
    Image.new("RGB", (2, 2), (255, 0, 255)).save(tmp_path / "Maps" / "Bricks.PNG")
    path = model(tmp_path, "newmtl a\nmap_Kd -colorspace sRGB Maps\\bricks.png\n")
    (tmp_path / "in.mtl").rename(tmp_path / "IN.MTL")
    report = LossReport()
    assert read_model(path, report)[0].material.diffuse.image.shape == (2, 2, 3)
    assert "the option -colorspace" in report.text()


def test_opacity_and_normal_maps_along_paths(tmp_path: Path) -> None:
    Image.new("RGBA", (2, 2), (255, 255, 255, 51)).save(tmp_path / "alpha.png")
    Image.new("L", (2, 2), 102).save(tmp_path / "grey.png")
    Image.new("RGB", (2, 2), (255, 128, 128)).save(tmp_path / "bent.png")
    Image.new("RGB", (2, 2), (255, 128, 128)).save(tmp_path / "kd.png")
    half = np.full((2, 2), 0.25, np.float32)
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    OpenEXR.File(header, dict.fromkeys("RGBA", half)).write(str(tmp_path / "alpha.exr"))
    for line, opacity in (("d 0.5", 0.5), ("map_d alpha.exr", 0.25), ("map_d alpha.png", 0.2), ("map_d grey.png", 0.4),
                          ("map_d -imfchan l alpha.png", 1.0), ("map_d -imfchan m grey.png", 1.0),
                          ("map_d -imfchan g bent.png", 128 / 255), ("d 0.5\nmap_d grey.png", 0.2)):  # fmt: skip
        report = LossReport()
        (part,) = read_model(model(tmp_path, f"newmtl a\nmap_Kd kd.png\n{line}\n"), report, facets=True)
        assert isinstance(part.material, Masked) and isinstance(part.material.base, Phong) and not report.losses
        assert mean_of(part.material.opacity) == pytest.approx((opacity,) * 3, abs=1e-3)
    (part,) = read_model(model(tmp_path, "newmtl a\nnorm -bm 0.5 bent.png\n"), facets=True)
    assert isinstance(part.material, NormalMapped) and part.material.scale == 0.5
    assert mean_of(part.material.normals) == pytest.approx((1.0, 128 / 255, 128 / 255)), "numbers, not colours"
    (tmp_path / "broken.png").write_bytes(b"no picture")
    with pytest.raises(SceneError, match="broken.png: cannot be read"):
        read_model(model(tmp_path, "newmtl a\nmap_d -imfchan m broken.png\n"), facets=True)
    report = LossReport()
    read_model(model(tmp_path, "newmtl a\nmap_d -imfchan z grey.png\n"), report, facets=True)
    assert "the option -imfchan of grey.png" in report.text()
    # the pane stops half of the light
    look = Look(camera=(0, 0, 5, 0, 0, 0), integrator="path", fov_deg=10.0)
    path = model(tmp_path, "newmtl a\nKd 0 0 0\nd 0.5\n")
    assert render(path, 16, samples_per_pixel=64, look=look).mean() == pytest.approx(0.75 / 2, abs=0.03)
