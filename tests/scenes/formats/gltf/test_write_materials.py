"""Materials and textures in glTF files that are written."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from analysis.conversion.specimens import MATERIALS
from scenes.canonical import (
    CheckerboardTexture,
    ConstantTexture,
    Emissive,
    Glass,
    ImageTexture,
    Instance,
    Masked,
    Material,
    Matte,
    Metal,
    MetallicRough,
    MixMaterial,
    NormalMapped,
    PerspectiveCamera,
    ScaleTexture,
    Scene,
    Uber,
)
from scenes.formats.appearance.mixtures import NOTHING
from scenes.formats.comparison import difference
from scenes.formats.conversion import load_scene_file, save_scene_file
from scenes.formats.losses import LossReport
from scenes.models import read_model
from tests.scenes.formats.gltf.files import shown, written


def picture(seed: int = 0, most: int = 256) -> np.ndarray:
    from scenes.loading import decode_srgb

    return decode_srgb(np.random.default_rng(seed).integers(0, most, (4, 6, 3)).astype(np.uint8))


def numbers(seed: int) -> np.ndarray:
    codes = np.random.default_rng(seed).integers(0, 256, (4, 6, 3))
    return codes.astype(np.float32) / np.float32(255.0)


BASE = ImageTexture(picture(), wrap="clamp", filter="nearest")
PARTS = ImageTexture(numbers(1), wrap="clamp", filter="nearest")
HOLES = ImageTexture(np.repeat(numbers(2)[..., :1], 3, axis=2), wrap="clamp", filter="nearest")
GLOW = ImageTexture(picture(3), wrap="clamp", filter="nearest")
RED = ConstantTexture((0.6, 0.4, 0.2))


@pytest.mark.parametrize(
    "material",
    [
        MetallicRough(RED, 0.3, 0.7, None, 1.3, 0.5, 0.2),
        MetallicRough(BASE, 0.3, 0.7, PARTS, 1.7, 0.5, 0.2, (3.0, 2.0, 1.0), GLOW),
        NormalMapped(MetallicRough(BASE), PARTS, 0.5),
        Masked(MetallicRough(BASE), HOLES, 0.25),
        Masked(MetallicRough(RED), ConstantTexture((0.5, 0.5, 0.5))),
        Matte(RED),
        Matte(BASE),
        Emissive((3.0, 2.0, 1.0)),
        Glass(transmittance=RED, ior=1.3, roughness=(0.25, 0.25)),
        Glass(transmittance=RED, ior=1.4, thin=True),
    ],
    ids=lambda material: type(material).__name__,
)
@pytest.mark.parametrize("name", ["a.gltf", "a.glb"])
def test_what_glTF_holds_comes_back(material: Material, name: str, tmp_path: Path) -> None:
    report = LossReport()
    save_scene_file(shown(material), tmp_path / name, None, report)
    assert not [loss for loss in report.losses if loss.picture]
    (part,) = read_model(tmp_path / name, facets=True)
    if not isinstance(material, MetallicRough):
        (part,) = load_scene_file(tmp_path / name).instances
    assert difference(material, part.material, 1e-6) is None


@pytest.mark.parametrize("name", list(MATERIALS))
def test_every_material_comes_back_or_is_reported(name: str, tmp_path: Path) -> None:
    material, shape = MATERIALS[name]
    report = LossReport()
    save_scene_file(Scene(PerspectiveCamera(), (Instance(shape, material),)), tmp_path / "a.glb", None, report)
    (part,) = load_scene_file(tmp_path / "a.glb").instances
    lost = [loss for loss in report.losses if loss.picture and "a mesh of" not in loss.became]
    same = {"matte", "metallic-roughness", "glowing", "glass", "glass, rough", "glass, thin", "mask", "normal-mapped"}
    as_picture = {"matte, checked", "matte, bumped"}  # of four texels, and by an even height
    assert bool(lost) == (name not in same | as_picture)
    assert name not in same - {"normal-mapped"} or difference(material, part.material) is None


def test_metal_and_dielectric_of_one_base_are_metallic_in_part(tmp_path: Path) -> None:
    halves = MetallicRough(RED, 0.0, 0.5), MetallicRough(RED, 1.0, 0.5)
    tree, losses = written(tmp_path, shown(MixMaterial(*halves, ConstantTexture((0.25,) * 3))))
    assert losses == [] and tree["materials"][0]["pbrMetallicRoughness"]["metallicFactor"] == 0.25
    _, losses = written(tmp_path, shown(MixMaterial(halves[0], Metal((1.0,) * 3, (2.0,) * 3), RED)))
    assert any("a mixture of materials: the one with the greater share" in loss for loss in losses)


COLOURED = ConstantTexture((1.0, 0.5, 0.0))


@pytest.mark.parametrize(
    ("material", "alpha"),
    [
        (Masked(Matte(RED), COLOURED), 0.5),
        (Uber(RED, RED, RED, RED, COLOURED), 0.5),
        (MixMaterial(NOTHING, Matte(RED), ConstantTexture((1.0, 0.75, 0.5))), 0.75),
    ],
)
def test_a_coloured_opacity_becomes_its_mean(material: Material, alpha: float, tmp_path: Path) -> None:
    tree, losses = written(tmp_path, shown(material))
    assert tree["materials"][0]["pbrMetallicRoughness"]["baseColorFactor"][3] == pytest.approx(alpha)
    assert any("a coloured opacity: the mean of its channels" in loss for loss in losses)


def test_a_picture_of_coloured_opacities_becomes_its_means(tmp_path: Path) -> None:
    holes = ImageTexture(np.array([[[1.0, 0.5, 0.0], [0.0, 0.0, 0.6]]], np.float32), filter="nearest")
    _, losses = written(tmp_path, shown(Masked(Matte(RED), holes)))
    assert any("a coloured opacity: the mean of its channels" in loss for loss in losses)
    read = load_scene_file(tmp_path / "a.gltf").instances[0].material
    assert isinstance(read, Masked) and isinstance(read.opacity, ImageTexture)
    np.testing.assert_allclose(read.opacity.image, np.repeat([[[0.5], [0.2]]], 3, axis=2), atol=1e-3)


def test_a_checkerboard_is_four_texels_that_repeat(tmp_path: Path) -> None:
    checks = CheckerboardTexture(ConstantTexture((1.0, 1.0, 1.0)), ConstantTexture((0.0, 0.0, 0.0)), (8.0, 4.0))
    tree, losses = written(tmp_path, shown(Matte(checks)))
    assert losses == []
    texels = np.array(Image.open(tmp_path / tree["images"][0]["uri"]))[..., 0]
    np.testing.assert_array_equal(texels, [[0, 255], [255, 0]])  # row 0 is at v = 1: even squares hold the origin
    change = tree["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"]["extensions"]["KHR_texture_transform"]
    # v points downwards: v = 1 of the canonical scene is 0 here, and the lower left corner (0, 1) must stay at (0, 1)
    assert change == {"scale": [4.0, 2.0], "offset": [0.0, -1.0]}
    sampler = tree["samplers"][0]
    assert sampler["magFilter"] == 9728 and sampler["wrapS"] == 10497


def test_bright_and_dark_pictures_keep_their_factor(tmp_path: Path) -> None:
    dark = ScaleTexture(ImageTexture(picture(0, 40)), ConstantTexture((0.004, 0.5, 1.0)))
    tree, _ = written(tmp_path, shown(Matte(dark)))
    assert tree["materials"][0]["pbrMetallicRoughness"]["baseColorFactor"][0] == pytest.approx(0.004)
    codes = np.array(Image.open(tmp_path / tree["images"][0]["uri"]))
    assert codes.max() < 40  # the picture itself is unchanged
    bright = ImageTexture(np.full((2, 2, 3), 3.0, np.float32))
    tree, losses = written(tmp_path, shown(Matte(bright)))
    assert losses == ["Rectangle0: a colour of 3: 1"]
    fine = ImageTexture(np.linspace(0.0, 0.3, 300, dtype=np.float32).reshape(10, 10, 3))
    for name in ("b.glb", "c.glb", "d.glb"):
        save_scene_file(shown(Matte(fine)), tmp_path / name)
        (part,) = load_scene_file(tmp_path / name).instances
        before, fine = fine, part.material.reflectance  # type: ignore[union-attr]
    np.testing.assert_array_equal(fine.image, before.image)
    np.testing.assert_allclose(fine.image, np.linspace(0.0, 0.3, 300).reshape(10, 10, 3), atol=1.14 * 0.3 / 255)
