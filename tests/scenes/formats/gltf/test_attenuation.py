"""Glass of glTF that absorbs, in part, or not at all: the extensions of transmission and volumes."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from scenes.canonical import (
    ConstantTexture,
    Cube,
    Glass,
    Instance,
    Matte,
    Medium,
    MetallicRough,
    MixMaterial,
    PerspectiveCamera,
    Scene,
)
from scenes.formats.appearance.mixtures import NOTHING, is_nothing
from scenes.formats.comparison import difference
from scenes.formats.conversion import load_scene_file
from scenes.formats.losses import LossReport
from tests.scenes.formats.gltf.files import written
from tests.scenes.models.files import Gltf

FOG, MILK = Medium((0.5, 0.25, 0.0)), Medium((0.1, 0.05, 0.0), (1.0, 0.5, 0.25), 0.3)
GREY = Matte(ConstantTexture((0.5, 0.5, 0.5)))


def block(material: Any = NOTHING, **media: Medium) -> Scene:
    return Scene(PerspectiveCamera(), (Instance(Cube(), material, np.diag([2.0, 3.0, 4.0, 1.0]), **media),))


def glass(folder: Path, factors: dict[str, Any], through: Any = 1.0, **volume: Any) -> tuple[Instance, list[str]]:
    """The instance of a file with one surface, and what it lost."""
    file, report = Gltf(folder), LossReport()
    extensions = {"KHR_materials_transmission": {"transmissionFactor": through}, "KHR_materials_volume": volume}
    file.material(
        pbrMetallicRoughness={"metallicFactor": 0.0, "roughnessFactor": 0.0, **factors}, extensions=extensions
    )
    (one,) = load_scene_file(file.written(), None, report).instances
    return one, [str(loss) for loss in report.losses if loss.picture]


def test_colour_after_a_distance_is_a_coefficient(tmp_path: Path) -> None:
    one, lost = glass(tmp_path, {}, thicknessFactor=0.25, attenuationColor=[0.5, 0.25, 1.0], attenuationDistance=2.0)
    wanted = Medium((math.log(2.0) / 2.0, math.log(2.0), 0.0))
    assert lost == [] and difference(one.interior, wanted) is None and one.material == Glass()


@pytest.mark.parametrize(
    ("volume", "loss"),
    [
        ({"thicknessFactor": 1.0, "attenuationColor": [0.5, 0.5, 0.5]}, None),  # at an infinite distance
        ({"thicknessFactor": 0.0, "attenuationColor": [0.5, 0.5, 0.5], "attenuationDistance": 1.0}, None),  # a pane
        ({"thicknessFactor": 1.0, "attenuationColor": [1, 1, 1], "attenuationDistance": 1.0}, None),
        ({"thicknessFactor": 1.0, "attenuationColor": [0, 1, 1], "attenuationDistance": 1.0}, "below 1e-08"),
        ({"thicknessFactor": 1.0, "attenuationColor": [2, 0.5, 1], "attenuationDistance": 1.0}, "above 1"),
        ({"thicknessFactor": 1.0, "attenuationColor": [0.5, 0.5, 1], "attenuationDistance": 0.0}, "distance of 0"),
    ],
)
def test_volumes_without_a_coefficient(volume: dict[str, Any], loss: str | None, tmp_path: Path) -> None:
    one, lost = glass(tmp_path, {}, **volume)
    assert [loss in text for text in lost] == ([True] if loss else [])
    assert (one.interior is not None) == (loss in ("below 1e-08", "above 1"))


def test_metals_let_no_light_through(tmp_path: Path) -> None:
    """Their factor is 1 where it is not given."""
    one, lost = glass(tmp_path, {"metallicFactor": 1.0}, thicknessFactor=1.0)
    assert lost == [] and isinstance(one.material, MetallicRough) and one.material.metallic == 1.0


def test_light_that_passes_in_part_is_a_mixture(tmp_path: Path) -> None:
    one, lost = glass(tmp_path, {"metallicFactor": 0.2, "roughnessFactor": 0.5}, 0.5, thicknessFactor=1.0)
    base = ConstantTexture((1.0, 1.0, 1.0))
    wanted = MixMaterial(
        MetallicRough(base, 0.2 / 0.6, 0.5),
        Glass(transmittance=base, roughness=(0.25, 0.25)),
        ConstantTexture((0.4,) * 3),
    )
    assert lost == [] and difference(one.material, wanted) is None


def test_what_glass_has_besides_is_kept_or_reported(tmp_path: Path) -> None:
    _, lost = glass(tmp_path, {"roughnessFactor": 0.5})
    assert any("a rough pane: a clear one" in text for text in lost)
    file, report = Gltf(tmp_path), LossReport()
    through = {"transmissionFactor": 1.0}
    file.material(
        alphaMode="BLEND", emissiveFactor=[1, 1, 1],
        pbrMetallicRoughness={"baseColorFactor": [1, 1, 1, 0.5], "metallicFactor": 0.0, "roughnessFactor": 0.0},
        extensions={"KHR_materials_transmission": through},
    )  # fmt: skip
    (one,) = load_scene_file(file.written(), None, report).instances
    assert type(one.material).__name__ == "Masked" and "light of a surface" in report.text()


@pytest.mark.parametrize("material", [Glass(ior=1.3), NOTHING], ids=["glass", "border"])
def test_absorption_comes_back(material: Any, tmp_path: Path) -> None:
    tree, lost = written(tmp_path, block(material, interior=FOG))
    assert lost == []
    volume = tree["materials"][0]["extensions"]["KHR_materials_volume"]
    assert volume["attenuationDistance"] == 2.0
    np.testing.assert_allclose(volume["attenuationColor"], np.exp([-1.0, -0.5, 0.0]))
    (one,) = load_scene_file(tmp_path / "a.gltf").instances
    assert difference(one.interior, FOG) is None and difference(one.material, material) is None
    assert one.exterior is None


def test_media_that_glTF_does_not_hold_are_reported(tmp_path: Path) -> None:
    _, lost = written(tmp_path, block(interior=MILK))
    assert lost == ["shape: a medium inside a surface (scattering): its absorption alone"]
    (one,) = load_scene_file(tmp_path / "a.gltf").instances
    assert difference(one.interior, Medium(MILK.absorption)) is None and is_nothing(one.material)
    _, lost = written(tmp_path, block(GREY, interior=FOG, exterior=MILK))
    assert [text.partition(":")[2] for text in lost] == [
        " a medium inside a surface (absorbing): left out", " a medium outside a surface (scattering): left out"
    ]  # fmt: skip
    _, lost = written(tmp_path, block(Glass(thin=True), interior=FOG))
    assert lost == ["shape: a medium inside a surface (absorbing): left out"]
