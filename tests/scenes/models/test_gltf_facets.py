"""glTF for paths: all of its pictures, as they are."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from scenes.canonical import ConstantTexture, Glass, ImageTexture, Masked, MetallicRough, NormalMapped, Phong
from scenes.catalog import load_file
from scenes.formats.losses import LossReport
from scenes.models import read_model
from tests.scenes.models.files import QUAD_UVS, Gltf


def quad(folder: Path, **material) -> Gltf:
    file = Gltf(folder)
    file.attribute("TEXCOORD_0", np.array(QUAD_UVS, np.float32))
    file.material(**material)
    return file


def textured(folder: Path, name: str, mode: str, color: tuple[int, ...], file: Gltf) -> dict[str, int]:
    Image.new(mode, (2, 2), color).save(folder / name)
    return {"index": file.texture(name)}


def test_every_picture_of_a_material_is_kept(tmp_path: Path) -> None:
    file = quad(tmp_path)
    file.material(
        pbrMetallicRoughness={
            "baseColorFactor": [1.0, 0.5, 1.0, 0.5],
            "baseColorTexture": textured(tmp_path, "base.png", "RGBA", (255, 255, 255, 51), file),
            "metallicRoughnessTexture": textured(tmp_path, "parts.png", "RGB", (0, 51, 102), file),
            "roughnessFactor": 0.5,
        },
        normalTexture={**textured(tmp_path, "normal.png", "RGB", (128, 128, 255), file), "scale": 0.7},
        emissiveTexture=textured(tmp_path, "glow.png", "RGB", (255, 0, 0), file),
        emissiveFactor=[1.0, 1.0, 1.0],
        alphaMode="MASK",
        alphaCutoff=0.05,
        extensions={"KHR_materials_clearcoat": {"clearcoatFactor": 0.8, "clearcoatRoughnessFactor": 0.1},
                    "KHR_materials_emissive_strength": {"emissiveStrength": 3.0}},
    )  # fmt: skip
    report = LossReport()
    (part,) = read_model(file.written(), report, facets=True)
    assert not report.losses
    holes = part.material
    assert isinstance(holes, Masked) and holes.cutoff == 0.05
    assert holes.opacity.image[0, 0] == pytest.approx(np.full(3, 0.1))
    bent = holes.base
    assert isinstance(bent, NormalMapped) and bent.scale == 0.7
    assert bent.normals.image[0, 0] == pytest.approx((128 / 255, 128 / 255, 1.0))
    solid = bent.base
    assert isinstance(solid, MetallicRough)
    assert solid.base.image[0, 0] == pytest.approx((1.0, 0.5, 1.0))
    assert solid.parts.image[0, 0] == pytest.approx((0, 0.2, 0.4))
    assert (solid.metallic, solid.roughness, solid.coat, solid.coat_roughness) == (1.0, 0.5, 0.8, 0.1)
    assert solid.emission == (3.0, 3.0, 3.0) and solid.glow.image[0, 0] == pytest.approx((1.0, 0.0, 0.0))


def test_without_paths_the_same_file_is_phong(tmp_path: Path) -> None:
    file = quad(tmp_path, pbrMetallicRoughness={"metallicFactor": 0.0})
    path = file.written()
    assert isinstance(read_model(path)[0].material, Phong)
    assert isinstance(read_model(path, facets=True)[0].material, MetallicRough)
    scene, _ = load_file(str(path), integrator="path")
    assert isinstance(scene.instances[0].material, MetallicRough) and scene.integrator.kind == "path"
    assert load_file(str(path))[0].integrator.kind == "whitted"


def test_a_picture_that_is_looked_up_otherwise_is_named(tmp_path: Path) -> None:
    file = quad(tmp_path)
    moved = {"extensions": {"KHR_texture_transform": {"scale": [2.0, 2.0]}}}
    file.material(
        pbrMetallicRoughness={"baseColorTexture": textured(tmp_path, "base.png", "RGB", (255, 255, 255), file)},
        normalTexture={**textured(tmp_path, "normal.png", "RGB", (128, 128, 255), file), **moved},
    )
    report = LossReport()
    (part,) = read_model(file.written(), report, facets=True)
    assert isinstance(part.material, MetallicRough)
    (loss,) = report.losses
    assert "normalTexture" in loss.what


def test_blended_colours_and_rough_glass(tmp_path: Path) -> None:
    file = quad(tmp_path, pbrMetallicRoughness={"baseColorFactor": [1, 1, 1, 0.25]}, alphaMode="BLEND")
    (part,) = read_model(file.written(), facets=True)
    assert part.material == Masked(part.material.base, ConstantTexture((0.25, 0.25, 0.25)))
    (tmp_path / "glass").mkdir()
    glass = quad(
        tmp_path / "glass",
        pbrMetallicRoughness={"metallicFactor": 0.0, "roughnessFactor": 0.5},
        extensions={
            "KHR_materials_transmission": {"transmissionFactor": 1.0}, "KHR_materials_volume": {"thicknessFactor": 1.0}
        },
    )  # fmt: skip
    (part,) = read_model(glass.written(), facets=True)
    assert isinstance(part.material, Glass) and part.material.roughness == (0.25, 0.25) and not part.material.thin


def test_a_metal_that_lets_nothing_through_loses_nothing(tmp_path: Path) -> None:
    metal, report = {"emissiveFactor": [1, 0, 0], "pbrMetallicRoughness": {"roughnessFactor": 0.5}}, LossReport()
    (tmp_path / "through").mkdir()
    through = quad(
        tmp_path / "through", extensions={"KHR_materials_transmission": {"transmissionFactor": 1.0}}, **metal
    )
    (part,) = read_model(through.written(), report, facets=True)
    (expected,) = read_model(quad(tmp_path, **metal).written(), facets=True)
    assert part.material == expected.material and not report.losses


def test_the_opacity_of_vertices_counts_where_the_material_has_one(tmp_path: Path) -> None:
    colors = np.array([[1, 0, 0, 1], [0, 1, 0, 0.25], [0, 0, 1, 0.25], [1, 1, 1, 0.5]], np.float32)
    for mode, cutoff in (("BLEND", None), ("MASK", 0.5)):
        file = Gltf(tmp_path)
        file.attribute("COLOR_0", colors)
        file.material(alphaMode=mode, pbrMetallicRoughness={"baseColorFactor": [1, 1, 1, 0.8]})
        (part,) = read_model(file.written(), facets=True)
        assert isinstance(part.material, Masked) and part.material.cutoff == cutoff
        opacity = part.material.opacity
        assert isinstance(opacity, ImageTexture)
        # at the centres of texels the corners have their own values
        side = opacity.image.shape[0]
        places = np.floor(np.stack([part.shape.uvs[:, 0], 1.0 - part.shape.uvs[:, 1]], axis=1) * side).astype(int)
        found = {
            tuple(np.round(part.shape.vertices[row, :2], 3).tolist()): float(opacity.image[y, x, 0])
            for row, (x, y) in enumerate(places)
        }
        assert found == pytest.approx({(-1, -1): 0.8, (1, -1): 0.2, (1, 1): 0.2, (-1, 1): 0.4})
    file.material(alphaMode="OPAQUE")
    (part,) = read_model(file.written(), facets=True)
    assert not isinstance(part.material, Masked)
    file = Gltf(tmp_path)
    file.attribute("COLOR_0", np.full((4, 4), 0.5, np.float32))
    file.material(alphaMode="BLEND")
    (part,) = read_model(file.written(), facets=True)
    assert part.material.opacity == ConstantTexture((0.5, 0.5, 0.5))
    report = LossReport()
    read_model(file.written(), report)
    assert "an opacity of 0.5" in report.text()


def test_the_opacity_of_vertices_multiplies_that_of_a_texture(tmp_path: Path) -> None:
    Image.new("RGBA", (2, 2), (255, 255, 255, 128)).save(tmp_path / "t.png")
    file, report = Gltf(tmp_path), LossReport()
    file.attribute("TEXCOORD_0", np.array(QUAD_UVS, np.float32))
    file.attribute("COLOR_0", np.array([[1, 1, 1, 0.25 + 0.5 * side] for side in (0, 1, 1, 0)], np.float32))
    file.material(alphaMode="BLEND", pbrMetallicRoughness={"baseColorTexture": {"index": file.texture("t.png")}})
    (part,) = read_model(file.written(), report, facets=True)
    assert part.material.opacity.image[0, 0, 0] == pytest.approx(128 / 255 / 2) and "their mean" in report.text()
