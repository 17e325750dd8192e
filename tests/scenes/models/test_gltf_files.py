"""glTF as its specification says: flat faces, factors times textures, nodes, samplers, accessors."""

from __future__ import annotations

import base64
import json
import math
import struct
from pathlib import Path
from typing import Any
from urllib.parse import quote_from_bytes

import numpy as np
import pytest
from PIL import Image

from scenes.canonical import ConstantTexture, Emissive, Glass, ImageTexture, Phong, SceneError
from scenes.formats.losses import LossReport
from scenes.models import read_model
from tests.scenes.models.files import CASES, QUAD, QUAD_UVS, Gltf

DIELECTRIC = {"metallicFactor": 0.0, "roughnessFactor": 1.0}


def picture(folder: Path, name: str, color: tuple[int, ...], size: tuple[int, int] = (2, 2)) -> str:
    Image.new("RGB", size, color).save(folder / name)
    return name


def linear(code: int) -> float:
    value = code / 255.0
    return value / 12.92 if value <= 0.04045 else ((value + 0.055) / 1.055) ** 2.4


def test_faces_without_normals_are_flat() -> None:
    (part,) = read_model(CASES / "cube-without-normals.gltf")
    assert part.shape.normals is None and part.shape.faces.shape == (12, 3) and len(part.shape.vertices) == 8


def test_a_factor_near_black_stays_so() -> None:
    (part,) = read_model(CASES / "near-black.gltf")
    assert part.material.diffuse == ConstantTexture((0.004, 0.004, 0.004))


def test_metal_by_a_picture_is_factor_times_texture() -> None:
    """The blue channel is 0: no metal, and the base colour is diffuse."""
    (part,) = read_model(CASES / "metallic-texture" / "in.gltf")
    assert part.material.diffuse.image[0, 0] == pytest.approx((0.7913, 0.1878, 0.0130), abs=1e-3)
    assert part.material.specular == pytest.approx((0.04, 0.04, 0.04)) and part.material.fresnel_max == 0.0


@pytest.mark.parametrize("factor", [0.25, 1.0])
def test_metal_is_where_its_picture_says(factor: float, tmp_path: Path) -> None:
    """The left half of a fine picture is metal; the base colour has fewer texels. Rough metal scatters by its alpha."""
    file = Gltf(tmp_path)
    Image.new("RGB", (2, 2), (188, 188, 188)).save(tmp_path / "base.png")
    numbers = np.zeros((4, 4, 3), np.uint8)
    numbers[:, :2] = (0, 153, 255)
    numbers[:, 2:] = (0, 153, 0)
    Image.fromarray(numbers).save(tmp_path / "numbers.png")
    file.attribute("TEXCOORD_0", np.array(QUAD_UVS, np.float32))
    file.material(
        pbrMetallicRoughness={
            "baseColorTexture": {"index": file.texture("base.png")}, "metallicFactor": factor,
            "metallicRoughnessTexture": {"index": file.texture("numbers.png")},
        }
    )  # fmt: skip
    image = read_model(file.written())[0].material.diffuse.image
    assert image.shape == (4, 4, 3)
    assert image[:, 2:] == pytest.approx(linear(188), rel=1e-4)
    assert image[:, :2] == pytest.approx(linear(188) * (1.0 - factor * (1.0 - 0.6**2)), rel=1e-4)


def test_base_colour_is_factor_times_texture_times_vertices(tmp_path: Path) -> None:
    file = Gltf(tmp_path)
    file.attribute("TEXCOORD_0", np.array(QUAD_UVS, np.float32))
    file.attribute("COLOR_0", np.full((4, 4), 128, np.uint8), normalized=True)
    base = {"baseColorTexture": {"index": file.texture(picture(tmp_path, "a.png", (188, 64, 255)))}, **DIELECTRIC}
    file.material(pbrMetallicRoughness={**base, "baseColorFactor": [0.5, 0.25, 1.0, 1.0]})
    report = LossReport()
    image = read_model(file.written(), report)[0].material.diffuse.image
    expected = np.array([linear(188) * 0.5, linear(64) * 0.25, 1.0]) * 128 / 255  # colours of vertices are linear
    assert image[0, 0] == pytest.approx(expected, rel=1e-4)
    assert "vertex colours in addition to a texture" in report.text()


