"""Effects of lenses, glossy surfaces and glass on a picture, compared with optics."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from renderer.trace import Renderer
from scenes.canonical import (
    ConstantTexture,
    Cube,
    DirectionalLight,
    Disk,
    Emissive,
    EnvironmentLight,
    Glass,
    Instance,
    Integrator,
    Matte,
    Mirror,
    OrthographicCamera,
    PerspectiveCamera,
    Rectangle,
    Scene,
    Sphere,
)
from tests.renderer.builders import look_at, place
from tsar.types import FrameletBatch

WHITE = EnvironmentLight(np.ones((1, 1, 3), np.float32))
GLOW = Emissive((1.0, 1.0, 1.0))


def means(scene: Scene, positions: np.ndarray, samples: int = 1, seed: int = 0) -> np.ndarray:
    """Mean radiance (its red part) of a group of samples at each of some image positions ``(n, 2)``."""
    renderer = Renderer(scene, packets=False, specialise=False, throughput_cutoff=0.0, seed=seed)
    position = torch.tensor(positions, dtype=torch.float32)[:, None].expand(-1, samples, -1)
    number = torch.zeros(len(positions), dtype=torch.int64)
    color = renderer.trace(FrameletBatch(number, number, position.contiguous(), 0.0)).color
    renderer.close()
    assert color.isfinite().all()
    return color[..., 0].mean(dim=1).numpy()


def row(count: int, low: float = 0.0, high: float = 1.0) -> np.ndarray:
    """Positions along the middle row of the image."""
    x = low + (np.arange(count) + 0.5) * (high - low) / count
    return np.stack([x, np.full(count, 0.5)], axis=1)


@pytest.mark.parametrize("distance", [2.0, 8.0])
def test_a_point_out_of_focus_becomes_the_circle_of_confusion(distance: float) -> None:
    """Thin lens: of diameter ``2 R |d - f| / d`` in the plane in focus at ``f``."""
    radius, focal, tangent = 0.2, 4.0, np.tan(np.radians(20.0))
    camera = PerspectiveCamera(fov_deg=40.0, lens_radius=radius, focal_distance=focal)
    dot = Instance(Disk(0.004 * distance), GLOW, place((0.0, 0.0, -distance)))
    profile = means(Scene(camera, (dot,)), row(400, 0.35, 0.65), 1 << 14)
    width = (profile > 0.5 * np.median(profile[profile > 0.0])).mean() * 0.3
    expected = 2.0 * radius * abs(distance - focal) / distance / (2.0 * focal * tangent)
    assert width == pytest.approx(expected, rel=0.03)


def test_what_is_in_focus_is_sharp() -> None:
    camera = PerspectiveCamera(fov_deg=40.0, lens_radius=0.2, focal_distance=4.0)
    edge = Instance(Rectangle(), GLOW, place((1.0, 0.0, -4.0)))
    profile = means(Scene(camera, (edge,)), row(64), 64)
    assert set(np.round(profile, 5)) == {0.0, 1.0}
    assert np.argmax(profile > 0.5) == 32


@pytest.mark.parametrize("spread_deg", [4.0, 30.0])
def test_a_glossy_mirror_fills_its_cone_evenly(spread_deg: float) -> None:
    """A disk of half angle x about the mirrored direction takes (1 - cos x) / (1 - cos a) of the rays."""
    half = np.radians(spread_deg / 2.0)
    mirror = Instance(Rectangle(), Mirror(spread_deg=spread_deg), place(axis_angle=(-np.pi / 2, 0.0, 0.0)))
    camera = PerspectiveCamera(look_at((-3.0, 3.0, 0.0), (0.0, 0.0, 0.0)), 1e-3)
    towards = np.array([1.0, 1.0, 0.0]) / np.sqrt(2.0)
    for share in (0.3, 0.6, 0.9, 1.05):
        facing = look_at(10.0 * towards, (0.0, 0.0, 0.0))
        disk = Instance(Disk(10.0 * np.tan(share * half)), GLOW, facing)
        seen = means(Scene(camera, (mirror, disk)), np.full((1, 2), 0.5), 1 << 14)[0]
        expected = min((1.0 - np.cos(share * half)) / (1.0 - np.cos(half)), 1.0)
        assert seen == pytest.approx(expected, abs=0.01), share


def test_glossy_refraction_is_spread_about_the_refracted_ray() -> None:
    """Through a thin pane the cone is about the straight ray."""
    half = np.radians(10.0)
    pane = Instance(Rectangle(), Glass(thin=True, spread_deg=20.0), place((0.0, 0.0, -2.0)))
    camera = PerspectiveCamera(fov_deg=1e-3)
    passed = 1.0 - 2.0 * 0.04 / 1.04  # twice through surfaces that reflect 4 %, all orders summed
    for share in (0.4, 0.8, 1.05):
        disk = Instance(Disk(10.0 * np.tan(share * half)), GLOW, place((0.0, 0.0, -12.0)))
        seen = means(Scene(camera, (pane, disk)), np.full((1, 2), 0.5), 1 << 14)[0]
        expected = passed * min((1.0 - np.cos(share * half)) / (1.0 - np.cos(half)), 1.0)
        assert seen == pytest.approx(expected, abs=0.01), share


@pytest.mark.parametrize("tilt_deg", [20.0, 55.0])
def test_a_slab_of_glass_shifts_what_is_behind_it(tilt_deg: float) -> None:
    """Snell: by ``t sin(a - b) / cos b`` across the ray, with ``sin b = sin a / n``."""
    ior, thickness = 1.5, 0.8
    slab = Instance(Cube(), Glass(ior=ior), place(axis_angle=(0.0, np.radians(tilt_deg), 0.0), scale=(9, 9, 0.4)))
    edge = Instance(Rectangle(), GLOW, place((9.0, 0.0, -20.0), scale=(9.0, 9.0, 1.0)))
    camera = OrthographicCamera(place((0.0, 0.0, 9.0)), half_width=1.0)
    found = []
    for instances in ((edge,), (slab, edge)):
        profile = means(Scene(camera, instances, integrator=Integrator(depth=2)), row(4000))
        found.append(2.0 * np.argmax(profile > 0.5 * profile.max()) / 4000)
    a = np.radians(tilt_deg)
    b = np.arcsin(np.sin(a) / ior)
    assert abs(found[1] - found[0]) == pytest.approx(thickness * np.sin(a - b) / np.cos(b), abs=0.002)


def fresnel_transmittance(angle: np.ndarray, ior_here: float, ior_beyond: float) -> np.ndarray:
    """Textbook form, by the two angles; 0 beyond the critical one."""
    sine = np.sin(angle) * ior_here / ior_beyond
    beyond = np.arcsin(np.clip(sine, -1.0, 1.0))
    across = np.sin(angle - beyond) / np.sin(angle + beyond)
    within = np.tan(angle - beyond) / np.tan(angle + beyond)
    return np.where(sine < 1.0, 1.0 - 0.5 * (across**2 + within**2), 0.0)


def test_from_inside_glass_the_world_is_seen_up_to_the_critical_angle() -> None:
    """Fresnel's transmittance, times n² since radiance is squeezed into the smaller solid angle; nothing beyond."""
    ior = 1.5
    block = Instance(Cube(), Glass(ior=ior), place(scale=(50.0, 50.0, 2.0)))
    camera = PerspectiveCamera(fov_deg=110.0)
    positions = row(2000, 0.5, 1.0)
    profile = means(Scene(camera, (block,), background=WHITE, integrator=Integrator(depth=1)), positions)
    angle = np.arctan((2.0 * positions[:, 0] - 1.0) * np.tan(np.radians(55.0)))
    np.testing.assert_allclose(profile, ior**2 * fresnel_transmittance(angle, ior, 1.0), atol=2e-3)
    critical = angle[np.flatnonzero(profile > 0.0)[-1]]
    assert np.degrees(critical) == pytest.approx(np.degrees(np.arcsin(1.0 / ior)), abs=0.05)


