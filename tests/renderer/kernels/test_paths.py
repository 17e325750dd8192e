"""Path tracing: energy in closed surroundings, closed forms, and independence of threads.

All scenes share one set of features, everything, so that kernels are compiled once.
"""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from renderer.layout.features import Feature
from renderer.sampling.plan import SamplePlan
from renderer.tables.coats import rough_shares, thrown_back
from renderer.tables.requirements import required
from renderer.trace import Renderer
from scenes.canonical import (
    ConstantTexture,
    DirectionalLight,
    EnvironmentLight,
    Glass,
    Instance,
    Integrator,
    Material,
    Matte,
    Metal,
    MetallicRough,
    Mirror,
    OrthographicCamera,
    PerspectiveCamera,
    Phong,
    Plastic,
    PointLight,
    Rectangle,
    Scene,
    SceneError,
    Sphere,
)
from scenes.formats.appearance.indices import mean_reflectance
from tests.renderer.builders import WHITE, batch, look_at, place

ONES = EnvironmentLight(np.ones((8, 16, 3), np.float32))
PATHS = Integrator("path", depth=32)


def grey(value: float) -> ConstantTexture:
    return ConstantTexture((value, value, value))


def mean_color(scene: Scene, samples: int = 1 << 14, **options) -> np.ndarray:
    """Mean ``(3,)`` of the samples of one pixel, the whole picture."""
    renderer = Renderer(scene, specialise=False, **options)
    plan = SamplePlan(samples, "sobol")
    zero = np.zeros(1, np.int64)
    position, _ = plan.samples(zero, zero, 1, 1, 0.0)
    return renderer.trace(batch(position[0], samples=samples)).color.numpy()[0].mean(axis=0, dtype=np.float64)


def wall(material: Material, *lights, depth: int = 32, **rest) -> Scene:
    """A rectangle that fills the picture of a parallel camera in front of it."""
    camera = OrthographicCamera(place((0.0, 0.0, 2.0)), 0.5)
    wide = Instance(Rectangle(), material, place(scale=(50, 50, 50)))
    return Scene(camera, (wide,), lights or (ONES,), integrator=Integrator("path", depth=depth), **rest)


def ball(material: Material) -> Scene:
    """A sphere whose middle fills the picture, lit alike from everywhere."""
    camera = PerspectiveCamera(look_at((0, 0, 4), (0, 0, 0)), 12.0)
    return Scene(camera, (Instance(Sphere(), material),), (ONES,), integrator=PATHS)


@pytest.mark.parametrize(
    ("material", "expected"),
    [
        (Matte(grey(0.4)), 0.4),
        (Phong(grey(0.4)), 0.4),
        (Mirror(grey(0.4)), 0.4),
        (Mirror(grey(0.4), spread_deg=20.0), 0.4),
        (Metal((0, 0, 0), (1, 1, 1), reflectance_scale=grey(0.4)), 0.4),
        (Glass(), 1.0),
        (Glass(thin=True), 1.0),
        (Glass(roughness=(0.01, 0.01)), 1.0),
        (Glass(roughness=(0.01, 0.01), distribution="beckmann"), 1.0),
        (Plastic(WHITE), 1.0),
        (Metal((0, 0, 0), (1, 1, 1), (0.01, 0.01)), 1.0),
        (MetallicRough(WHITE, 1.0, 0.1), 1.0),
    ],
    ids=lambda value: getattr(type(value), "__name__", None),
)
def test_light_is_neither_made_nor_lost(material: Material, expected: float) -> None:
    np.testing.assert_allclose(mean_color(ball(material)), expected, rtol=4e-3)


