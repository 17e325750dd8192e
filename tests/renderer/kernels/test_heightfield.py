"""Height fields against the same relief as a displaced mesh, and against geometry."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.ndimage import gaussian_filter

from renderer.trace import Renderer
from scenes.canonical import (
    ConstantTexture,
    Cube,
    DirectionalLight,
    Emissive,
    EnvironmentLight,
    HeightField,
    Instance,
    Matte,
    Mesh,
    OrthographicCamera,
    PerspectiveCamera,
    Rectangle,
    Scene,
)
from tests.renderer.builders import grid, look_at, place

WHITE = Matte(ConstantTexture((1.0, 1.0, 1.0)))
GLOW = Emissive((1.0, 1.0, 1.0))
SIDE = 48


def colors(scene: Scene, position: np.ndarray) -> np.ndarray:
    """Red part of single samples."""
    from tests.renderer.builders import batch

    renderer = Renderer(scene, packets=False, specialise=False)
    found = renderer.trace(batch(position)).color.reshape(-1, 3)[:, 0].numpy()
    renderer.close()
    return found


def hills() -> np.ndarray:
    """Smooth bumps, level at the border."""
    noise = gaussian_filter(np.random.default_rng(4).standard_normal((SIDE, SIDE)), 3.0)
    noise = (noise - noise.min()) / np.ptp(noise)
    return noise.astype(np.float32)


def displaced(height: np.ndarray, depth: float, per_sample: int = 4) -> Mesh:
    """The same sheet as triangles, finer than the samples."""
    count = len(height) * per_sample
    ends = np.linspace(-1.0, 1.0, count + 1)
    x, y = np.meshgrid(ends, ends)
    at = np.clip([(0.5 - 0.5 * y) * SIDE - 0.5, (0.5 * x + 0.5) * SIDE - 0.5], 0.0, SIDE - 1.0)
    low = np.minimum(at.astype(int), SIDE - 2)
    (fy, fx), (r, c) = at - low, low
    z = (height[r, c] * (1 - fx) + height[r, c + 1] * fx) * (1 - fy)
    z = z + (height[r + 1, c] * (1 - fx) + height[r + 1, c + 1] * fx) * fy
    vertices = np.stack([x, y, (z - 1.0) * depth], -1).reshape(-1, 3).astype(np.float32)
    corner = (np.arange(count)[:, None] * (count + 1) + np.arange(count)).reshape(-1, 1)
    faces = np.concatenate([corner + np.array(three) for three in ([0, 1, count + 2], [0, count + 2, count + 1])])
    return Mesh(vertices, faces.astype(np.int32))


def both(depth: float, steps: int = 256, matrix=None, material=WHITE) -> tuple[Instance, Instance]:
    """The relief as a height field and as a mesh."""
    matrix = np.eye(4) if matrix is None else matrix
    field = Instance(Rectangle(), HeightField(material, hills(), depth, steps), matrix)
    return field, Instance(displaced(hills(), depth), material, matrix)


def test_the_silhouette_is_that_of_the_displaced_mesh() -> None:
    camera = PerspectiveCamera(look_at((0.3, -4.0, 0.05), (0.0, 0.0, -0.2), (0.0, 0.0, 1.0)), 32.0)
    field, mesh = (colors(Scene(camera, (instance,)), grid(160)) for instance in both(0.5, material=GLOW))
    assert 0.1 < mesh.mean() < 0.6
    assert (field != mesh).mean() < 2e-3
    flat = colors(Scene(camera, (Instance(Rectangle(), GLOW),)), grid(160))
    assert (flat != mesh).mean() > 0.1  # else there would be no silhouette to compare


def test_shadows_on_itself_are_those_of_the_displaced_mesh() -> None:
    low_sun = DirectionalLight((1.0, 0.4, -0.35), (1.0, 1.0, 1.0))
    camera = OrthographicCamera(place((0.0, 0.0, 3.0)), 0.95)
    lit = [colors(Scene(camera, (instance,), (low_sun,)), grid(160)) > 0.0 for instance in both(0.5)]
    assert 0.1 < lit[1].mean() < 0.95
    assert (lit[0] != lit[1]).mean() < 0.01


def test_shading_is_that_of_the_displaced_mesh() -> None:
    sun = DirectionalLight((0.2, 0.1, -1.0), (1.0, 1.0, 1.0))
    matrix = place((0.3, 0.2, -5.0), (0.5, 0.2, 0.3), (1.4, 0.9, 0.8))
    camera = PerspectiveCamera(fov_deg=30.0)
    field, mesh = (colors(Scene(camera, (instance,), (sun,)), grid(120)) for instance in both(0.3, matrix=matrix))
    seen = (field > 0.0) & (mesh > 0.0)
    assert seen.mean() > 0.2
    assert np.abs(field - mesh)[seen].mean() < 0.01


def test_a_ridge_throws_a_shadow_as_long_as_its_height_and_the_sun_say() -> None:
    height = np.zeros((128, 128), np.float32)
    height[:, 40:44] = 1.0
    depth, elevation = 0.2, np.radians(25.0)
    sun = DirectionalLight((np.cos(elevation), 0.0, -np.sin(elevation)), (1.0, 1.0, 1.0))
    relief = Instance(Rectangle(), HeightField(WHITE, height, depth, 512))
    x = (np.arange(2000) + 0.5) / 2000
    camera = OrthographicCamera(place((0.0, 0.0, 3.0)), 1.0)
    lit = colors(Scene(camera, (relief,), (sun,)), np.stack([x, np.full(2000, 0.5)], 1)) > 0.0
    ridge_end = 44.0 / 64.0 - 1.0  # its side falls over one sample, centred here
    dark = (2.0 * x - 1.0)[~lit & (2.0 * x - 1.0 > ridge_end)]
    # the edge of the top, half a sample before, throws the end of the shadow
    assert dark.max() - (ridge_end - 0.5 / 64.0) == pytest.approx(depth / np.tan(elevation), abs=0.01)


def test_a_level_field_is_a_rectangle() -> None:
    sun = DirectionalLight((0.3, 0.2, -1.0), (1.0, 1.0, 1.0))
    camera = PerspectiveCamera(look_at((0.5, -2.0, 1.0), (0.0, 0.0, 0.0), (0.0, 0.0, 1.0)), 50.0)
    level = HeightField(WHITE, np.ones((3, 5), np.float32), 0.4)
    field, flat = (
        colors(Scene(camera, (Instance(Rectangle(), material),), (sun,)), grid(64)) for material in (level, WHITE)
    )
    assert (np.abs(field - flat) > 1e-5).mean() < 2e-3


def test_more_steps_miss_less() -> None:
    """Thin fins seen from the side: steps wider than a fin miss some."""
    height = np.zeros((16, 256), np.float32)
    height[:, ::16] = 1.0
    camera = OrthographicCamera(look_at((-3.0, 0.0, 0.4), (0.0, 0.0, -0.05), (0.0, 0.0, 1.0)), 0.2)
    truth = colors(Scene(camera, (Instance(Rectangle(), HeightField(GLOW, height, 0.1, 8192)),)), grid(64))
    wrong = []
    for steps in (8, 64, 1024):
        field = Instance(Rectangle(), HeightField(GLOW, height, 0.1, steps))
        wrong.append((colors(Scene(camera, (field,)), grid(64)) != truth).mean())
    assert wrong[0] > 2.0 * wrong[1] > 0.0 and wrong[1] >= wrong[2] and wrong[2] < 0.04  # of a row that sees tips only


def test_others_shade_it_and_it_shades_others() -> None:
    sun = DirectionalLight((0.0, 0.0, -1.0), (1.0, 1.0, 1.0))
    relief = Instance(Rectangle(), HeightField(WHITE, hills(), 0.3), place(scale=(2.0, 2.0, 1.0)))
    roof = Instance(Cube(), WHITE, place((0.0, 0.0, 3.0), scale=(0.5, 0.5, 0.1)))
    floor = Instance(Rectangle(), WHITE, place((0.0, 0.0, -2.0), scale=(9.0, 9.0, 1.0)))
    between = OrthographicCamera(place((0.0, 0.0, 1.0)), 2.0)
    under = OrthographicCamera(place((0.0, 0.0, -1.0)), 4.0)
    assert colors(Scene(between, (relief, roof), (sun,)), np.array([[0.5, 0.5]]))[0] == 0.0
    assert colors(Scene(between, (relief, roof), (sun,)), np.array([[0.8, 0.8]]))[0] > 0.1
    shade = colors(Scene(under, (relief, floor), (sun,)), np.array([[0.5, 0.5], [0.9, 0.9]]))
    assert shade[0] == 0.0 and shade[1] > 0.1


@pytest.mark.parametrize("depth", [1e-4, 0.2, 50.0])
@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e4])
def test_extremes_of_size_stay_free_of_false_shadows(depth: float, scale: float) -> None:
    """Straight from above under a high sun nothing shades itself."""
    sun = DirectionalLight((0.0, 0.0, -1.0), (1.0, 1.0, 1.0))
    relief = Instance(Rectangle(), HeightField(WHITE, hills(), depth), place(scale=(scale, scale, scale)))
    camera = OrthographicCamera(place((0.0, 0.0, 2.0 * scale)), 0.9 * scale)
    assert (colors(Scene(camera, (relief,), (sun,)), grid(64)) > 0.0).mean() > 0.999


@pytest.mark.parametrize("depth", [1e-4, 1e-2, 1.0])
@pytest.mark.parametrize("distance", [3.0, 1e4])
def test_a_relief_is_met_from_afar_however_shallow(depth: float, distance: float) -> None:
    """Seen from above at a slant it covers what its rectangle covers, but for the way its depth shifts it."""
    camera = PerspectiveCamera(
        look_at((0.0, -0.6 * distance, 0.8 * distance), (0.0, 0.0, 0.0), (0.0, 0.0, 1.0)),
        2.0 * np.degrees(np.arctan(1.4 / distance)),
    )
    shapes = (HeightField(GLOW, hills(), depth), GLOW)
    field, flat = (colors(Scene(camera, (Instance(Rectangle(), one),)), grid(96)) > 0.0 for one in shapes)
    assert flat.mean() > 0.2
    assert (field != flat).mean() < 0.01 + 0.6 * depth


def test_points_at_the_very_top_of_the_relief_are_met() -> None:
    """Rays within the plane of the rectangle, along a ledge as high as it."""
    height = np.zeros((8, 8), np.float32)
    height[:, 4:] = 1.0
    camera = OrthographicCamera(look_at((-3.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 1.0)), 0.05)
    seen = colors(Scene(camera, (Instance(Rectangle(), HeightField(GLOW, height, 0.5)),)), grid(33))
    assert seen.reshape(33, 33)[17:].all() and not seen.reshape(33, 33)[:16].any()


@settings(max_examples=25, deadline=None)
@given(st.lists(st.floats(-1.5, 1.5), min_size=6, max_size=6), st.sampled_from([(1, 1), (1, 7), (9, 2)]))
def test_nothing_is_ever_not_a_number(place_and_aim: list[float], shape: tuple[int, int]) -> None:
    eye, target = np.array(place_and_aim[:3]), np.array(place_and_aim[3:]) + np.array([0.0, 0.0, 1e-3])
    if np.linalg.norm(np.cross(target - eye, (0.1, 1.0, 0.2))) < 1e-3:
        return
    height = np.random.default_rng(1).random(shape, dtype=np.float32)
    sky = EnvironmentLight(np.ones((1, 1, 3), np.float32))
    scene = Scene(
        PerspectiveCamera(look_at(eye, target, (0.1, 1.0, 0.2)), 90.0),
        (Instance(Rectangle(), HeightField(WHITE, height, 0.3)),),
        (DirectionalLight((0.1, 0.2, -1.0), (1.0, 1.0, 1.0)), sky),
    )
    assert np.isfinite(colors(scene, grid(16))).all()