@pytest.mark.parametrize(
    "glass", [Glass(), Glass(ior=2.4), Glass(ior=1.0 / 1.5), Glass(thin=True), Glass(spread_deg=5)]
)
def test_clear_glass_in_an_even_world_is_not_seen(glass: Glass) -> None:
    """Furnace: what is not reflected passes, and all of it comes out again."""
    ball = Instance(Sphere(), glass, place((0.0, 0.0, -4.0)))
    scene = Scene(PerspectiveCamera(), (ball,), background=WHITE, integrator=Integrator(depth=64))
    np.testing.assert_allclose(means(scene, row(50, 0.1, 0.9)), 1.0, atol=2e-3)


def test_mirrors_in_an_even_world_are_not_seen() -> None:
    ball = Instance(Sphere(), Mirror(spread_deg=40.0), place((0.0, 0.0, -4.0)))
    np.testing.assert_allclose(means(Scene(PerspectiveCamera(), (ball,), background=WHITE), row(50)), 1.0, atol=1e-5)


def test_a_matte_surface_reflects_as_much_either_way() -> None:
    """Helmholtz: radiance over the cosine of arrival is the same with light and viewer exchanged."""
    ways = np.array([[0.5, 0.0, 0.8], [-0.3, 0.6, 0.4]])
    seen = []
    for viewer, light in (ways, ways[::-1]):
        sun = DirectionalLight(tuple(-light), (1.0, 1.0, 1.0))
        plate = Instance(Rectangle(), Matte(ConstantTexture((0.6, 0.6, 0.6))))
        camera = PerspectiveCamera(look_at(tuple(viewer), (0.0, 0.0, 0.0)), 1e-3)
        seen.append(
            means(Scene(camera, (plate,), (sun,)), np.full((1, 2), 0.5))[0] / (light[2] / np.linalg.norm(light))
        )
    assert seen[0] == pytest.approx(seen[1], rel=1e-5)
    assert seen[0] == pytest.approx(0.6 / np.pi, rel=1e-4)