def test_colours_of_vertices_are_interpolated(tmp_path: Path) -> None:
    """By bilinear lookup, at the corners and within each triangle."""
    file = Gltf(tmp_path)
    colors = np.array([(0.1, 0.2, 0.9), (0.5, 0.4, 0.6), (0.2, 0.3, 0.5), (0.25, 0.1, 0.6)], np.float32)
    file.attribute("COLOR_0", colors)
    file.material(pbrMetallicRoughness={"baseColorFactor": [1.0, 0.5, 1.0, 1.0], **DIELECTRIC})
    (part,) = read_model(file.written())
    texture = part.material.diffuse
    assert isinstance(texture, ImageTexture) and texture.filter == "bilinear" and part.shape.uvs is not None
    height, width = texture.image.shape[:2]
    weights = np.array([(1, 0, 0), (0, 1, 0), (0, 0, 1), (0.4, 0.3, 0.3), (0.0, 0.5, 0.5)])
    for face, corners in zip(part.shape.faces, ([0, 1, 2], [0, 2, 3]), strict=True):
        assert part.shape.vertices[face] == pytest.approx(np.array(QUAD)[corners])
        for weight in weights:
            u, v = weight @ part.shape.uvs[face]
            column, row = u * width - 0.5, (1.0 - v) * height - 0.5
            left, top = math.floor(column + 1e-5), math.floor(row + 1e-5)
            across, down = column - left, row - top
            texels = texture.image[top : top + 2, left : left + 2]
            pad = np.pad(texels, ((0, 2 - texels.shape[0]), (0, 2 - texels.shape[1]), (0, 0)))
            found = np.einsum("i,j,ijc->c", (1.0 - down, down), (1.0 - across, across), pad)
            assert found == pytest.approx(weight @ (colors[corners] * (1.0, 0.5, 1.0)), abs=1e-4)


def test_textures_are_moved_turned_and_chosen_as_the_file_says(tmp_path: Path) -> None:
    """A quarter turn counter-clockwise takes the picture's right to its top."""
    file = Gltf(tmp_path)
    file.attribute("TEXCOORD_0", np.zeros((4, 2), np.float32))
    file.attribute("TEXCOORD_1", np.array(QUAD_UVS, np.float32))
    number = file.texture(picture(tmp_path, "a.png", (9, 9, 9)), {"wrapS": 33071, "wrapT": 33071, "magFilter": 9728})
    change = {"offset": [0.25, 0.5], "rotation": math.pi / 2, "scale": [2.0, 3.0], "texCoord": 1}
    info = {"index": number, "extensions": {"KHR_texture_transform": change}}
    file.json["extensionsRequired"] = ["KHR_texture_transform"]
    file.material(pbrMetallicRoughness={"baseColorTexture": info, **DIELECTRIC})
    (part,) = read_model(file.written())
    assert part.material.diffuse.wrap == "clamp" and part.material.diffuse.filter == "nearest"
    order = [int(np.flatnonzero((np.array(QUAD) == point).all(axis=1))[0]) for point in part.shape.vertices]
    u, v = np.array(QUAD_UVS)[order].T * np.array([[2.0], [3.0]])
    expected = np.stack([v + 0.25, 1.0 - (-u + 0.5)], axis=1)
    assert part.shape.uvs == pytest.approx(expected, abs=1e-6)