@pytest.mark.parametrize("rough", [0.2, 0.6, 1.0])
def test_rough_surfaces_make_no_light(rough: float) -> None:
    surfaces = (
        MetallicRough(WHITE, 0.0, rough), MetallicRough(WHITE, 0.5, rough, coat=1.0, coat_roughness=0.3),
        Metal((0, 0, 0), (1, 1, 1), (rough, rough)), Glass(roughness=(rough, rough)), Plastic(WHITE, roughness=rough),
        Matte(WHITE, 90.0 * rough), Glass(roughness=(rough, rough), distribution="beckmann"),
        Plastic(WHITE, roughness=rough, distribution="beckmann"),
    )  # fmt: skip
    for material in surfaces:
        assert 0.3 < mean_color(wall(material), 1 << 12).mean() < 1.01, material


def _facets(alpha: float, turn: float) -> float:
    """Share that facets of alpha reflect of even light seen at an angle, all of which reflect all, by quadrature."""
    theta, phi = np.meshgrid((np.arange(400) + 0.5) * np.pi / 800, (np.arange(800) + 0.5) * np.pi / 400, indexing="ij")
    into = np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], -1)
    out = np.array([np.sin(turn), 0.0, np.cos(turn)])
    half = into + out
    half /= np.linalg.norm(half, axis=-1, keepdims=True)
    d = alpha**2 / (np.pi * ((alpha**2 - 1.0) * half[..., 2] ** 2 + 1.0) ** 2)
    g = [2.0 / (1.0 + np.sqrt(1.0 + alpha**2 * (1.0 / np.square(c) - 1.0))) for c in (into[..., 2], out[2])]
    value = d * g[0] * g[1] / (4.0 * out[2])
    return float((value * np.sin(theta)).sum() * (np.pi / 800) * (np.pi / 400))


@pytest.mark.parametrize(("rough", "turn"), [(0.6, 0.0), (0.6, 1.0), (0.8, 0.5)])
def test_facets_reflect_what_their_formula_does(rough: float, turn: float) -> None:
    scene = wall(MetallicRough(WHITE, 1.0, rough))
    turned = dataclasses.replace(scene.instances[0], to_world=place(axis_angle=(turn, 0, 0), scale=(50, 50, 50)))
    expected = _facets(rough**2, turn)
    for material in (MetallicRough(WHITE, 1.0, rough), Metal((0, 0, 0), (1, 1, 1), (rough**2, rough**2))):
        tilted = dataclasses.replace(scene, instances=(dataclasses.replace(turned, material=material),))
        np.testing.assert_allclose(mean_color(tilted), expected, rtol=4e-3)


def _beckmann_shares(alpha: float, turn: float, ratio: float) -> tuple[float, float]:
    """Shares of even light seen at an angle that Beckmann facets reflect and transmit, by quadrature over normals."""
    theta, phi = np.meshgrid((np.arange(800) + 0.5) * np.pi / 1600, (np.arange(800) + 0.5) * np.pi / 400, indexing="ij")
    normal = np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], -1)
    out = np.array([np.sin(turn), 0.0, np.cos(turn)])
    toward = np.maximum(normal @ out, 0.0)
    d = np.exp(-(np.tan(theta) ** 2) / alpha**2) / (np.pi * alpha**2 * np.cos(theta) ** 4)
    visible = d * _beckmann_seen(out[2], alpha) * toward / out[2] * np.sin(theta) * (np.pi / 1600) * (np.pi / 400)
    beyond = np.sqrt(np.maximum(1.0 - ratio**2 * (1.0 - toward**2), 0.0))
    across = ((ratio * toward - beyond) / np.maximum(ratio * toward + beyond, 1e-9)) ** 2
    within = ((toward - ratio * beyond) / np.maximum(toward + ratio * beyond, 1e-9)) ** 2
    reflectance = 0.5 * (across + within)
    mirrored = 2.0 * toward * normal[..., 2] - out[2]
    bent = ratio * out[2] - (ratio * toward - beyond) * normal[..., 2]
    shares = (reflectance, mirrored), (1.0 - reflectance, bent)
    first, second = (float((visible * f * _beckmann_seen(c, alpha) * (c > 0.0)).sum()) for f, c in shares)
    return first, second


