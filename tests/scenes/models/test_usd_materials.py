"""Materials of USD files beside the same in glTF; bad files; pictures."""

from __future__ import annotations

import dataclasses
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from renderer import render
from scenes.canonical import ImageTexture, Masked, MetallicRough, NormalMapped, SceneError, Texture
from scenes.catalog import Look, load_seen
from scenes.formats.losses import LossReport
from scenes.models import read_model
from scenes.models.usd_library import Usd, UsdUtils
from tests.scenes.models.files import QUAD_UVS, Gltf
from tests.scenes.models.usd import BOUND, QUAD, READER, ST, material, mesh, texture, written
from tests.scripts.commands import call_script, one_line

RNG = np.random.default_rng(3)


@pytest.fixture
def pictures(tmp_path: Path) -> dict[str, np.ndarray]:
    made = {"base": RNG.integers(0, 256, (4, 4, 4)), "parts": RNG.integers(0, 256, (4, 4, 3)),
            "normal": RNG.integers(100, 156, (4, 4, 3)), "glow": RNG.integers(0, 256, (4, 4, 3))}  # fmt: skip
    made["parts"][..., 0] = 255  # not read
    for name, picture in made.items():
        Image.fromarray(picture.astype(np.uint8)).save(tmp_path / f"{name}.png")
    return made


def textured(inputs: str, *nodes: str) -> str:
    return mesh(ST + BOUND) + material(inputs, "".join(nodes) + READER)


FULL = textured(
    """color3f inputs:diffuseColor.connect = </Mat/T.outputs:rgb>
            float inputs:opacity.connect = </Mat/T.outputs:a>
            float inputs:opacityThreshold = 0.5
            float inputs:roughness.connect = </Mat/P.outputs:g>
            float inputs:metallic.connect = </Mat/P.outputs:b>
            color3f inputs:emissiveColor.connect = </Mat/G.outputs:rgb>
            normal3f inputs:normal.connect = </Mat/N.outputs:rgb>
            float inputs:clearcoat = 0.5
            float inputs:clearcoatRoughness = 0.25
            float inputs:ior = 1.75""",
    texture("T", "base.png", 'token inputs:sourceColorSpace = "sRGB"', "float3 outputs:rgb\nfloat outputs:a"),
    texture("P", "parts.png", 'token inputs:sourceColorSpace = "raw"', "float outputs:g\nfloat outputs:b"),
    texture("G", "glow.png"),
    texture("N", "normal.png", """token inputs:sourceColorSpace = "raw"
            float4 inputs:scale = (2, 2, 2, 1)
            float4 inputs:bias = (-1, -1, -1, 0)"""),
)  # fmt: skip


def full_gltf(folder: Path) -> Gltf:
    file = Gltf(folder)
    file.attribute("TEXCOORD_0", np.array(QUAD_UVS, np.float32))
    file.material(
        pbrMetallicRoughness={"baseColorTexture": {"index": file.texture("base.png")},
                              "metallicRoughnessTexture": {"index": file.texture("parts.png")}},
        emissiveFactor=[1, 1, 1], emissiveTexture={"index": file.texture("glow.png")},
        normalTexture={"index": file.texture("normal.png")}, alphaMode="MASK", alphaCutoff=0.5,
        extensions={"KHR_materials_ior": {"ior": 1.75},
                    "KHR_materials_clearcoat": {"clearcoatFactor": 0.5, "clearcoatRoughnessFactor": 0.25}},
    )  # fmt: skip
    return file


def same(first: Any, second: Any, what: str = "") -> None:
    """Compares materials and textures, field by field."""
    assert type(first) is type(second), what
    if isinstance(first, ImageTexture):
        np.testing.assert_allclose(first.image, second.image, atol=1e-6, err_msg=what)
        assert (first.wrap, first.uv_scale, first.uv_offset) == (second.wrap, second.uv_scale, second.uv_offset)
    elif dataclasses.is_dataclass(first):
        for field in dataclasses.fields(first):
            same(getattr(first, field.name), getattr(second, field.name), f"{what}.{field.name}")
    else:
        assert first == pytest.approx(second, rel=1e-6), what


@pytest.mark.parametrize("facets", [False, True])
def test_a_material_is_that_of_the_same_gltf(facets: bool, tmp_path: Path, pictures: dict) -> None:
    losses = LossReport(), LossReport()
    (usd,) = read_model(written(tmp_path, FULL), losses[0], facets)
    (gltf,) = read_model(full_gltf(tmp_path).written(), losses[1], facets)
    same(usd.material, gltf.material)
    assert not facets or (isinstance(usd.material, Masked) and isinstance(usd.material.base, NormalMapped))
    np.testing.assert_allclose(usd.shape.uvs[usd.shape.faces], gltf.shape.uvs[gltf.shape.faces], atol=1e-6)
    np.testing.assert_array_equal(usd.shape.vertices[usd.shape.faces], gltf.shape.vertices[gltf.shape.faces])
    assert losses[0].rows() == [{**row, "where": row["where"].replace("0", "Mat")} for row in losses[1].rows()]