def test_mirrored_pictures_are_laid_out(tmp_path: Path) -> None:
    file = Gltf(tmp_path)
    pixels = np.zeros((2, 3, 3), np.uint8)
    pixels[0], pixels[:, 0] = 100, 200
    Image.fromarray(pixels).save(tmp_path / "a.png")
    file.attribute("TEXCOORD_0", np.array(QUAD_UVS, np.float32))
    number = file.texture("a.png", {"wrapS": 33648, "wrapT": 33648})
    file.material(pbrMetallicRoughness={"baseColorTexture": {"index": number}, **DIELECTRIC})
    texture = read_model(file.written())[0].material.diffuse
    image = texture.image
    assert image.shape == (4, 6, 3) and texture.uv_scale == (0.5, 0.5)
    np.testing.assert_array_equal(image[:2, 3:], image[:2, 2::-1])
    np.testing.assert_array_equal(image[2:], image[1::-1])
    # v = 1, the top of the picture in the file, is the top of the larger one
    assert 1.0 * texture.uv_scale[1] + texture.uv_offset[1] == 1.0 and texture.uv_offset[0] == 0.0


@pytest.mark.parametrize(
    ("mode", "order", "expected"),
    [(4, [0, 1, 2, 3, 2, 1], [(0, 1, 2), (3, 2, 1)]), (5, [0, 1, 2, 3], [(0, 1, 2), (1, 3, 2)]),
     (6, [0, 1, 2, 3], [(1, 2, 0), (2, 3, 0)])],
)  # fmt: skip
def test_lists_strips_and_fans(mode: int, order: list[int], expected: list, tmp_path: Path) -> None:
    file = Gltf(tmp_path)
    file.primitive.update(mode=mode, indices=file.accessor(np.array(order, np.uint8)))
    assert read_model(file.written())[0].shape.faces.tolist() == [list(face) for face in expected]


def test_nodes_are_placed_below_each_other(tmp_path: Path) -> None:
    """Scale, then turn, then move; a matrix is written by columns."""
    file = Gltf(tmp_path)
    turn = [0.0, 0.0, math.sqrt(0.5), math.sqrt(0.5)]
    matrix = np.eye(4)
    matrix[:3, 3] = (10.0, 0.0, 0.0)
    file.json["nodes"] = [
        {"children": [1], "matrix": matrix.T.reshape(-1).tolist()},
        {"mesh": 0, "scale": [2.0, 1.0, 1.0], "rotation": turn, "translation": [0.0, 0.0, 5.0], "name": "leaf"},
    ]
    (part,) = read_model(file.written())
    assert part.name == "in/leaf"
    assert part.to_world @ (1.0, 0.0, 0.0, 1.0) == pytest.approx((10.0, 2.0, 5.0, 1.0))


def test_sparse_and_strided_accessors(tmp_path: Path) -> None:
    file = Gltf(tmp_path)
    rows = np.zeros((4, 6), np.float32)
    rows[:, :3] = QUAD
    number = file.accessor(rows[:, :3].copy())
    wide = file.accessor(rows.reshape(-1))
    file.json["bufferViews"][file.json["accessors"][wide]["bufferView"]]["byteStride"] = 24
    file.json["accessors"][number]["bufferView"] = file.json["accessors"][wide]["bufferView"]
    places = file.json["accessors"][file.accessor(np.array([2], np.uint16))]["bufferView"]
    values = file.json["accessors"][file.accessor(np.array([[7.0, 8.0, 9.0]], np.float32))]["bufferView"]
    file.json["accessors"][number]["sparse"] = {
        "count": 1, "indices": {"bufferView": places, "componentType": 5123}, "values": {"bufferView": values},
    }  # fmt: skip
    file.primitive["attributes"]["POSITION"] = number
    vertices = read_model(file.written())[0].shape.vertices
    assert vertices[2].tolist() == [7.0, 8.0, 9.0] and vertices[[0, 1, 3]] == pytest.approx(np.array(QUAD)[[0, 1, 3]])


