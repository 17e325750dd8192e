"""Models with their materials: the content of real files, and one line for each fault in others."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh
from PIL import Image

from scenes.canonical import ConstantTexture, ImageTexture, Phong, RigidTrack, SceneError
from scenes.models import place_model, read_model
from tests.renderer.builders import place

SAMPLES = Path(__file__).resolve().parents[4] / "shared" / "data" / "assets"
needs_samples = pytest.mark.skipif(not SAMPLES.is_dir(), reason="sample models are not here")

SQUARE = "v 0 0 0\nv 2 0 0\nv 2 3 0\nv 0 3 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n"
FACES = "f 1/1 2/2 3/3\nf 1/1 3/3 4/4\n"


def written(folder: Path, materials: str, text: str = SQUARE + "usemtl paint\n" + FACES) -> Path:
    (folder / "square.mtl").write_text(materials)
    path = folder / "square.obj"
    path.write_text("mtllib square.mtl\n" + text)
    return path


@needs_samples
@pytest.mark.parametrize(
    ("file", "parts", "faces"),
    [
        ("airplane/plane.obj", 1, 17456),
        ("car-rc/left_front_wheel.obj", 1, 1632),
        ("car-rc/chassis.STL", 1, 324),
        ("car-truck/vehicle-truck-red.glb", 6, 558 + 4 * 92 + 20),
    ],
)
def test_real_files(file: str, parts: int, faces: int) -> None:
    found = read_model(SAMPLES / file)
    assert len(found) == parts
    assert sum(len(part.shape.faces) for part in found) == faces
    whole = trimesh.load_scene(SAMPLES / file, process=False).bounds
    points = np.concatenate(
        [
            part.shape.vertices[np.unique(part.shape.faces)] @ part.to_world[:3, :3].T + part.to_world[:3, 3]
            for part in found
        ]
    )
    np.testing.assert_allclose([points.min(axis=0), points.max(axis=0)], whole, atol=1e-4)
    for part in found:
        if file.endswith("STL"):
            assert part.shape.normals is None
        else:
            np.testing.assert_allclose(np.linalg.norm(part.shape.normals, axis=1), 1.0, atol=1e-4)


@needs_samples
def test_textures_of_real_files() -> None:
    wheel = read_model(SAMPLES / "car-rc/left_front_wheel.obj")[0]
    assert isinstance(wheel.material.diffuse, ImageTexture) and wheel.shape.uvs is not None
    for part in read_model(SAMPLES / "car-truck/vehicle-truck-red.glb"):
        assert part.material.diffuse.image.shape == (512, 512, 3)
        assert part.material.exponent == 1.0  # glTF's default roughness is 1


def test_mtl_colours_highlights_and_textures(tmp_path: Path) -> None:
    plain = read_model(written(tmp_path, "newmtl paint\nKd 0.7 0.2 0.1\nKs 0.5 0.5 0.5\nNs 30\n"))[0].material
    assert plain.diffuse == ConstantTexture((0.7, 0.2, 0.1)) and plain.exponent == 30.0
    np.testing.assert_allclose(plain.specular, (0.3, 0.5, 0.5))  # what is left of the light
    Image.fromarray(np.full((2, 4, 3), 188, np.uint8)).save(tmp_path / "grey.png")
    other = tmp_path / "other"
    other.mkdir()
    Image.fromarray(np.full((2, 4, 3), 188, np.uint8)).save(other / "grey.png")
    textured = read_model(written(other, "newmtl paint\nKd 0.8 0.8 0.8\nmap_Kd grey.png\n"))[0]
    assert textured.material.diffuse.image.shape == (2, 4, 3)
    np.testing.assert_allclose(textured.material.diffuse.image, 0.5029, atol=1e-3)


def test_gltf_metal_mirrors_and_nodes_are_placed(tmp_path: Path) -> None:
    metal = trimesh.visual.material.PBRMaterial(
        baseColorFactor=[255, 128, 0, 255], metallicFactor=1.0, roughnessFactor=0.1
    )
    box = trimesh.creation.box()
    box.visual = trimesh.visual.TextureVisuals(uv=np.zeros((len(box.vertices), 2)), material=metal)
    scene = trimesh.Scene()
    scene.add_geometry(box, node_name="n0", geom_name="box")
    scene.graph.update(frame_to="n1", matrix=place((5.0, 0, 0)), geometry="box")
    path = tmp_path / "boxes.glb"
    path.write_bytes(scene.export(file_type="glb"))
    found = read_model(path)
    assert sorted(part.to_world[0, 3] for part in found) == [0.0, 5.0]
    assert found[0].shape is found[1].shape and found[0].material is found[1].material
    assert found[0].material.fresnel_min == 1.0 and found[0].material.mirror_tint[0] == pytest.approx(1.0)
    assert found[0].material.mirror_tint[1] == pytest.approx(0.5, abs=0.01)


def test_vertex_colours_and_files_without_any(tmp_path: Path) -> None:
    mesh = trimesh.creation.icosphere(1)
    mesh.export(tmp_path / "grey.stl")
    assert read_model(tmp_path / "grey.stl")[0].material == Phong(ConstantTexture((0.5, 0.5, 0.5)))
    mesh.visual.vertex_colors = [255, 0, 0, 255]
    mesh.export(tmp_path / "red.ply")
    assert read_model(tmp_path / "red.ply")[0].material.diffuse.value == pytest.approx((1.0, 0.0, 0.0))


@pytest.mark.parametrize("header", [b"by a program", b"solid box"])
def test_binary_stl_with_bytes_behind_its_triangles_and_with_too_few(header: bytes, tmp_path: Path) -> None:
    """Some programs append data; a file that was cut off says so, also where its header begins like a text."""
    content = header.ljust(80) + trimesh.creation.box().export(file_type="stl")[80:]
    path = tmp_path / "in.stl"
    path.write_bytes(content + b"appended")
    assert len(read_model(path)[0].shape.faces) == 12
    path.write_bytes(content[:-60])
    with pytest.raises(SceneError, match="expected 12 triangles as its header says, got 10"):
        read_model(path)


def test_stl_as_text_with_a_byte_order_mark(tmp_path: Path) -> None:
    path = tmp_path / "in.stl"
    path.write_bytes(b"\xef\xbb\xbf" + trimesh.creation.box().export(file_type="stl_ascii").encode())
    assert len(read_model(path)[0].shape.faces) == 12


def test_a_model_is_placed_with_all_its_parts(tmp_path: Path) -> None:
    path = written(tmp_path, "newmtl paint\nKd 0.7 0.2 0.1\n")
    track = RigidTrack(0.0, 1.0, np.zeros((1, 3)), np.array([[0.0, 0.0, 0.0, 1.0]]))
    part = place_model(path, place((1.0, 2.0, 3.0)), track, Phong(ConstantTexture((0, 0, 1))), "thing")[0]
    assert part.name == "thing" and part.track is track and part.material.diffuse.value == (0, 0, 1)
    np.testing.assert_array_equal(part.to_world[:3, 3], (1.0, 2.0, 3.0))


def broken(folder: Path, kind: str) -> Path:
    """A file with one fault."""
    path = folder / f"{kind.replace(' ', '-')}.obj"
    text = {
        "no faces": SQUARE,
        "NaN": SQUARE.replace("v 2 3 0", "v 2 nan 0") + FACES,
        "nothing": "",
        "index beyond": SQUARE + "f 1 2 9\n",
        "half a face": SQUARE + "f 1 2",
    }.get(kind)
    if kind == "other kind":
        path = path.with_suffix(".blend")
        path.write_text("x")
    elif kind == "not glb":
        path = path.with_suffix(".glb")
        path.write_bytes(b"not a model at all")
    elif text is not None:
        path.write_text(text)
    return path


@pytest.mark.parametrize(
    ("kind", "message"),
    [
        ("no faces", "at least one face"),
        ("NaN", "vertices hold non-finite values"),
        ("nothing", "cannot be read|at least one face"),
        ("index beyond", "cannot be read"),
        ("half a face", "cannot be read|at least one face"),
        ("other kind", "expected a file that ends in .obj"),
        ("not glb", "cannot be read"),
        ("missing", "expected a file, found none"),
    ],
)
def test_faults_are_named_in_one_line(kind: str, message: str, tmp_path: Path) -> None:
    path = broken(tmp_path, kind)
    with pytest.raises(SceneError, match=message) as caught:
        read_model(path)
    assert str(path) in str(caught.value) and "\n" not in str(caught.value)


@pytest.mark.parametrize("content", [b"", bytes(range(256)) * 8])
@pytest.mark.parametrize("ending", [".obj", ".glb", ".stl", ".ply"])
def test_files_that_hold_no_mesh_are_named_in_one_line(ending: str, content: bytes, tmp_path: Path) -> None:
    path = tmp_path / f"a{ending}"
    path.write_bytes(content)
    with pytest.raises(SceneError) as caught:
        read_model(path)
    assert str(path) in str(caught.value) and "\n" not in str(caught.value)


@pytest.mark.parametrize("edited", ["square.obj", "square.mtl", "grey.png"])
def test_a_model_is_read_once_and_again_when_one_of_its_files_changes(edited: str, tmp_path: Path) -> None:
    """Edited in place, to the same length."""
    Image.new("RGB", (2, 2), (100, 100, 100)).save(tmp_path / "grey.png")
    path = written(tmp_path, "newmtl paint\nKd 0.8 0.8 0.8\nmap_Kd grey.png\n")
    other = written(tmp_path, "newmtl paint\nKd 0.8 0.8 0.8\nmap_Kd grey.png\n").with_name("other.obj")
    other.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    first, beside = read_model(path), read_model(other)
    assert read_model(path) is first
    file = tmp_path / edited
    if edited == "grey.png":
        Image.new("RGB", (2, 2), (101, 100, 100)).save(file)
    else:
        file.write_text(file.read_text().replace("2 3 0", "2 4 0").replace("map_Kd", "MAP_KD"))
    again = read_model(path)
    assert again is not first and read_model(path) is again and read_model(other) is beside
    if edited == "square.obj":
        assert again[0].shape.vertices.max() == 4.0 and first[0].shape.vertices.max() == 3.0
    if edited == "grey.png":
        assert (again[0].material.diffuse.image != first[0].material.diffuse.image).any()