@pytest.mark.parametrize("integrator", ["whitted", "path"])
def test_a_picture_is_that_of_the_same_gltf(integrator: Any, tmp_path: Path, pictures: dict) -> None:
    """To the bit, whatever the unit of the file."""
    look = Look(integrator=integrator)
    expected = render(full_gltf(tmp_path).written(), size=(32, 24), samples_per_pixel=4, look=look)
    assert expected.std() > 0.01
    for unit in (0.01, 1.0):
        found = render(written(tmp_path, FULL, unit=unit), size=(32, 24), samples_per_pixel=4, look=look)
        np.testing.assert_array_equal(found, expected)


def base_of(folder: Path, inputs: str, *nodes: str) -> Texture:
    (part,) = read_model(written(folder, textured(inputs, *nodes)), facets=True)
    assert isinstance(part.material, MetallicRough)
    return part.material.base


def test_scale_bias_and_colour_spaces(tmp_path: Path, pictures: dict) -> None:
    more = """token inputs:sourceColorSpace = "raw"
            float4 inputs:scale = (0.5, 1, 1, 1)
            float4 inputs:bias = (0.25, 0, 0, 0)"""
    colored = "color3f inputs:diffuseColor.connect = </Mat/T.outputs:rgb>"
    found = base_of(tmp_path, colored, texture("T", "base.png", more))
    codes = pictures["base"][..., :3] / 255.0
    np.testing.assert_allclose(found.image, codes * (0.5, 1, 1) + (0.25, 0, 0), atol=1e-6)


def test_coordinates_are_moved(tmp_path: Path, pictures: dict) -> None:
    """Scaled, rotated counter-clockwise, translated, with v upwards."""
    turned = """def Shader "X" {
            uniform token info:id = "UsdTransform2d"
            float2 inputs:in.connect = </Mat/R.outputs:result>
            float2 inputs:scale = (2, 3)
            float inputs:rotation = 30
            float2 inputs:translation = (0.1, 0.2)
            float2 outputs:result
        }
        """
    body = textured(
        "color3f inputs:diffuseColor.connect = </Mat/T.outputs:rgb>", texture("T", "base.png", st="X"), turned
    )
    (part,) = read_model(written(tmp_path, body))
    s, t = np.array([(0, 0), (1, 0), (1, 1), (0, 1)], float).T * [[2.0], [3.0]]
    along, across = np.cos(np.radians(30.0)), np.sin(np.radians(30.0))
    expected = np.stack([along * s - across * t + 0.1, across * s + along * t + 0.2], axis=1)
    order = np.argsort(part.shape.vertices @ (1.0, 10.0, 0.0))
    np.testing.assert_allclose(part.shape.uvs[order], expected[[0, 1, 3, 2]], atol=1e-6)


def test_losses_of_materials(tmp_path: Path) -> None:
    said = LossReport()
    other = material("").replace("UsdPreviewSurface", "ND_standard_surface_surfaceshader")
    read_model(written(tmp_path, mesh(BOUND) + other), said)
    assert "a surface of kind ND_standard_surface_surfaceshader: the displayed colour" in said.text()
    specular = "int inputs:useSpecularWorkflow = 1\ncolor3f inputs:diffuseColor = (0, 0, 0)\n"
    specular += "color3f inputs:specularColor = (0.9, 0.6, 0.3)\nfloat inputs:displacement = 1"
    (part,) = read_model(written(tmp_path, mesh(BOUND) + material(specular), "b.usda"), said, facets=True)
    assert part.material.metallic == 1.0 and part.material.base.value == pytest.approx((0.9, 0.6, 0.3))
    assert "a specular workflow" in said.text() and "displacement" in said.text()


def test_other_containers(tmp_path: Path, pictures: dict) -> None:
    """Binary files, and packages with their pictures."""
    path = written(tmp_path, FULL)
    (expected,) = read_model(path, facets=True)
    for name in ("a.usdc", "a.usd"):
        Usd.Stage.Open(str(path)).Export(str(tmp_path / name))
        same(read_model(tmp_path / name, facets=True)[0].material, expected.material)
    package = tmp_path / "apart" / "a.usdz"
    package.parent.mkdir()
    assert UsdUtils.CreateNewUsdzPackage(str(path), str(package))
    same(read_model(package, facets=True)[0].material, expected.material)


def test_a_changed_file_is_read_again(tmp_path: Path) -> None:
    """Also where only a layer below it changed."""
    written(tmp_path, 'def Xform "x" { ' + mesh() + "}", "inner.usda")
    outer = written(tmp_path, 'def "top" (references = @inner.usda@</x>) { }')
    assert len(read_model(outer)) == 1
    written(tmp_path, 'def Xform "x" { ' + mesh() + mesh(name="b") + "}", "inner.usda")
    assert len(read_model(outer)) == 2


