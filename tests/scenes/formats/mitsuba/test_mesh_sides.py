"""Sides and normals of Mitsuba's mesh files, as Mitsuba 3 draws them."""

from __future__ import annotations

import itertools
import struct
import zlib
from pathlib import Path

import numpy as np
import pytest

from scenes.formats.conversion import load_scene_file
from scenes.formats.geometry.mesh_files import read_serialized
from tests.scenes.formats.files import drawn, seen

CAMERA = """<scene version="{version}"><integrator type="path"/><sensor type="perspective">
<float name="fov" value="{fov}"/>
<transform name="{to_world}"><{lookat} origin="{origin}" target="0,0,0" up="0,1,0"/></transform>
<film type="hdrfilm"><integer name="width" value="{width}"/><integer name="height" value="{height}"/></film></sensor>"""
OLD = {"to_world": "toWorld", "lookat": "lookAt", "flip": "flipNormals", "flat": "faceNormals"}
NEW = {"to_world": "to_world", "lookat": "lookat", "flip": "flip_normals", "flat": "face_normals"}
CORNERS = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]])
POINTS = np.array([[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]])
FACES = np.array([[4, 0, 2], [4, 2, 1], [4, 1, 3], [4, 3, 0], [5, 2, 0], [5, 1, 2], [5, 3, 1], [5, 0, 3]])


def ply(points: np.ndarray, faces: np.ndarray, normal: float | None = None) -> str:
    """A PLY file; ``normal`` is the z of its normals."""
    head = "".join(f"property float {name}\n" for name in ("x", "y", "z", *(["nx", "ny", "nz"] if normal else [])))
    rows = [" ".join(map(str, [*point, *([0, 0, normal] if normal else [])])) for point in points]
    rows += [f"{len(face)} " + " ".join(map(str, face)) for face in faces]
    counts = f"element vertex {len(points)}\n{head}element face {len(faces)}\n"
    return f"ply\nformat ascii 1.0\n{counts}property list uchar int vertex_indices\nend_header\n" + "\n".join(rows)


def obj(points: np.ndarray, faces: np.ndarray) -> str:
    rows = ["v " + " ".join(map(str, point)) for point in points]
    return "\n".join(rows + ["f " + " ".join(str(at + 1) for at in face) for face in faces]) + "\n"


@pytest.mark.parametrize("version", ["0.5.0", "3.0.0"])
def test_lamps_shine_on_the_side_that_mitsuba_gives_them(version: str, tmp_path: Path) -> None:
    """Sixteen lamps in a row: a reflection turns meshes inside out that have no normals of their own, or flat faces."""
    names, square = OLD if version == "0.5.0" else NEW, np.array([[0, 1, 2], [0, 2, 3]])
    (tmp_path / "q.obj").write_text(obj(CORNERS, square))
    (tmp_path / "q.ply").write_text(ply(CORNERS, square))
    (tmp_path / "n.ply").write_text(ply(CORNERS, square, 1.0))
    cases = list(itertools.product(("q.obj", "q.ply", "n.ply"), (1, -1), ("false", "true"), ("false", "true")))
    head = {"fov": 2.0 * np.degrees(np.arctan(len(cases) / 100)), "width": 4 * len(cases), "height": 4}
    text = CAMERA.format(version=version, origin="0,0,100", **head, **names)
    for number, (file, side, flip, flat) in enumerate(cases):
        place = f'<scale x="0.8" y="0.8" z="{side}"/><translate x="{2 * number - len(cases) + 1}"/>'
        text += f'<shape type="{file[2:]}"><string name="filename" value="{file}"/>'
        text += (
            f'<transform name="{names["to_world"]}">{place}</transform><boolean name="{names["flip"]}" value="{flip}"/>'
        )
        text += (
            f'<boolean name="{names["flat"]}" value="{flat}"/><bsdf type="diffuse"><rgb name="reflectance" value="0"/>'
        )
        text += '</bsdf><emitter type="area"><rgb name="radiance" value="1"/></emitter></shape>'
    (tmp_path / "b.xml").write_text(text + "</scene>")
    size = 4 * len(cases), 4
    wanted, found = (
        picture[1:3].reshape(2, len(cases), 4, 3)[:, :, 1:3].mean((0, 2, 3)) > 0.5
        for picture in (
            seen("mitsuba", tmp_path / "b.xml", size, 4),
            drawn(load_scene_file(tmp_path / "b.xml"), "mitsuba", tmp_path, size, 4),
        )
    )
    assert wanted.sum() == len(cases) // 2
    assert found.tolist() == wanted.tolist(), [case for case, a, b in zip(cases, wanted, found, strict=True) if a != b]


def serialized() -> bytes:
    body = struct.pack("<I", 0x1010) + b"name\0" + struct.pack("<QQ", len(POINTS), len(FACES))
    body += POINTS.astype("<f4").tobytes() + FACES.astype("<u4").tobytes()
    return struct.pack("<HH", 0x041C, 4) + zlib.compress(body) + struct.pack("<QI", 0, 1)


@pytest.mark.parametrize("scale", ["1", "0.4"])
@pytest.mark.parametrize("kind", ["obj", "ply", "serialized"])
def test_meshes_without_normals_are_smooth(kind: str, scale: str, tmp_path: Path) -> None:
    """The normals are those of the placed mesh, which a stretch changes otherwise than those of a file."""
    content = {"obj": obj(POINTS, FACES).encode(), "ply": ply(POINTS, FACES).encode(), "serialized": serialized()}
    (tmp_path / f"o.{kind}").write_bytes(content[kind])
    text = CAMERA.format(version="3.0.0", origin="2,1.5,4", fov=30, width=32, height=32, **NEW)
    text += (
        '<emitter type="point"><point name="position" x="3" y="4" z="5"/><rgb name="intensity" value="50"/></emitter>'
    )
    text += f'<shape type="{kind}"><string name="filename" value="o.{kind}"/>'
    text += f'<transform name="to_world"><scale z="{scale}"/></transform><bsdf type="diffuse"/></shape></scene>'
    (tmp_path / "b.xml").write_text(text)
    wanted = seen("mitsuba", tmp_path / "b.xml", 32, 32)
    found = drawn(load_scene_file(tmp_path / "b.xml"), "mitsuba", tmp_path, 32, 32)
    assert np.abs(found - wanted).mean() < 1e-3 * wanted.mean()


def test_serialized_meshes_of_0_5_may_ask_for_flat_faces() -> None:
    assert len(read_serialized(serialized(), 0, "a").vertices) == 3 * len(FACES)
    assert len(read_serialized(serialized(), 0, "a", smooth=True).vertices) == len(POINTS)
