"""What used to be lost by way of glTF: light of the back, and constant normals."""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from analysis.conversion.options import FORMATS_OF
from renderer.frames import render_image
from renderer.sampling.plan import SamplePlan
from renderer.trace import Renderer
from scenes.canonical import (
    ConstantTexture,
    DirectionalLight,
    Emissive,
    ImageTexture,
    Instance,
    Integrator,
    Masked,
    Material,
    Matte,
    NormalMapped,
    PerspectiveCamera,
    Rectangle,
    Scene,
    Sphere,
)
from scenes.formats.conversion import load_scene_file, save_scene_file
from scenes.formats.losses import LossReport
from tests.scenes.formats.files import drawn
from tests.scenes.formats.gltf.files import GREY
from tests.scenes.models.files import Gltf

BEHIND = "a surface that shines on both sides"
TILTED = ConstantTexture((0.8, 0.5, 0.9))
INWARD = ImageTexture(np.full((2, 2, 3), (0.5, 0.5, 0.0), np.float32))


def losses(report: LossReport) -> str:
    return " ".join(str(loss) for loss in report.losses if loss.picture)


def glowing(folder: Path, **more: Any) -> Path:
    """A glTF file of a grey square that shines, without normals."""
    file = Gltf(folder)
    rough = {"baseColorFactor": [0.5, 0.5, 0.5, 1], "metallicFactor": 0.0, "roughnessFactor": 1.0}
    file.material(pbrMetallicRoughness=rough, emissiveFactor=[1, 0.5, 0.25],
                  extensions={"KHR_materials_specular": {"specularFactor": 0}}, **more)  # fmt: skip
    return file.written()


@pytest.mark.parametrize(
    ("name", "to", "kept"),
    [("b.pbrt", "pbrt", True), ("b.pbrt", "pbrt4", True), ("b.gltf", "gltf", True), ("b.xml", "mitsuba3", False),
     ("b.xml", "mitsuba", False), ("b.lxs", "luxrender", False)],
)  # fmt: skip
def test_light_of_the_back_is_kept_or_named(name: str, to: str, kept: bool, tmp_path: Path) -> None:
    report = LossReport()
    scene = load_scene_file(glowing(tmp_path, doubleSided=True), None, report)
    assert scene.instances[0].emission_twosided and BEHIND not in losses(report)
    save_scene_file(scene, tmp_path / name, to, report)
    assert (BEHIND in losses(report)) != kept
    again = load_scene_file(tmp_path / name, None, report)
    lamp = next(one for one in again.instances if one.emission is not None)
    assert lamp.emission == (1.0, 0.5, 0.25) and lamp.emission_twosided == kept


@pytest.mark.parametrize("to", ["pbrt", "pbrt4", "gltf", "mitsuba3", "mitsuba", "luxrender"])
def test_light_of_the_front_alone_is_no_loss(to: str, tmp_path: Path) -> None:
    report = LossReport()
    scene = load_scene_file(glowing(tmp_path), None, report)
    ending = {"luxrender": ".lxs", "gltf": ".gltf"}.get(to, ".xml" if to.startswith("mitsuba") else ".pbrt")
    save_scene_file(scene, tmp_path / f"b{ending}", to, report)
    again = load_scene_file(tmp_path / f"b{ending}", None, report)
    assert not any(one.emission_twosided for one in again.instances) and BEHIND not in losses(report)


def test_light_of_the_back_of_a_closed_shape_is_not_seen(tmp_path: Path) -> None:
    report = LossReport()
    save_scene_file(Scene(PerspectiveCamera(), (Instance(Sphere(), Emissive((1.0, 1.0, 1.0))),)), tmp_path / "a.xml",
                    None, report)  # fmt: skip
    assert BEHIND not in losses(report)


def test_a_black_surface_does_not_shine(tmp_path: Path) -> None:
    report, black = LossReport(), Matte(ConstantTexture((0.0, 0.0, 0.0)))
    save_scene_file(Scene(PerspectiveCamera(), (Instance(Rectangle(), black),)), tmp_path / "a.gltf", None, report)
    (part,) = load_scene_file(tmp_path / "a.gltf", None, report).instances
    assert part.material == black and part.emission is None