def test_more_rays_at_the_first_surface_mean_less_noise_and_the_same_mean() -> None:
    mirror = Instance(Rectangle(), Mirror(spread_deg=40.0), place(axis_angle=(-np.pi / 2, 0.0, 0.0), scale=(9, 9, 1)))
    wall = Instance(Rectangle(), GLOW, place((9.0, 0.0, -4.0), scale=(9.0, 9.0, 1.0)))
    camera = PerspectiveCamera(look_at((0.0, 1.5, 4.0), (0.0, 0.0, 0.0)), 1e-2)
    spots = np.full((256, 2), 0.5) + np.linspace(0.0, 1e-3, 256)[:, None]
    found = {
        rays: means(Scene(camera, (mirror, wall), integrator=Integrator(reflection_rays=rays)), spots)
        for rays in (1, 16)
    }
    assert found[16].mean() == pytest.approx(found[1].mean(), abs=0.08)
    assert found[16].std() < 0.5 * found[1].std()


def test_a_panorama_sees_every_direction_of_the_map() -> None:
    from scenes.canonical import EnvironmentCamera

    image = np.random.default_rng(3).random((8, 16, 3)).astype(np.float32)
    scene = Scene(EnvironmentCamera(), (), background=EnvironmentLight(image))
    y, x = (np.stack(np.meshgrid(np.arange(8), np.arange(16), indexing="ij")) + 0.5) / np.array([8, 16])[:, None, None]
    seen = means(scene, np.stack([x.ravel(), y.ravel()], axis=1)).reshape(8, 16)
    # the camera looks along -z, at u = 0 of the map
    np.testing.assert_allclose(seen, np.roll(image[..., 0], 8, axis=1), atol=2e-3)
