"""Lights compared with radiometry: irradiance, fall-off, penumbras."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from renderer.tables.lights import summed_chances
from renderer.trace import Renderer
from scenes.canonical import (
    ConstantTexture,
    Cube,
    DirectionalLight,
    Emissive,
    EnvironmentLight,
    Instance,
    Integrator,
    Light,
    Matte,
    OrthographicCamera,
    PerspectiveCamera,
    Rectangle,
    RigidTrack,
    Scene,
    Sphere,
    SpotLight,
)
from tests.renderer.builders import place
from tsar.types import FrameletBatch

WHITE = Matte(ConstantTexture((1.0, 1.0, 1.0)))
UP = Instance(Rectangle(), WHITE, place(scale=(50.0, 50.0, 1.0)), name="floor")
FLOOR_VIEW = OrthographicCamera(place((0.0, 0.0, 0.05)), half_width=4.0)  # below whatever shines
ONE = Integrator()
ALL = Integrator(shadow_rays="all", light_cells=4)


def answer(scene: Scene, x: np.ndarray, samples: int, time_s: float = 0.0, seed: int = 0) -> tuple[np.ndarray, dict]:
    """π times the mean radiance, so the irradiance, at points ``x`` of the floor's x axis; and the rays it took."""
    renderer = Renderer(scene, packets=False, specialise=False, seed=seed)
    position = torch.stack([torch.as_tensor(x / 8.0 + 0.5, dtype=torch.float32), torch.full((len(x),), 0.5)], dim=1)
    number = torch.zeros(len(x), dtype=torch.int64)
    position = position[:, None].expand(-1, samples, -1).contiguous()
    times = torch.full(position.shape[:2], time_s, dtype=torch.float64)
    found = renderer.trace(FrameletBatch(number, number, position, times))
    renderer.close()
    assert found.color.isfinite().all()
    return np.pi * found.color[..., 0].double().mean(dim=1).numpy(), found.counters


def irradiance(*lights: Light | Instance, x=(0.0,), samples: int = 4096, integrator=ONE, **more) -> np.ndarray:
    """Irradiance of the floor at points of its x axis."""
    lamps = tuple(light for light in lights if isinstance(light, Instance))
    others = tuple(light for light in lights if not isinstance(light, Instance))
    scene = Scene(FLOOR_VIEW, (UP, *lamps), others, integrator=integrator)
    return answer(scene, np.asarray(x, np.float64), samples, **more)[0]


def lamp(shape, matrix: np.ndarray, radiance: float = 1.0, track: RigidTrack | None = None) -> Instance:
    return Instance(shape, Matte(ConstantTexture((0.0, 0.0, 0.0))), matrix, track, "lamp", (radiance,) * 3)


def below(height: float, half_x: float, half_y: float, x: float = 0.0) -> np.ndarray:
    """A rectangle above the floor that shines down."""
    return place((x, 0.0, height), (np.pi, 0.0, 0.0), (half_x, half_y, 1.0))


def corner_form_factor(a: float, b: float, height: float) -> float:
    """Of a rectangle ``a x b`` parallel to a patch below its corner (Howell, configuration B-4)."""
    x, y = a / height, b / height
    p, q = np.sqrt(1.0 + x * x), np.sqrt(1.0 + y * y)
    return (x / p * np.arctan(y / p) + y / q * np.arctan(x / q)) / (2.0 * np.pi)


@pytest.mark.parametrize("integrator", [ONE, ALL])
@pytest.mark.parametrize("mirrored", [1.0, -1.0])
def test_a_square_lamp_gives_its_form_factor(integrator: Integrator, mirrored: float) -> None:
    matrix = below(2.0, 1.5, 0.7) @ np.diag([mirrored, 1.0, 1.0, 1.0])
    expected = np.pi * 3.0 * 4.0 * corner_form_factor(1.5, 0.7, 2.0)
    assert irradiance(lamp(Rectangle(), matrix, 3.0), integrator=integrator)[0] == pytest.approx(expected, rel=3e-3)


def test_a_lamp_shines_to_one_side_and_is_seen_from_it() -> None:
    up = place((0.0, 0.0, 2.0))
    assert irradiance(lamp(Rectangle(), up))[0] == 0.0
    for matrix, seen in ((up, 2.5), (below(2.0, 1.0, 1.0), 0.0)):
        above = OrthographicCamera(place((0.0, 0.0, 9.0)))
        scene = Scene(above, (lamp(Rectangle(), matrix, 2.5),))
        assert answer(scene, np.zeros(1), 1)[0][0] == pytest.approx(np.pi * seen)


