"""Input that cannot be rendered is refused in one clear line."""

import dataclasses

import jaxtyping
import numpy as np
import pytest
import torch

from renderer.compute import device
from renderer.trace import Renderer
from scenes.canonical import (
    CheckerboardTexture,
    ConstantTexture,
    DirectionalLight,
    Disk,
    Emissive,
    EnvironmentLight,
    Glass,
    HeightField,
    ImageTexture,
    Instance,
    Matte,
    Mesh,
    Metal,
    MixMaterial,
    MixTexture,
    OrthographicCamera,
    PerspectiveCamera,
    Phong,
    PointLight,
    RealisticCamera,
    ScaleTexture,
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
FACE = Mesh(np.eye(3, dtype=np.float32), np.array([[0, 1, 2]], np.int32))
POINT = Mesh(np.ones((3, 3), np.float32), np.array([[0, 1, 2]], np.int32))
PLACED = np.diag([1.0, 1.0, 1.0, 1e30])
PROJECTIVE = np.eye(4) + np.array([[0.0] * 4, [0.0] * 4, [0.0] * 4, [0.0, 0.0, 0.1, 0.0]])


@pytest.mark.parametrize(
    ("scene", "message"),
    [
        (_with(camera=RealisticCamera()), "RealisticCamera is not supported"),
        (_with(camera=OrthographicCamera(half_width=0.0)), "half_width"),
        (_with(camera=PerspectiveCamera(to_world=np.full((4, 4), np.nan))), "finite"),
        (_made_of(Glass(roughness=(0.1, 0.1))), "'thing'.*Glass.roughness"),
        (_made_of(HeightField(Matte(WHITE), np.zeros((2, 2), np.float32), 0.1)), "HeightField: expected a Rectangle"),
        (_made_of(Matte(WHITE, 20.0)), "sigma_deg 20.0"),
        (_made_of(Phong(MixTexture(WHITE, WHITE))), "MixTexture is not supported"),
        (_made_of(Phong(ScaleTexture(WHITE, WHITE))), "ScaleTexture is not supported"),
        (_made_of(Metal((1, 1, 1), (1, 1, 1))), "Metal is not supported"),
        (_made_of(MixMaterial(Matte(WHITE), Matte(WHITE), WHITE)), "MixMaterial is not supported"),
        (_made_of(Phong(ConstantTexture((np.nan, 0, 0)))), "expected finite values"),
        (_made_of(Phong(ConstantTexture((1e39, 0, 0)))), "expected finite values"),
        (_made_of(Phong(ConstantTexture((-0.1, 0, 0)))), "no negative values"),
        (_made_of(Phong(ImageTexture(np.full((2, 2, 3), -1, np.float32), source="a.png"))), "a.png.*no negative"),
        (_made_of(Phong(ImageTexture(np.ones((2, 2, 3), np.float32), (np.nan, 1.0)))), "uv_scale"),
        (_made_of(Phong(CheckerboardTexture(WHITE, WHITE, (np.inf, 1.0)))), "uv_scale"),
        (_made_of(Phong(WHITE, specular=(np.inf, 0, 0))), "Phong.specular"),
        (_made_of(Phong(WHITE, fresnel_exponent=-1.0)), "Phong.fresnel_exponent"),
        (_made_of(Emissive((0.0, -1.0, 0.0))), "Emissive.emission.*no negative"),
        (_with(instances=(Instance(Sphere(), Matte(WHITE), PROJECTIVE, name="bent"),)), "'bent'.*last row"),
        (_with(instances=(Instance(FACE, Matte(WHITE), PROJECTIVE, name="bent"),)), "'bent'.*last row"),
        (_with(instances=(Instance(Sphere(1e-30), Matte(WHITE), 1e-30 * PLACED),)), "to_world of a shape"),
        (_with(instances=(Instance(POINT, Matte(WHITE)),)), "all vertices lie in one point"),
        (_with(camera=PerspectiveCamera(to_world=np.diag([1.0, 1.0, 0.0, 1.0]))), "can be inverted"),
        (
            _with(instances=(Instance(Disk(), Matte(WHITE), emission=(1, 1, 1), name="lamp"),)),
            "'lamp'.*Rectangle or Sphere",
        ),
        (_with(instances=(Instance(NAN_NORMALS, Matte(WHITE)),)), "normals hold non-finite"),
        (_with(instances=(Instance(Sphere(0.0), Matte(WHITE)),)), "positive radius"),
        (_with(lights=(SpotLight((0, 0, 0), (0, 0, 1), (1, 1, 1), 20, 10),)), "inner_deg <= outer_deg"),
        (_with(lights=(SpotLight((0, 0, 0), (0, 0, 0), (1, 1, 1), 10, 20),)), "SpotLight.target"),
        (_with(lights=(SunSky((0, 1, 0)),)), "SunSky is not supported"),
        (_with(lights=(DirectionalLight((0, 0, 0), (1, 1, 1)),)), "expected a direction"),
        (_with(lights=(DirectionalLight((0, np.nan, 0), (1, 1, 1)),)), "expected a direction"),
        (_with(lights=(DirectionalLight((0, -1, 0), (1, 1, 1), angle_deg=-0.5),)), "angle_deg.*got -0.5"),
        (_with(lights=(DirectionalLight((0, -1, 0), (1, -1, 1)),)), "DirectionalLight.irradiance"),
        (_with(lights=(PointLight((0, np.inf, 0), (1, 1, 1)),)), "PointLight.position"),
        (_with(lights=(PointLight((0, 0, 0), (1, np.nan, 1)),)), "PointLight.intensity"),
        (_with(ambient=(-1.0, 0.0, 0.0)), "Scene.ambient"),
        (_with(lights=(EnvironmentLight(np.zeros((0, 4, 3), np.float32)),)), "expected an image"),
        (_with(lights=(EnvironmentLight(np.ones((1, 1, 3), np.float32), np.zeros((4, 4))),)), "last row"),
        (_with(lights=(EnvironmentLight(np.ones((1, 1, 3), np.float32), np.diag([1.0, 0, 1, 1])),)), "can be inverted"),
        (_with(lights=(EnvironmentLight(np.ones((1, 1, 3), np.float32), scale=-1.0),)), "scale"),
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
    for cutoff in (-0.1, float("nan"), float("inf")):
        with pytest.raises(ValueError, match="throughput_cutoff"):
            Renderer(EMPTY, throughput_cutoff=cutoff)
    if not torch.cuda.is_available():
        with pytest.raises(device.DeviceError, match="no CUDA device"):
            Renderer(EMPTY, device="cuda:0")


def test_frames_beyond_memory_and_odd_sizes(driving) -> None:
    with pytest.raises(ValueError, match="GiB are free"):
        driving.render_frame(0.0, 4_000_000, 4_000_000)
    with pytest.raises(ValueError, match="samples_per_axis: expected at most 1024, got 50000"):
        driving.render_frame(0.0, 4, 4, samples_per_axis=50_000)
    with pytest.raises(ValueError, match="samples along an axis"):
        driving.render_frame(0.0, 5000, 1, samples_per_axis=1000)
    for size in ((0, 4), (4, -1), (2.5, 4)):
        with pytest.raises(ValueError, match="whole number"):
            driving.render_frame(0.0, *size)


def test_odd_batches(monkeypatch: pytest.MonkeyPatch) -> None:
    # the tests' own check of shapes would refuse the batch before the renderer sees it
    monkeypatch.setattr(jaxtyping.config, "jaxtyping_disable", True)
    renderer = Renderer(driving_scene())
    good = batch(grid(4))
    with pytest.raises(ValueError, match="expected position"):
        renderer.trace(dataclasses.replace(good, position=good.position[..., :1]))
    with pytest.raises(ValueError, match="time_s of float64"):
        renderer.trace(dataclasses.replace(good, time_s=good.time_s.to(torch.float32)))
    with pytest.raises(ValueError, match="finite times"):
        renderer.trace(dataclasses.replace(good, time_s=torch.full_like(good.time_s, float("nan"))))
