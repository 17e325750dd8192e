"""Paths against those of Mitsuba 3: a test of the means of blocks of pixels for each kind of surface.

Pictures of several seeds give each block's mean and variance on either side; Welch's test compares them, and the least
of all p-values is corrected for their number (Šidák). A block without noise may differ by rounding.
"""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from scipy import stats

from analysis.bench.mitsuba import VARIANTS, missing, still
from renderer.frames import render_image
from renderer.sampling.plan import SamplePlan
from renderer.trace import Renderer
from scenes.canonical import (
    ConstantTexture,
    EnvironmentLight,
    Glass,
    Instance,
    Integrator,
    Masked,
    Material,
    Matte,
    Metal,
    Mirror,
    PerspectiveCamera,
    Plastic,
    Rectangle,
    Scene,
    Sphere,
)
from tests.renderer.builders import look_at, place

SIDE_PX, BLOCK_PX, SEEDS, SAMPLES = 24, 4, 8, 32
USABLE = [variant for variant in VARIANTS if not missing(variant)]


def color(*value: float) -> ConstantTexture:
    return ConstantTexture((value[0], value[-2 if len(value) > 1 else 0], value[-1]))


SKY = EnvironmentLight(np.broadcast_to(np.array([0.3, 0.4, 0.6], np.float32), (8, 16, 3)).copy())
GOLD = (0.2, 0.9, 1.3), (3.9, 2.4, 2.2)
MATERIALS = {
    "diffuse": Matte(color(0.7, 0.3, 0.2)),
    "mirror": Mirror(color(0.8)),
    "metal": Metal(*GOLD),
    "rough metal": Metal(*GOLD, (0.3, 0.3)),
    "Beckmann metal": Metal(*GOLD, (0.3, 0.3), distribution="beckmann"),
    "glass": Glass(),
    "rough glass": Glass(roughness=(0.3, 0.3)),
    "Beckmann glass": Glass(roughness=(0.3, 0.3), distribution="beckmann"),
    "pane": Glass(transmittance=color(0.5, 0.8, 0.9), thin=True),
    "plastic": Plastic(color(0.6, 0.2, 0.2)),
    "rough plastic": Plastic(color(0.6, 0.2, 0.2), roughness=0.3),
    "Beckmann plastic": Plastic(color(0.6, 0.2, 0.2), roughness=0.3, distribution="beckmann"),
    "holes": Masked(Matte(color(0.7, 0.3, 0.2)), color(0.4)),
}


def ball_on_the_floor(material: Material) -> Scene:
    """A ball on a floor under a square lamp, a round one and an even sky."""
    dark = Matte(color(0.0))
    square, round_ = place((1.5, 2.5, 1.0), (np.pi / 2, 0, 0), (0.5, 0.5, 0.5)), place((-1.6, 1.0, 0.5))
    instances = (
        Instance(Rectangle(), Matte(color(0.6, 0.5, 0.4)), place((0, -1, 0), (-np.pi / 2, 0, 0), (4, 4, 4))),
        Instance(Sphere(), material, place((0.0, 0.02, 0.0))),
        Instance(Rectangle(), dark, square, emission=(6.0, 5.0, 4.0)),
        Instance(Sphere(0.3), dark, round_, emission=(2.0, 3.0, 2.0)),
    )
    camera = PerspectiveCamera(look_at((0, 1.0, 5), (0, 0, 0)), 40.0)
    return Scene(camera, instances, (SKY,), integrator=Integrator("path", depth=10))


def of_seed(scene: Scene, seed: int) -> np.ndarray:
    """Our picture ``(h, w, 3)``, by the kernels with all features, which tests share."""
    renderer = Renderer(scene, seed=seed, specialise=False)
    return render_image(renderer, SamplePlan(SAMPLES, "random", seed), SIDE_PX, SIDE_PX, 0.0).numpy()


def blocks(pictures: list[np.ndarray]) -> np.ndarray:
    """Means ``(seeds, blocks * 3)``."""
    count = SIDE_PX // BLOCK_PX
    parts = np.stack(pictures).astype(np.float64).reshape(len(pictures), count, BLOCK_PX, count, BLOCK_PX, 3)
    return parts.mean(axis=(2, 4)).reshape(len(pictures), -1)


def least_p(ours: np.ndarray, theirs: np.ndarray) -> float:
    """The least p-value of all blocks, corrected for their number."""
    rounding = len(ours) * (1e-5 * np.abs(theirs.mean(axis=0)) + 1e-7) ** 2
    first, second = ours.var(axis=0, ddof=1) + rounding, theirs.var(axis=0, ddof=1) + rounding
    t = (ours.mean(axis=0) - theirs.mean(axis=0)) / np.sqrt((first + second) / len(ours))
    freedom = (first + second) ** 2 / (first**2 + second**2) * (len(ours) - 1)
    p = 2.0 * stats.t.sf(np.abs(t), freedom)
    return float(1.0 - (1.0 - p.min()) ** p.size)


@cache
def compared(name: str) -> tuple[np.ndarray, np.ndarray]:
    """Blocks of our pictures and of theirs."""
    scene = ball_on_the_floor(MATERIALS[name])
    picture = still(scene, 0.0, SIDE_PX, "path", USABLE[0])
    theirs = [picture.render(SAMPLES, seed) for seed in range(SEEDS)]
    return blocks([of_seed(scene, seed) for seed in range(SEEDS)]), blocks(theirs)


@pytest.mark.skipif(not USABLE, reason="Mitsuba is not installed")
@pytest.mark.parametrize("name", MATERIALS)
def test_a_surface_scatters_as_it_does_in_mitsuba(name: str) -> None:
    assert least_p(*compared(name)) > 0.01


@pytest.mark.skipif(not USABLE, reason="Mitsuba is not installed")
def test_the_test_finds_a_surface_that_is_two_percent_off() -> None:
    ours, theirs = compared("diffuse")
    assert least_p(1.02 * ours, theirs) < 0.01
