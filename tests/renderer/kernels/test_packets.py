"""Sixteen samples at a time give the pictures that one at a time gives."""

from __future__ import annotations

import numpy as np
import pytest
import torch
import warp as wp

from renderer.compute import device
from renderer.compute.native_code import module_options
from renderer.trace import Renderer
from scenes import catalog
from scenes.canonical import (
    CheckerboardTexture,
    ConstantTexture,
    Cube,
    DirectionalLight,
    Disk,
    Emissive,
    EnvironmentLight,
    ImageTexture,
    Instance,
    Integrator,
    Matte,
    Mirror,
    PerspectiveCamera,
    Phong,
    PointLight,
    Rectangle,
    Scene,
    Sphere,
)
from tests.renderer.builders import (
    batch,
    driving_scene,
    grid,
    look_at,
    place,
    sphere_mesh,
    turning_track,
    vehicle_scene,
)


def every_feature() -> Scene:
    """All shapes, kinds of textures, wraps, filters, lights and materials, still and moving, in one picture."""
    rng = np.random.default_rng(2)
    picture = rng.random((16, 8, 3), dtype=np.float32)
    red, blue = ConstantTexture((0.7, 0.1, 0.1)), ConstantTexture((0.1, 0.2, 0.7))
    textures = [
        ImageTexture(picture, wrap=wrap, filter=filter, uv_scale=(2.5, 3.0), uv_offset=(0.2, -0.7))
        for wrap, filter in (("repeat", "mipmap"), ("clamp", "bilinear"), ("black", "nearest"), ("repeat", "nearest"))
    ]
    nested = CheckerboardTexture(textures[0], CheckerboardTexture(red, blue, uv_scale=(5.0, 5.0)), uv_scale=(3.0, 3.0))
    gloss = Phong(textures[1], (0.3, 0.2, 0.1), 35.0, ambient=0.6, fresnel_min=0.05, fresnel_max=0.8)
    ball = sphere_mesh(8)
    turned = place((0.0, 0.3, -1.0), (0.3, 0.7, 0.1), (0.7, 0.5, 0.6))
    shapes = [
        (Rectangle(), place((0.0, -1.0, 0.0), (-np.pi / 2, 0.0, 0.0), (6.0, 6.0, 1.0)), Matte(nested), None),
        (Sphere(0.6), place((-1.4, -0.2, 0.0), (0.4, 0.2, 0.0)), Matte(textures[3]), None),
        (Disk(0.8), place((1.5, 0.2, -0.5), (0.1, -0.5, 0.0)), Matte(textures[2]), None),
        (Cube(), turned, Phong(blue, (0.2, 0.2, 0.2), 8.0), turning_track(1)),
        (ball, place((0.9, -0.5, 1.0), scale=(0.4, 0.5, 0.4)), gloss, turning_track(2)),
        (ball, place((-0.4, -0.5, 1.2), scale=(0.4, 0.4, 0.4)), Mirror(textures[0]), None),
        (Disk(0.3), place((0.2, 1.2, 0.0)), Emissive((0.5, 0.9, 0.2)), None),
    ]
    sky = rng.random((8, 16, 3), dtype=np.float32)
    lights = (PointLight((2.0, 3.0, 3.0), (20.0, 18.0, 15.0)), DirectionalLight((-0.5, -1.0, -0.4), (1.0, 1.0, 0.9)))
    return Scene(
        camera=PerspectiveCamera(look_at((0.0, 0.8, 5.0), (0.0, 0.0, 0.0)), 45.0),
        instances=tuple(
            Instance(shape, material, to_world, track, name=f"{number}")
            for number, (shape, to_world, material, track) in enumerate(shapes)
        ),
        lights=lights,
        background=EnvironmentLight(sky),
        ambient=(0.2, 0.3, 0.4),
        integrator=Integrator(depth=3),
    )


SCENES = {"every feature": every_feature, "driving": driving_scene, "vehicle": vehicle_scene}


def assert_alike(one: torch.Tensor, other: torch.Tensor) -> None:
    """Equal but for rounding: at an edge of anything a sample may fall on the other side."""
    assert torch.isfinite(one).all()
    difference = (one - other).abs().amax(dim=-1).reshape(-1)
    assert difference.median() < 1e-5 and (difference > 2e-3).float().mean() < 4e-3


@pytest.mark.parametrize("name", SCENES)
@pytest.mark.parametrize("mixed_times", [False, True])
def test_pictures_are_those_of_single_samples(name: str, mixed_times: bool) -> None:
    scene, side = SCENES[name](), 64
    times = np.random.default_rng(0).uniform(0.0, 0.8, side * side) if mixed_times else 0.3
    asked = batch(grid(side), times)
    ours, plain = (Renderer(scene, packets=on).trace(asked) for on in (True, False))
    assert_alike(ours.color, plain.color)
    for counter, count in plain.counters.items():
        assert abs(ours.counters[counter] - count) <= 0.003 * count, counter