@pytest.mark.parametrize("distance", [1.2, 5.0, 3000.0])
def test_a_glowing_ball_gives_its_form_factor(distance: float) -> None:
    """``π L (R / d)²`` on a surface that faces it, near and far."""
    ball = lamp(Sphere(0.5), place((0.0, 0.0, distance), scale=(2.0, 2.0, 2.0)), 7.0)
    assert irradiance(ball)[0] == pytest.approx(np.pi * 7.0 / distance**2, rel=2e-3)


def test_inside_a_glowing_ball_its_light_is_not_taken() -> None:
    assert irradiance(lamp(Sphere(3.0), place()))[0] == 0.0


def test_the_sun_gives_what_it_is_said_to_whatever_its_width() -> None:
    for angle in (0.0, 0.53, 20.0, 120.0):
        sun = DirectionalLight((0.0, 0.0, -2.0), (1.5, 1.5, 1.5), angle)
        assert irradiance(sun)[0] == pytest.approx(1.5, rel=2e-3), angle


def test_a_spot_falls_off_between_its_angles() -> None:
    spot = SpotLight((0.0, 0.0, 2.0), (0.0, 0.0, 0.0), (5.0, 5.0, 5.0), 20.0, 50.0)
    x = np.linspace(0.0, 3.5, 40)
    cosine = 2.0 / np.hypot(2.0, x)
    low, high = np.cos(np.radians([50.0, 20.0]))
    part = np.clip((cosine - low) / (high - low), 0.0, 1.0)
    expected = 5.0 * part**2 * (3.0 - 2.0 * part) * cosine**3 / 4.0
    np.testing.assert_allclose(irradiance(spot, x=x, samples=1), expected, atol=1e-4)


def edge_above(height: float) -> Instance:
    """A thin plate over the half of the floor where x is negative."""
    return Instance(Cube(), WHITE, place((-20.0, 0.0, height), scale=(20.0, 20.0, 1e-4)), name="plate")


def width_of(profile: np.ndarray, x: np.ndarray) -> float:
    """Width of a ramp from 0 to 1, from where it passes a tenth to where nine tenths, over eight tenths."""
    low, high = (np.interp(level, profile, x) for level in (0.1, 0.9))
    return (high - low) / 0.8


@pytest.mark.parametrize("height", [0.5, 1.0])
def test_the_half_shadow_under_a_square_lamp_is_as_wide_as_similar_triangles_say(height: float) -> None:
    """Lamp of width w at h, edge at e: ``w e / (h - e)``; a far, narrow lamp darkens evenly over it."""
    lamp_width, far = 4.0, 20.0
    x = np.linspace(-0.6, 0.6, 481)
    light = lamp(Rectangle(), below(far, lamp_width / 2.0, 0.02), 1e4)
    scene = Scene(FLOOR_VIEW, (UP, edge_above(height), light))
    profile = answer(scene, x, 1024)[0]
    open_floor = irradiance(light)[0]
    expected = lamp_width * height / (far - height)
    assert width_of(profile / open_floor, x) == pytest.approx(expected, rel=0.03)


def test_the_half_shadow_of_the_sun_is_as_wide_as_its_disc() -> None:
    """At right angles, ``2 e tan(angle / 2)``; the darkening is the share of a disc cut by a chord."""
    angle, height = 6.0, 1.0
    x = np.linspace(-0.12, 0.12, 241)
    sun = DirectionalLight((0.0, 0.0, -1.0), (1.0, 1.0, 1.0), angle)
    scene = Scene(FLOOR_VIEW, (UP, edge_above(height)), (sun,))
    half = height * np.tan(np.radians(angle / 2.0))
    at = np.clip(x / half, -1.0, 1.0)
    expected = 0.5 + (at * np.sqrt(1.0 - at**2) + np.arcsin(at)) / np.pi
    np.testing.assert_allclose(answer(scene, x, 4096)[0], expected, atol=0.01)


def test_an_even_sky_gives_pi_and_a_white_ball_in_it_is_not_seen() -> None:
    sky = EnvironmentLight(np.full((4, 8, 3), 1.0, np.float32))
    assert irradiance(sky)[0] == pytest.approx(np.pi, rel=2e-3)
    ball = Instance(Sphere(), WHITE, place((0.0, 0.0, -4.0)))
    scene = Scene(PerspectiveCamera(), (ball,), (sky,))
    np.testing.assert_allclose(answer(scene, np.linspace(-3.9, 3.9, 40), 4096)[0], np.pi, rtol=4e-3)


