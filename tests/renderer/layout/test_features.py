"""Kernels have the features that a scene requires: each addition switches on its own feature and no other."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
import torch

from renderer.kernels import entry as kernels
from renderer.layout.features import ALL, MEANING, PACKETS, Feature
from renderer.tables.requirements import explain, explanation, required
from renderer.trace import Renderer
from scenes import catalog
from scenes.canonical import (
    CheckerboardTexture,
    ConstantTexture,
    Cube,
    DirectionalLight,
    EnvironmentCamera,
    EnvironmentLight,
    Glass,
    HeightField,
    ImageTexture,
    Instance,
    Integrator,
    Matte,
    Mirror,
    OrthographicCamera,
    PerspectiveCamera,
    Phong,
    PointLight,
    Rectangle,
    RigidTrack,
    Scene,
    SceneError,
    Sphere,
    SpotLight,
)
from scenes.effects import scenes as effects
from tests.renderer.builders import place

GREY = Matte(ConstantTexture((0.5, 0.5, 0.5)))
BASE = Scene(PerspectiveCamera(), (Instance(Rectangle(), GREY, name="floor"),), (PointLight((0, 0, 9), (1, 1, 1)),))
STILL = RigidTrack(0.0, 1.0, np.zeros((1, 3)), np.array([[0.0, 0.0, 0.0, 1.0]]))
SKY = EnvironmentLight(np.ones((2, 2, 3), np.float32))
PIXELS = ImageTexture(np.ones((2, 2, 3), np.float32))


def with_instance(*new: Instance, **more) -> Scene:
    return dataclasses.replace(BASE, instances=(*BASE.instances, *new), **more)


def with_light(light) -> Scene:
    return dataclasses.replace(BASE, lights=(*BASE.lights, light))


@pytest.mark.parametrize(
    ("scene", "added"),
    [
        (dataclasses.replace(BASE, camera=PerspectiveCamera(lens_radius=0.1)), Feature.LENS),
        (dataclasses.replace(BASE, camera=OrthographicCamera()), Feature.PARALLEL),
        (dataclasses.replace(BASE, camera=EnvironmentCamera()), Feature.PANORAMA),
        (dataclasses.replace(BASE, camera=PerspectiveCamera(track=STILL)), Feature.MOTION),
        (dataclasses.replace(BASE, background=SKY), Feature.SKY),
        (with_instance(Instance(Sphere(), GREY)), Feature.SPHERE),
        (with_instance(Instance(Cube(), GREY)), Feature.CUBE),
        (with_instance(Instance(Rectangle(), GREY, track=STILL)), Feature.MOTION),
        (with_instance(Instance(Rectangle(), Mirror())), Feature.MIRROR),
        (with_instance(Instance(Rectangle(), Mirror(spread_deg=3.0))), Feature.MIRROR | Feature.GLOSSY),
        (with_instance(Instance(Rectangle(), Glass())), Feature.GLASS | Feature.MIRROR),
        (with_instance(Instance(Rectangle(), Matte(PIXELS))), Feature.IMAGE),
        (
            with_instance(Instance(Rectangle(), Matte(CheckerboardTexture(PIXELS, PIXELS)))),
            Feature.CHECKERBOARD | Feature.IMAGE,
        ),
        (
            with_instance(Instance(Rectangle(), Phong(ConstantTexture((0, 0, 0)), specular=(1, 1, 1)))),
            Feature.HIGHLIGHT,
        ),
        (
            with_instance(Instance(Rectangle(), HeightField(GREY, np.ones((2, 2), np.float32), 0.1))),
            Feature.HEIGHT_FIELD,
        ),
        (with_instance(Instance(Rectangle(), GREY, emission=(1, 1, 1))), Feature.QUAD),
        (with_light(DirectionalLight((0, 0, -1), (1, 1, 1))), Feature.DIRECTIONAL),
        (with_light(DirectionalLight((0, 0, -1), (1, 1, 1), 1.0)), Feature.SUN_DISC),
        (with_light(SpotLight((0, 0, 9), (0, 0, 0), (1, 1, 1), 10, 20)), Feature.SPOT),
        (with_light(SKY), Feature.ENVIRONMENT | Feature.SKY),
    ],
)
def test_an_addition_switches_on_exactly_its_own(scene: Scene, added: Feature) -> None:
    assert required(BASE) == Feature.FLAT | Feature.POINT
    assert required(scene) & ~required(BASE) == added
    assert required(BASE) & ~required(scene) == Feature(0)


def test_bundles_and_cells_are_needed_where_there_is_something_to_spread() -> None:
    many = Integrator(reflection_rays=8, shadow_rays="all")
    assert required(dataclasses.replace(BASE, integrator=many)) == required(BASE)
    glossy = with_instance(Instance(Rectangle(), Mirror(spread_deg=3.0), emission=(1, 1, 1)), integrator=many)
    assert required(glossy) & (Feature.MANY_RAYS | Feature.ALL_CELLS) == Feature.MANY_RAYS | Feature.ALL_CELLS


def test_lights_are_left_out_where_nothing_takes_their_light() -> None:
    scene = Scene(PerspectiveCamera(), (Instance(Sphere(), Mirror()),), (PointLight((0, 0, 9), (1, 1, 1)), SKY))
    assert required(scene) == Feature.SPHERE | Feature.MIRROR | Feature.SKY


def test_every_feature_has_words_and_a_cause() -> None:
    assert set(MEANING) == set(Feature)
    found = explain(effects.load("depth-of-field"))
    assert "lens_radius" in found[Feature.LENS] and list(found) == sorted(found)
    lines = explanation(effects.load("glass"))
    assert any(line.startswith("yes  refraction") and "'ball'" in line for line in lines)
    assert any(line.startswith(" -   thin lens") for line in lines)
    assert "sets of features are kept" in lines[-1]


def test_driving_scenes_are_traced_in_packets_and_effects_beyond_them_are_not() -> None:
    assert all(required(catalog.load(name)) | PACKETS == PACKETS for name in ("fly-by", "planescene", "spheresscene"))
    assert required(effects.load("glass")) | PACKETS != PACKETS


@pytest.mark.parametrize("name", [*effects.EFFECTS, "fly-by"])
def test_a_renderer_says_whether_samples_are_random(name: str) -> None:
    """The seed changes the samples of a scene if and only if they draw random numbers."""
    scene = catalog.load(name) if name in catalog.NAMES else effects.load(name)
    found = [Renderer(scene, specialise=False, packets=False, seed=seed) for seed in (0, 1)]
    pictures = [one.render_frame(0.5, 32, 32, 1) for one in found]
    assert not torch.equal(*pictures) if found[0].random else torch.equal(*pictures)


def test_the_number_of_sets_is_bounded(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(kernels, "SETS_MAX", 2)
    monkeypatch.setattr(kernels, "_asked", set())
    assert [kernels.nearest(Feature(bits)) for bits in (1, 2, 1, 4, 8)] == [1, 2, 1, ALL, ALL]


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: PerspectiveCamera(lens_radius=-0.1), "lens_radius: expected non-negative, got -0.1"),
        (lambda: PerspectiveCamera(focal_distance=0.0), "focal_distance: expected a positive number"),
        (lambda: PerspectiveCamera(shutter_s=(0.2, 0.1)), "shutter_s: expected open <= close"),
        (lambda: Glass(ior=0.0), "Glass.ior: expected a positive number"),
        (lambda: Mirror(spread_deg=200.0), "Mirror.spread_deg: expected an angle"),
        (lambda: HeightField(GREY, np.ones((0, 3), np.float32), 0.1), "HeightField.height: expected"),
        (lambda: HeightField(GREY, np.full((2, 2), np.nan, np.float32), 0.1), r"finite values in \[0, 1\]"),
        (lambda: HeightField(GREY, np.ones((2, 2), np.float32), -1.0), "HeightField.depth"),
        (lambda: Integrator(reflection_rays=0), "reflection_rays: expected 1 to 256, got 0"),
        (lambda: ImageTexture(np.ones((0, 2, 3), np.float32)), "expected .h, w, 3. with h, w >= 1"),
        (
            lambda: Instance(Rectangle(), GREY, np.diag([1.0, 0.0, 1.0, 1.0]), emission=(1, 1, 1), name="lamp"),
            "'lamp': to_world is singular",
        ),
        (lambda: Renderer(with_instance(Instance(Sphere(0.0), GREY, emission=(1, 1, 1)))), "positive radius|uniformly"),
        (lambda: Renderer(with_instance(Instance(Rectangle(), GREY, emission=(1, -1, 1)))), "emission.*no negative"),
        (
            lambda: Renderer(with_instance(Instance(Sphere(), GREY, place(scale=(1, 2, 1)), emission=(1, 1, 1)))),
            "uniformly scaled",
        ),
        (lambda: Renderer(with_light(dataclasses.replace(SKY, to_world=np.diag([1.0, 2.0, 1.0, 1.0])))), "rotation"),
    ],
)
def test_contradictions_have_their_line(make, message: str) -> None:
    with pytest.raises(SceneError, match=message) as caught:
        make()
    assert "\n" not in str(caught.value)