def _beckmann_seen(cosine, alpha: float):
    a = 1.0 / (alpha * np.tan(np.arccos(np.clip(np.abs(cosine), 1e-6, 1.0 - 1e-9))))
    return np.where(a < 1.6, (3.535 * a + 2.181 * a * a) / (1.0 + 2.276 * a + 2.577 * a * a), 1.0)


@pytest.mark.parametrize(("alpha", "turn"), [(0.3, 0.0), (0.3, 1.0), (0.6, 0.5)])
def test_beckmann_glass_scatters_as_its_formula_does(alpha: float, turn: float) -> None:
    """In even light, which has the same radiance on both sides here; and the table of coats agrees."""
    scene = wall(Glass(roughness=(alpha, alpha), distribution="beckmann"))
    turned = dataclasses.replace(scene.instances[0], to_world=place(axis_angle=(turn, 0, 0), scale=(50, 50, 50)))
    expected = _beckmann_shares(alpha, turn, 1.0 / 1.5)
    found = mean_color(dataclasses.replace(scene, instances=(turned,)), 1 << 15)
    np.testing.assert_allclose(found, expected[0] + expected[1] / 1.5**2, rtol=6e-3)
    np.testing.assert_allclose(rough_shares(float(np.cos(turn)), 1.0 / 1.5, alpha, "beckmann"), expected, rtol=6e-3)


def test_what_a_coat_throws_back_inside_is_walshs() -> None:
    for ior in (1.1, 1.5, 2.4):
        assert thrown_back(ior) == pytest.approx(1.0 - (1.0 - mean_reflectance(ior)) / ior**2, abs=1e-5)


def test_a_closed_box_gathers_all_bounces() -> None:
    """Between walls that all glow, each bounce adds a share: the sum of a geometric series."""
    half = np.pi / 2
    turns = ((0, 0, 0), (0, half, 0), (0, -half, 0), (half, 0, 0), (-half, 0, 0), (0, 2 * half, 0))
    walls = (place(axis_angle=turn) @ place((0.0, 0.0, -1.0)) for turn in turns)
    lamps = tuple(Instance(Rectangle(), Matte(grey(0.5)), wall, emission=(1.0, 1.0, 1.0)) for wall in walls)
    scene = Scene(PerspectiveCamera(np.eye(4), 60.0), lamps, integrator=Integrator("path", depth=64))
    assert mean_color(scene) == pytest.approx(np.full(3, 2.0), rel=6e-3)
    short = dataclasses.replace(scene, integrator=Integrator("path", depth=1))
    assert mean_color(short) == pytest.approx(np.full(3, 1.75), rel=4e-3)


@pytest.mark.parametrize(
    "light", [PointLight((0.3, 0.5, 1.5), (3.0, 2.0, 1.0)), DirectionalLight((0.3, 0.2, -1.0), (3.0, 2.0, 1.0))]
)
def test_direct_light_is_that_of_the_tree_of_rays(light) -> None:
    material = Phong(ConstantTexture((0.2, 0.5, 0.7)), (0.4, 0.3, 0.2), 8.0)
    camera = PerspectiveCamera(place((0.0, 0.0, 2.0)), 30.0)
    scene = dataclasses.replace(wall(material, light, depth=0), camera=camera)
    tree = dataclasses.replace(scene, integrator=Integrator("whitted", depth=0))
    place_on = batch(np.array([[0.4, 0.6], [0.1, 0.2]]))
    found = [
        Renderer(one, specialise=False, packets=packets).trace(place_on).color
        for one, packets in ((scene, False), (tree, True))
    ]
    np.testing.assert_allclose(found[0], found[1], rtol=1e-4)