def test_one_hot_texel_gives_its_own_light_with_little_noise() -> None:
    """Compared with the sum over a fine grid of directions of what the map shows there."""
    image = np.full((16, 32, 3), 1e-3, np.float32)
    image[3, 9] = 500.0
    sky = EnvironmentLight(image, place(axis_angle=(np.pi / 2, 0.0, 0.3)))
    # a panorama from the floor sees the same radiance that lights it
    from scenes.canonical import EnvironmentCamera

    renderer = Renderer(Scene(EnvironmentCamera(), (), background=sky), packets=False, specialise=False)
    view = renderer.render_frame(0.0, 512, 256)[..., 0].double().numpy()
    polar, turn = (np.arange(256) + 0.5) * np.pi / 256, ((np.arange(512) + 0.5) / 512 - 0.5) * 2.0 * np.pi
    # the camera looks along -z: what counts is the cosine to +z
    cosine = np.maximum(-(-np.cos(turn)[None] * np.sin(polar)[:, None]) * -1.0, 0.0)
    expected = (view * cosine * np.sin(polar)[:, None]).sum() * (np.pi / 256) * (2.0 * np.pi / 512)
    values = [irradiance(sky, samples=256, seed=seed)[0] for seed in range(8)]
    assert np.mean(values) == pytest.approx(expected, rel=0.02)
    assert np.std(values) < 0.05 * expected


def test_chances_of_the_sky_rise_from_0_to_1_also_where_it_is_black() -> None:
    image = np.zeros((6, 5, 3), np.float32)
    image[2, 3] = 1.0
    rows, columns = summed_chances(image)
    for limits in (rows[None], columns):
        assert (np.diff(limits, axis=1) >= 0.0).all()
        np.testing.assert_allclose(limits[:, [0, -1]], [[0.0, 1.0]] * len(limits))
    assert irradiance(EnvironmentLight(np.zeros((2, 2, 3), np.float32)))[0] == 0.0


def test_one_ray_in_all_or_one_in_every_cell() -> None:
    light = lamp(Rectangle(), below(2.0, 1.0, 1.0))
    scenes = [Scene(FLOOR_VIEW, (UP, light), integrator=integrator) for integrator in (ONE, ALL)]
    x = np.linspace(1.2, 2.0, 64)
    (one, rays_one), (every, rays_all) = (answer(scene, x, 16) for scene in scenes)
    assert (rays_one["shadow_rays"], rays_all["shadow_rays"]) == (64 * 16, 64 * 16 * 16)
    np.testing.assert_allclose(one, every, rtol=0.05)


def test_a_lamp_lights_from_where_it_is_at_the_time() -> None:
    track = RigidTrack(0.0, 1.0, np.array([[0.0, 0.0, 0.0], [4.0, 0.0, 0.0]]), np.tile([0.0, 0.0, 0.0, 1.0], (2, 1)))
    for shape, matrix in ((Rectangle(), below(2.0, 0.5, 0.5, -2.0)), (Sphere(0.5), place((-2.0, 0.0, 2.0)))):
        moving = lamp(shape, matrix, track=track)
        x = np.linspace(-3.0, 3.0, 7)
        for time_s in (0.0, 0.25, 1.0):
            matrix_then = place((4.0 * time_s, 0.0, 0.0)) @ matrix
            expected = irradiance(lamp(shape, matrix_then), x=x)
            np.testing.assert_allclose(irradiance(moving, x=x, time_s=time_s), expected, rtol=0.01)


def test_samples_of_a_group_share_the_lamp_out_among_them() -> None:
    """Their mean is nearer to the truth than that of the same number of independent samples."""
    light = lamp(Rectangle(), below(1.0, 1.0, 1.0))
    x = np.full(64, 1.5)
    together = np.array([irradiance(light, x=x[:1], samples=64, seed=seed)[0] for seed in range(24)])
    apart = np.array([irradiance(light, x=x + 1e-6 * np.arange(64), samples=1, seed=seed).mean() for seed in range(24)])
    assert together.std() < 0.4 * apart.std()
    assert together.mean() == pytest.approx(apart.mean(), rel=0.05)


def test_the_same_bits_for_any_threads_and_order() -> None:
    scene = Scene(FLOOR_VIEW, (UP, lamp(Rectangle(), below(2.0, 1.0, 1.0)), lamp(Sphere(0.3), place((1.0, 1.0, 1.0)))))
    rng = np.random.default_rng(1)
    position = torch.as_tensor(rng.random((40, 64, 2)), dtype=torch.float32)
    number = torch.zeros(40, dtype=torch.int64)
    times = torch.zeros(40, 64, dtype=torch.float64)
    order = torch.as_tensor(rng.permutation(40))
    seen = []
    for threads, rows in ((1, torch.arange(40)), (2, torch.arange(40)), (2, order)):
        renderer = Renderer(scene, threads=threads, packets=False, specialise=False)
        color = renderer.trace(FrameletBatch(number, number, position[rows], times)).color
        seen.append(color[torch.argsort(rows)])
        renderer.close()
    assert torch.equal(seen[0], seen[1]) and torch.equal(seen[0], seen[2])


def test_a_glow_without_light_is_only_seen() -> None:
    disk = Instance(Rectangle(), Emissive((1.0, 1.0, 1.0)), below(2.0, 1.0, 1.0))
    assert irradiance(disk)[0] == 0.0