@pytest.mark.parametrize("name", catalog.NAMES)
def test_driving_pictures_are_those_of_single_samples(name: str) -> None:
    scene = catalog.load(name)
    ours, plain = (Renderer(scene, packets=on).render_frame(0.8, 80, 50, 2) for on in (True, False))
    assert_alike(ours, plain)


@pytest.mark.parametrize("name", SCENES)
@pytest.mark.parametrize("mixed_times", [False, True])
def test_a_sample_does_not_depend_on_its_company(name: str, mixed_times: bool) -> None:
    renderer = Renderer(SCENES[name]())
    position = grid(48)
    times = np.random.default_rng(1).uniform(0.0, 0.8, len(position)) if mixed_times else np.full(len(position), 0.3)
    order = np.random.default_rng(0).permutation(len(position))
    together, apart = (
        renderer.trace(batch(position[rows], times[rows])).color.reshape(-1, 3) for rows in (slice(None), order)
    )
    assert torch.equal(together[torch.from_numpy(order)], apart)


def test_lists_of_any_length_are_shaded_to_the_end() -> None:
    renderer = Renderer(every_feature())
    position = grid(16)
    whole = renderer.trace(batch(position, 0.3)).color.reshape(-1, 3)
    for count in (1, 15, 16, 17, 33):
        part = renderer.trace(batch(position[:count], 0.3))
        assert torch.equal(part.color.reshape(-1, 3), whole[:count])
        assert part.counters["primary_rays"] == count


wp.set_module_options(module_options("functions.h"))


@wp.func_native(
    """
    for (int i = 0; i < x.shape[0]; i += packets::LANES) {
        const auto a = packets::load<packets::f16>(x.data + i), b = packets::load<packets::f16>(y.data + i);
        packets::store(out.data + i, which == 0   ? packets::vlog2(a)
                                     : which == 1 ? packets::vexp2(a)
                                     : which == 2 ? packets::vpow(a, b)
                                     : which == 3 ? packets::vatan2(a, b)
                                                  : packets::vacos(a));
    }
    """
)
def native_function(
    which: wp.int32,
    x: wp.array(dtype=wp.float32),
    y: wp.array(dtype=wp.float32),
    out: wp.array(dtype=wp.float32),
): ...


@wp.kernel(enable_backward=False)
def apply(
    which: wp.int32,
    x: wp.array(dtype=wp.float32),
    y: wp.array(dtype=wp.float32),
    out: wp.array(dtype=wp.float32),
):
    native_function(which, x, y, out)


def applied(which: int, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    out = wp.zeros(len(x), dtype=wp.float32, device="cpu")
    arguments = [wp.array(values.astype(np.float32), dtype=wp.float32, device="cpu") for values in (x, y)]
    wp.launch(apply, dim=1, inputs=[which, *arguments, out], device="cpu")
    return out.numpy().astype(np.float64)


def test_elementary_functions() -> None:
    device.pick("cpu")
    rng = np.random.default_rng(0)
    positive = np.exp2(rng.uniform(-120.0, 120.0, 4096)).astype(np.float32).astype(np.float64)
    np.testing.assert_allclose(applied(0, positive, positive), np.log2(positive), rtol=3e-7, atol=2e-7)
    exponent = rng.uniform(-125.0, 125.0, 4096).astype(np.float32).astype(np.float64)
    np.testing.assert_allclose(applied(1, exponent, exponent), np.exp2(exponent), rtol=4e-7)
    base = rng.uniform(0.0, 1.0, 4096).astype(np.float32).astype(np.float64)
    power = rng.uniform(0.0, 60.0, 4096).astype(np.float32).astype(np.float64)
    power[:64], base[64:128], power[128:130], base[128:130] = 0.0, 0.0, 0.0, 0.0
    np.testing.assert_allclose(applied(2, base, power), base**power, rtol=2e-5, atol=1e-37)
    x, y = rng.normal(size=(2, 4096)).astype(np.float32).astype(np.float64)
    x[:128], y[64:192] = 0.0, 0.0
    np.testing.assert_allclose(applied(3, y, x), np.arctan2(y, x), atol=4e-7)
    cosine = np.clip(rng.uniform(-1.1, 1.1, 4096), -1.0, 1.0).astype(np.float32).astype(np.float64)
    np.testing.assert_allclose(applied(4, cosine, cosine), np.arccos(cosine), atol=6e-7)
