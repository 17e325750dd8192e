"""glTF for paths: all of its pictures, as they are."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from scenes.canonical import ConstantTexture, Glass, Masked, MetallicRough, NormalMapped, Phong
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
