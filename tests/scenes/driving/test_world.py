"""The world stands on the ground under a sky whose sun is where its light comes from."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

import numpy as np
import pytest
import torch
from PIL import Image

from analysis.storage.reference import content_hash
from scenes import catalog
from scenes.canonical import ConstantTexture, EnvironmentLight, ImageTexture, Instance, Mesh, Phong, Rectangle
from scenes.driving import sky, world
from scenes.loading import ASSETS, asset, read_image
from tests.scenes.builders import areas, corners, face_normals

NAMES = [instance.name for instance in world.instances()]


def named(name: str) -> Instance:
    return next(instance for instance in world.instances() if instance.name == name)


def mesh_of(name: str) -> Mesh:
    shape = named(name).shape
    assert isinstance(shape, Mesh)
    return shape


def direction(light: EnvironmentLight, row: float, column: float) -> np.ndarray:
    """Where a texel of an environment map lies in the world, by the convention of the canonical scene."""
    height, width = light.image.shape[:2]
    u, polar = (column + 0.5) / width, np.pi * (row + 0.5) / height
    turn = 2.0 * np.pi * u
    local = np.array([np.sin(turn) * np.sin(polar), np.cos(polar), -np.cos(turn) * np.sin(polar)])
    return light.to_world[:3, :3] @ local


def test_the_sky_is_finite_and_bounded() -> None:
    image = sky.sky().image
    assert image.dtype == np.float32 and image.ndim == 3 and image.shape[1] == 2 * image.shape[0]
    assert bool(np.isfinite(image).all()) and image.min() >= 0.0
    assert image.max() <= sky.SKY_LIMIT * (1.0 + 1e-6)
    assert image.max() > 0.5 * sky.SKY_LIMIT, "the glow around the sun is kept"
    assert not image.flags.writeable, "shared by all scenes"


def test_the_sky_is_above() -> None:
    light = sky.sky()
    assert direction(light, 0, 7)[2] > 0.99 and direction(light, light.image.shape[0] - 1, 7)[2] < -0.99
    assert np.linalg.det(light.to_world) == pytest.approx(1.0)
    upper, lower = np.split(light.image, 2)
    assert upper[: len(upper) // 2].mean(axis=(0, 1)).argmax() == 2, "blue"
    assert np.ptp(lower, axis=(0, 1)).max() == pytest.approx(0.0, abs=1e-6), "one colour below the horizon"


def test_hills_stand_at_the_horizon_without_a_seam() -> None:
    image = sky.sky().image
    ring = image[len(image) // 2 - 20]
    assert ring.std(axis=0).max() > 0.01
    steps = np.abs(np.diff(ring, axis=0, append=ring[:1])).max(axis=1)
    assert steps[-1] <= np.percentile(steps, 99.0)


def test_the_sun_shines_from_where_the_picture_has_it() -> None:
    picture = read_image(asset("sky.exr"))
    light = EnvironmentLight(picture, sky.sky().to_world)
    row, column = np.unravel_index(int(picture.sum(axis=2).argmax()), picture.shape[:2])
    towards = sky.sun_towards()
    assert np.linalg.norm(towards) == pytest.approx(1.0) and towards[2] > 0.3
    assert picture.max() > 10.0 * sky.SKY_LIMIT, "the picture has a sun"
    assert towards @ direction(light, float(row), float(column)) > np.cos(np.radians(2.0))
    assert np.array(sky.sun().direction) == pytest.approx(-towards) and min(sky.sun().irradiance) > 0.0


def test_everything_has_a_name_of_its_own_and_stands_still() -> None:
    assert len(set(NAMES)) == len(NAMES) >= 9
    assert all(instance.track is None and instance.emission is None for instance in world.instances())


@pytest.mark.parametrize("name", NAMES)
def test_instances_are_valid(name: str) -> None:
    instance = named(name)
    assert isinstance(instance.material, Phong)
    texture = instance.material.diffuse
    assert isinstance(texture, (ConstantTexture, ImageTexture))
    albedo = texture.image if isinstance(texture, ImageTexture) else np.array(texture.value)
    assert albedo.min() >= 0.0 and albedo.max() <= 1.0 and albedo.mean() > 0.0
    if isinstance(instance.shape, Rectangle):
        return
    mesh = mesh_of(name)
    assert mesh.normals is not None and mesh.uvs is not None and np.isfinite(mesh.uvs).all()
    assert np.linalg.norm(mesh.normals, axis=1) == pytest.approx(1.0, abs=1e-5)
    assert areas(mesh).min() > 0.0
    facing = np.einsum("ij,ikj->ik", face_normals(mesh), mesh.normals[mesh.faces].astype(np.float64))
    assert (facing > 0.0).mean() > 0.99


def test_paving_is_level_and_covers_both_roads_once() -> None:
    mesh, half, far = mesh_of("paving"), world.ROAD_HALF_WIDTH_M, world.ROAD_LENGTH_M
    assert np.abs(mesh.vertices[:, 2]).max() == 0.0
    assert mesh.normals is not None and mesh.normals[:, 2].min() == 1.0 and face_normals(mesh)[:, 2].min() > 0.0
    assert areas(mesh).sum() == pytest.approx(2.0 * (2.0 * half * 2.0 * far) - (2.0 * half) ** 2)
    a, b, c = corners(mesh)
    assert np.abs((a + b + c) / 3.0)[:, :2].min(axis=1).max() < half, "on one of the roads"
    assert mesh.uvs == pytest.approx(mesh.vertices[:, :2])


def test_the_ground_is_layered() -> None:
    """Lawn under paving under markings, apart by more than single precision can confuse."""
    lawn = named("lawn").to_world
    assert -0.1 < lawn[2, 3] < -0.01 and lawn[2, 2] > 0.0 and lawn[0, 0] > world.ROAD_LENGTH_M
    markings = mesh_of("markings").vertices
    assert 0.001 < markings[:, 2].min() and markings[:, 2].max() < 0.02
    assert np.abs(markings[:, :2]).min(axis=1).max() < world.ROAD_HALF_WIDTH_M


@pytest.mark.parametrize("name", ["kerbs", "walls", "trunks", "posts", "crowns"])
def test_nothing_stands_on_the_road(name: str) -> None:
    """Below the height of lamps and leaves."""
    low = mesh_of(name).vertices
    low = low[low[:, 2] < (1.5 if name != "posts" else 5.0)]
    assert np.abs(low[:, :2]).min(axis=1).min(initial=np.inf) >= world.ROAD_HALF_WIDTH_M - 1e-5


@pytest.mark.parametrize("name", ["walls", "trunks", "posts", "kerbs"])
def test_what_stands_reaches_the_ground(name: str) -> None:
    assert mesh_of(name).vertices[:, 2].min() <= 0.0


def test_textures_repeat_without_a_seam() -> None:
    """The step across the border of the lawn is like those within."""
    image = world._grass()
    inner = np.abs(np.diff(image, axis=1)).mean()
    assert np.abs(image[:, 0] - image[:, -1]).mean() < 1.3 * inner
    assert np.abs(image[0] - image[-1]).mean() < 1.3 * inner


Value = TypeVar("Value")


def afresh_on(threads: int, make: Callable[[], Value]) -> Value:
    """Makes something with so many threads of torch, nothing of the scenes being known from before."""

    def forget() -> None:
        for name, module in list(sys.modules.items()):
            if name.split(".")[0] == "scenes":
                for value in vars(module).values():
                    getattr(value, "cache_clear", lambda: None)()

    before = torch.get_num_threads()
    torch.set_num_threads(threads)
    forget()
    try:
        return make()
    finally:
        torch.set_num_threads(before)
        forget()


def test_pictures_are_the_same_on_any_number_of_threads(tmp_path: Path) -> None:
    """Also one whose number of texels no number of threads divides."""
    odd = np.random.default_rng(0).integers(0, 256, (301, 401, 3), np.uint8)
    Image.fromarray(odd).save(tmp_path / "odd.png")
    pictures = sorted(path for path in ASSETS.iterdir() if path.suffix in (".png", ".jpg", ".exr"))
    assert len(pictures) >= 3
    for path in (*pictures, tmp_path / "odd.png"):
        one, two, three = (afresh_on(threads, lambda path=path: read_image(path)) for threads in (1, 2, 3))
        assert one is not two and one.tobytes() == two.tobytes() == three.tobytes(), path.name


def test_the_sky_and_the_textures_are_the_same_on_any_number_of_threads() -> None:
    one, two = (
        afresh_on(threads, lambda: (content_hash(sky.sky()), content_hash(world.instances()))) for threads in (1, 2)
    )
    assert one == two


def test_making_the_sky_leaves_the_number_of_threads_alone() -> None:
    def number_after() -> int:
        sky.sky()
        return torch.get_num_threads()

    assert [afresh_on(threads, number_after) for threads in (1, 2)] == [1, 2]


def test_a_scene_has_the_same_hash_on_any_number_of_threads() -> None:
    """References are found by it."""
    one, two = (afresh_on(threads, lambda: content_hash(catalog.load("fly-by"))) for threads in (1, 2))
    assert one == two