@pytest.mark.parametrize(
    ("material", "kind", "loss"),
    [
        ({"extensions": {"KHR_materials_unlit": {}}, "pbrMetallicRoughness": {"baseColorFactor": [1, 0.5, 0, 1]}},
         Emissive, ""),
        ({"emissiveFactor": [1, 0, 0], "extensions": {"KHR_materials_emissive_strength": {"emissiveStrength": 3.0}}},
         Emissive, "lights nothing"),
        ({"extensions": {"KHR_materials_transmission": {"transmissionFactor": 1.0}},
          "pbrMetallicRoughness": {"metallicFactor": 0.0}}, Glass, ""),
        ({"extensions": {"KHR_materials_transmission": {"transmissionFactor": 1.0}}}, Phong, ""),  # a metal
        ({"extensions": {"KHR_materials_transmission": {"transmissionFactor": 0.7}},
          "pbrMetallicRoughness": {"metallicFactor": 0.0}}, Glass, "light that passes in part: glass"),
        ({"alphaMode": "BLEND", "pbrMetallicRoughness": {"baseColorFactor": [1, 1, 1, 0.2]}}, Glass, "opacity"),
        ({"normalTexture": {"index": 0}}, Phong, "normalTexture"),
        ({"extensions": {"KHR_materials_sheen": {}}}, Phong, "KHR_materials_sheen"),
    ],
)  # fmt: skip
def test_what_a_material_becomes_and_loses(material: dict[str, Any], kind: type, loss: str, tmp_path: Path) -> None:
    file, report = Gltf(tmp_path), LossReport()
    file.material(**material)
    file.json["textures"] = [{}]
    for _ in range(2):  # the second is remembered, and tells its losses again
        found = read_model(file.written(), report)[0].material
        assert isinstance(found, kind) and loss in report.text()
    if "emissiveFactor" in material:
        assert found.radiance == (3.0, 0.0, 0.0)


def glb(chunk: bytes) -> bytes:
    return b"glTF" + struct.pack("<II", 2, 20 + len(chunk)) + struct.pack("<I", len(chunk)) + b"JSON" + chunk


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"asset": {"version": "1.0"}}, "expected glTF 2, got version 1.0"),
        ({"extensionsRequired": ["KHR_draco_mesh_compression"]}, "requires the extension KHR_draco_mesh_compression"),
        ({"scenes": [{"nodes": [4]}]}, "expected an index of nodes below 1, got 4"),
        ({"nodes": [{"children": [0]}]}, "expected a tree of nodes, got node 0 twice"),
        ({"nodes": [{"children": [one + 1] * 2} for one in range(30)] + [{}]}, "expected a tree .* got node 30 twice"),
        ({"nodes": [{"children": [one + 1]} for one in range(300)] + [{}]}, "expected nodes at most 256 deep"),
        ({"buffers": []}, "expected an index of buffers below 0"),
        ({"scenes": [{"nodes": []}]}, "expected at least one face, found none"),
    ],
)
def test_faults_are_named_in_one_line(change: dict[str, Any], message: str, tmp_path: Path) -> None:
    file = Gltf(tmp_path)
    file.json.update(change)
    file.written()
    for path in (file.path, file.path.with_suffix(".glb")):
        if path.suffix == ".glb":
            path.write_bytes(glb(json.dumps(file.json).encode()))
        with pytest.raises(SceneError, match=message) as caught:
            read_model(path)
        assert "\n" not in str(caught.value) and str(path) in str(caught.value)


def test_embedded_data_may_be_escapes(tmp_path: Path) -> None:
    """They are base64 only where their type says so."""
    file = Gltf(tmp_path)
    for buffer in file.json["buffers"]:
        content = base64.b64decode(buffer["uri"].partition(",")[2])
        buffer["uri"] = "data:application/octet-stream," + quote_from_bytes(content)
    (part,) = read_model(file.written())
    assert sorted(part.shape.vertices.tolist()) == sorted(map(list, QUAD)) and len(part.shape.faces) == 2
