"""What cannot be rendered is refused in one clear line."""

import dataclasses

import numpy as np
import pytest
import torch

from renderer import device
from renderer.trace import Renderer
from scenes.canonical import (
    ConstantTexture,
    EnvironmentCamera,
    EnvironmentLight,
    Glass,
    Instance,
    Matte,
    Mesh,
    MixTexture,
    PerspectiveCamera,
    Phong,
    Scene,
    SceneError,
    Sphere,
    SpotLight,
    SunSky,
)
from tests.renderer.builders import WHITE, batch, driving_scene, grid

EMPTY = Scene(PerspectiveCamera(), ())


def _with(**changes) -> Scene:
    return dataclasses.replace(EMPTY, **changes)


def _made_of(material) -> Scene:
    return _with(instances=(Instance(Sphere(), material, name="thing"),))


NAN_NORMALS = Mesh(np.eye(3, dtype=np.float32), np.array([[0, 1, 2]], np.int32), np.full((3, 3), np.nan, np.float32))


@pytest.mark.parametrize(
    ("scene", "message"),
    [
        (_with(camera=EnvironmentCamera()), "EnvironmentCamera is not supported"),
        (_with(camera=PerspectiveCamera(lens_radius=0.1)), "lens_radius 0.1 is not supported"),
        (_with(camera=PerspectiveCamera(shutter_s=(0.0, 0.1))), "shutter_s"),
        (_with(camera=PerspectiveCamera(to_world=np.full((4, 4), np.nan))), "finite"),
        (_made_of(Glass()), "'thing'.*Glass is not supported"),
        (_made_of(Matte(WHITE, 20.0)), "sigma_deg 20.0"),
        (_made_of(Phong(MixTexture(WHITE, WHITE))), "MixTexture is not supported"),
        (_made_of(Phong(ConstantTexture((np.nan, 0, 0)))), "non-finite"),
        (_made_of(Phong(WHITE, specular=(np.inf, 0, 0))), "Phong.specular"),
        (_with(instances=(Instance(Sphere(), Matte(WHITE), emission=(1, 1, 1), name="lamp"),)), "'lamp'.*area lights"),
        (_with(instances=(Instance(NAN_NORMALS, Matte(WHITE)),)), "normals hold non-finite"),
        (_with(instances=(Instance(Sphere(0.0), Matte(WHITE)),)), "positive radius"),
        (_with(lights=(SpotLight((0, 0, 0), (0, 0, 1), (1, 1, 1), 10, 20),)), "SpotLight is not supported"),
        (_with(lights=(SunSky((0, 1, 0)),)), "SunSky is not supported"),
        (_with(lights=(EnvironmentLight(np.ones((1, 1, 3), np.float32)),) * 2), "at most one"),
        (_with(lights=(EnvironmentLight(np.full((1, 1, 3), np.nan, np.float32)),)), "finite"),
    ],
)
def test_unsupported_scenes(scene: Scene, message: str) -> None:
    with pytest.raises(SceneError, match=message) as caught:
        Renderer(scene)
    assert "\n" not in str(caught.value)


def test_devices_and_options() -> None:
    with pytest.raises(ValueError, match="expected one of cpu, cuda:0"):
        Renderer(EMPTY, device="tpu")
    with pytest.raises(ValueError, match="threads"):
        Renderer(EMPTY, threads=0)
    with pytest.raises(ValueError, match="footprint"):
        Renderer(EMPTY, footprint_resolution_px=0)
    if not torch.cuda.is_available():
        with pytest.raises(device.DeviceError, match="no CUDA device"):
            Renderer(EMPTY, device="cuda:0")


def test_frames_beyond_memory_and_odd_sizes(driving) -> None:
    with pytest.raises(ValueError, match="GiB are free"):
        driving.render_frame(0.0, 4_000_000, 4_000_000)
    for size in ((0, 4), (4, -1), (2.5, 4)):
        with pytest.raises(ValueError, match="whole number"):
            driving.render_frame(0.0, *size)


def test_odd_batches() -> None:
    renderer = Renderer(driving_scene())
    good = batch(grid(4))
    with pytest.raises(ValueError, match="expected position"):
        renderer.trace(dataclasses.replace(good, position=good.position[..., :1]))
    with pytest.raises(ValueError, match="finite times"):
        renderer.trace(dataclasses.replace(good, time_s=torch.full_like(good.time_s, float("nan"))))