def mapped(normals: ConstantTexture | ImageTexture, scale: float = 1.0) -> Scene:
    """A square with bent normals, seen from above, under light from the right."""
    view = np.eye(4)
    view[2, 3] = 6.0
    square = Instance(Rectangle(), NormalMapped(Matte(ConstantTexture((0.5, 0.4, 0.3))), normals, scale))
    return Scene(PerspectiveCamera(view, 10.0), (square,), (DirectionalLight((-0.6, 0.0, -0.8), (2.0, 2.0, 2.0)),),
                 integrator=Integrator("path", 2))  # fmt: skip


def mean(scene: Scene) -> float:
    return float(render_image(Renderer(scene), SamplePlan(16), 16, 16, 0.0, (0.0, 0.0)).numpy().mean())


@pytest.mark.parametrize(("scale", "cosine"), [(1.0, 1.0), (0.5, 0.82 / math.hypot(0.3, 0.8))])
def test_constant_normals_reach_gltf_and_mitsuba(scale: float, cosine: float, tmp_path: Path) -> None:
    """The normal leans to the light by asin(0.6), or by less; matte surfaces reflect by the cosine."""
    scene, report = mapped(TILTED, scale), LossReport()
    save_scene_file(scene, tmp_path / "a.glb", None, report)
    again = load_scene_file(tmp_path / "a.glb", None, report)
    assert "normal" not in losses(report)
    expected = 0.4 * 2.0 / np.pi * cosine
    assert mean(scene) == pytest.approx(expected, rel=0.01) and mean(again) == pytest.approx(expected, rel=0.01)
    theirs = drawn(dataclasses.replace(again, film=scene.film), "mitsuba", tmp_path, 16, 64)
    assert theirs.mean() == pytest.approx(expected, rel=0.01)


@pytest.mark.parametrize(
    "material", [NormalMapped(GREY, ConstantTexture((0.5, 0.5, 1.0))), NormalMapped(GREY, TILTED, 0.0)]
)
@pytest.mark.parametrize("name", ["a.gltf", "a.pbrt", "a.xml", "a.lxs"])
def test_normals_that_bend_nothing_are_no_loss(material: Material, name: str, tmp_path: Path) -> None:
    report = LossReport()
    save_scene_file(Scene(PerspectiveCamera(), (Instance(Rectangle(), material),)), tmp_path / name, None, report)
    assert "normal" not in losses(report)


@pytest.mark.parametrize("ending", [".gltf", ".usda"])
@pytest.mark.parametrize(
    "material", [NormalMapped(GREY, ConstantTexture((0.5, 0.5, 0.0))), NormalMapped(GREY, INWARD, 0.0)]
)
def test_normals_that_point_inwards_are_kept(material: NormalMapped, ending: str, tmp_path: Path) -> None:
    if ending == ".usda":
        pytest.importorskip("pxr")
    save_scene_file(Scene(PerspectiveCamera(), (Instance(Rectangle(), material),)), tmp_path / f"a{ending}")
    found = load_scene_file(tmp_path / f"a{ending}").instances[0].material
    assert isinstance(found, NormalMapped) and isinstance(found.normals, ImageTexture)
    assert (found.normals.image[..., 2] < 0.01).all()


@pytest.mark.parametrize("ending", [".gltf", ".usda"])
@pytest.mark.parametrize("to", ["pbrt", "pbrt4", "mitsuba", "mitsuba3", "luxrender"])
def test_glowing_surfaces_with_holes_keep_the_light_of_both_sides(ending: str, to: str, tmp_path: Path) -> None:
    if ending == ".usda":
        pytest.importorskip("pxr")
    material = Masked(Emissive((3.0, 2.0, 1.0)), ConstantTexture((0.5,) * 3))
    save_scene_file(Scene(PerspectiveCamera(), (Instance(Rectangle(), material),)), tmp_path / f"a{ending}")
    read, report = load_scene_file(tmp_path / f"a{ending}"), LossReport()
    assert (read.instances[0].emission, read.instances[0].emission_twosided) == ((3.0, 2.0, 1.0), True)
    file = tmp_path / f"b{FORMATS_OF[to]}"
    save_scene_file(read, file, to, report)
    found = load_scene_file(file).instances[0]
    assert found.emission == pytest.approx((3.0, 2.0, 1.0))
    told = any(loss.what == "a surface that shines on both sides" for loss in report.losses)
    assert found.emission_twosided or told