HOSTILE = {
    "no face": 'def Xform "a" { }',
    "a face refers to vertex 9 of 4": mesh(shape=QUAD.replace("[0, 1, 2, 3]", "[0, 1, 9, 3]")),
    "expected 4 indices of corners, got 3": mesh(shape=QUAD.replace("[0, 1, 2, 3]", "[0, 1, 2]")),
    "at least 0 corners, got -4": mesh(shape=QUAD.replace("[4]", "[-4, 8]")),
    "non-finite": mesh(shape=QUAD.replace("(1, 1, 0)", "(inf, 1, 0)")),
    "a finite transform": mesh('double3 xformOp:translate = (nan, 0, 0)\n'
                               'uniform token[] xformOpOrder = ["xformOp:translate"]'),
    "a positive radius, got -1": 'def Sphere "s" { double radius = -1 }',
    "one of 1 prototypes": 'def PointInstancer "p" { int[] protoIndices = [4]\n point3f[] positions = [(0, 0, 0)]\n'
                           "rel prototypes = [</p/quad>]\n" + mesh() + "}",
    "point instancers at most 32 deep": 'def PointInstancer "p" { int[] protoIndices = [0]\n'
                                        "point3f[] positions = [(0, 0, 0)]\nrel prototypes = [</p>]\n }",
    "positive apertures": mesh() + 'def Camera "c" { float focalLength = 0 }',
    "finite numbers, got inf": mesh() + 'def SphereLight "l" { float inputs:intensity = inf }',
    "cannot identify image file": textured("color3f inputs:diffuseColor.connect = </Mat/T.outputs:rgb>",
                                                 texture("T", "in.usda")),
    "animation: expected at most 65536 keys": mesh(
        "double3 xformOp:translate.timeSamples = { 0: (0, 0, 0), 1e9: (1, 0, 0) }\n"
        'uniform token[] xformOpOrder = ["xformOp:translate"]'
    ),
}  # fmt: skip


@pytest.mark.parametrize("said", HOSTILE)
def test_bad_files_are_one_line(said: str, tmp_path: Path, monkeypatch, capfd) -> None:
    path = written(tmp_path, HOSTILE[said], end=1e9 if "keys" in said else 0)
    assert call_script("render.py", monkeypatch, str(path), "--out", str(tmp_path / "out")) == 2
    error = capfd.readouterr().err
    assert one_line(error) and said.removeprefix("no ") in error.replace("cannot be read: in: ", ""), error
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("content", [b"", b"#usda 1.0\ndef Mesh {", b"PXR-USDC" + bytes(80), b"PK\x03\x04" + bytes(30)])
@pytest.mark.parametrize("ending", ["usd", "usda", "usdc", "usdz"])
def test_what_is_no_stage(content: bytes, ending: str, tmp_path: Path, monkeypatch, capfd) -> None:
    path = tmp_path / f"in.{ending}"
    path.write_bytes(content)
    assert call_script("render.py", monkeypatch, str(path), "--out", str(tmp_path / "out")) == 2
    assert one_line(capfd.readouterr().err)


def test_layers_that_are_not_there_are_losses(tmp_path: Path, capfd) -> None:
    body = mesh() + 'def "a" (references = @gone.usda@) { }\ndef "b" (references = </b>) { }\n'
    _, losses = load_seen(str(written(tmp_path, body)), Look())
    assert len(losses) == 2 and "gone.usda" in losses[0], losses
    assert capfd.readouterr().err == ""


def test_a_missing_package_is_one_line(tmp_path: Path, monkeypatch, capsys) -> None:
    for name in [name for name in sys.modules if name.partition(".")[0] == "pxr"]:
        monkeypatch.setitem(sys.modules, name, None)
    for name in [name for name in sys.modules if name.startswith("scenes.models.usd_")]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "pxr", None)
    path = written(tmp_path, mesh())
    assert call_script("render.py", monkeypatch, str(path), "--out", str(tmp_path / "out")) == 2
    error = capsys.readouterr().err
    assert one_line(error) and "expected the package usd-core, found none; the extra 'usd'" in error


def test_a_name_of_a_camera_that_no_file_has() -> None:
    with pytest.raises(SceneError, match="expected six numbers"):
        load_seen("glass", Look(camera="main"))


@pytest.mark.parametrize(
    ("mode", "space", "expected"),
    [("L", "auto", 128 / 255), ("RGB", "auto", 0.2158605), ("RGBA", "auto", 0.2158605), ("I;16", "auto", 128 / 255),
     ("L", "sRGB", 0.2158605), ("RGB", "raw", 128 / 255)],
)  # fmt: skip
def test_spaces_of_pictures(mode: str, space: str, expected: float, tmp_path: Path) -> None:
    """Without a space, 8 bits with three or four channels are sRGB, all others raw."""
    if mode == "I;16":
        picture = Image.fromarray(np.full((2, 2), 128 * 257, np.uint16))
    else:
        picture = Image.new(mode, (2, 2), 128 if mode == "L" else (128,) * len(mode))
    picture.save(tmp_path / "t.png")
    nodes = texture("T", "t.png", f'token inputs:sourceColorSpace = "{space}"')
    base = base_of(tmp_path, "color3f inputs:diffuseColor.connect = </Mat/T.outputs:rgb>", nodes)
    assert isinstance(base, ImageTexture) and base.image == pytest.approx(expected, abs=1e-4)