def test_lamps_of_both_shapes_are_as_bright_as_their_solid_angle() -> None:
    """For all ratios of the densities of both sampling strategies: lamps near and far, surfaces rough and nearly
    specular."""
    for shape, size in ((Sphere(), 0.4), (Rectangle(), 0.5)):
        lamp = Instance(shape, Matte(grey(0.0)), place((0.0, 0.0, 3.0), (np.pi, 0, 0), (size,) * 3), emission=(1, 1, 1))
        scene = wall(Matte(grey(1.0)))
        camera = OrthographicCamera(place((0.0, 0.0, 1.0)), 1e-3)
        scene = dataclasses.replace(scene, camera=camera, lights=(), instances=(*scene.instances, lamp))
        point = dataclasses.replace(scene, integrator=Integrator("path", depth=0))
        if isinstance(shape, Sphere):
            expected = (size / 3.0) ** 2  # sine squared of its radius
        else:
            at = (np.arange(1000) + 0.5) / 1000 * 2 * size - size
            x, y = np.meshgrid(at, at)
            square = x**2 + y**2 + 9.0
            expected = float((9.0 / square**2).sum()) * (2 * size / 1000) ** 2 / np.pi
        np.testing.assert_allclose(mean_color(point, 1 << 15), expected, rtol=1e-2)


def test_shadow_rays_are_tinted_by_panes_and_not_by_thick_glass() -> None:
    tint = ConstantTexture((0.9, 0.5, 0.1))
    pane = Instance(Rectangle(), Glass(transmittance=tint, thin=True), place((1.0, 0.0, 1.5), scale=(0.2, 9, 9)))
    bare = wall(Matte(grey(1.0)), DirectionalLight((-1.0, 0.0, -1.5), (1.0, 1.0, 1.0)), depth=0)
    with_pane = dataclasses.replace(bare, instances=(*bare.instances, pane))
    camera = OrthographicCamera(place((0.0, 0.0, 2.0)), 0.01)
    found = [mean_color(dataclasses.replace(one, camera=camera), 64) for one in (bare, with_pane)]
    cosine = 1.5 / np.hypot(1.0, 1.5)
    beyond = np.sqrt(1.0 - (1.0 - cosine**2) / 1.5**2)
    across, within = (
        (cosine - 1.5 * beyond) / (cosine + 1.5 * beyond),
        (1.5 * cosine - beyond) / (1.5 * cosine + beyond),
    )
    once = 0.5 * (across**2 + within**2)
    np.testing.assert_allclose(found[1] / found[0], np.array(tint.value) * (1.0 - 2.0 * once / (1.0 + once)), rtol=1e-4)
    solid = dataclasses.replace(pane, material=Glass())
    dark = dataclasses.replace(bare, instances=(*bare.instances, solid), camera=camera)
    assert (mean_color(dark, 64) == 0.0).all()


def test_pictures_are_the_same_bits_for_any_number_of_threads_and_as_framelets() -> None:
    scene = ball(MetallicRough(grey(0.6), 0.3, 0.4))
    position = np.random.default_rng(0).random((4096, 2))
    found = [Renderer(scene, specialise=False, threads=n).trace(batch(position, samples=16)).color for n in (1, 3)]
    assert (found[0] == found[1]).all()
    part = Renderer(scene, specialise=False).trace(batch(position[160:320], samples=16)).color
    assert (part == found[0][10:20]).all()


def test_paths_are_for_scenes_that_ask_for_them() -> None:
    scene = ball(Matte(grey(0.4)))
    assert Feature.PATHS in required(scene)
    plain = dataclasses.replace(scene, integrator=Integrator())
    assert not required(plain) & (Feature.PATHS | Feature.FACETS | Feature.PASSING | Feature.BENT)
    with pytest.raises(SceneError, match="MetallicRough is not supported"):
        Renderer(dataclasses.replace(plain, instances=(Instance(Sphere(), MetallicRough(WHITE)),)))


def test_a_background_lights_surfaces_where_there_is_no_other_environment() -> None:
    scene = wall(Matte(grey(0.4)), depth=2)
    shown = dataclasses.replace(scene, lights=(), background=ONES, ambient=(9.0, 9.0, 9.0))
    np.testing.assert_allclose(mean_color(shown), 0.4, rtol=4e-3)
