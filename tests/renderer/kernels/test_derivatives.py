"""Slopes of height fields in closed form against differences of their heights."""

from __future__ import annotations

import numpy as np
import pytest
import warp as wp

from renderer.kernels.heightfield import height_patch
from renderer.layout.structs import SceneData
from renderer.trace import Renderer
from scenes.canonical import ConstantTexture, HeightField, Instance, Matte, PerspectiveCamera, Rectangle, Scene


@wp.kernel
def patches(scene: SceneData, places: wp.array(dtype=wp.vec2), found: wp.array(dtype=wp.vec3)):
    """Height and slopes of the first map at places of the square."""
    place = places[wp.tid()]
    level = scene.levels[scene.reliefs[0].level]
    found[wp.tid()] = height_patch(scene, level, place[0], place[1])


def heights(scene: SceneData, places: np.ndarray) -> np.ndarray:
    found = wp.zeros(len(places), dtype=wp.vec3, device="cpu")
    wp.launch(patches, len(places), [scene, wp.array(places, dtype=wp.vec2, device="cpu")], [found], device="cpu")
    return found.numpy()


@pytest.mark.parametrize("shape", [(16, 16), (8, 32), (2, 2), (1, 1)])
def test_slopes_are_those_of_the_heights(shape: tuple[int, int]) -> None:
    rng = np.random.default_rng(5)
    relief = HeightField(Matte(ConstantTexture((1.0, 1.0, 1.0))), rng.random(shape), 0.1, 16)
    renderer = Renderer(Scene(PerspectiveCamera(), (Instance(Rectangle(), relief),)))
    scene, step = renderer.buffers.data, 1.0 / 512.0
    rows, columns = shape
    # the middle half of patches, so that a step does not leave them; bilinear within, a difference is then exact
    x = (rng.integers(0, columns, 500) + rng.uniform(0.75, 1.25, 500)) / columns * 2.0 - 1.0
    y = (rng.integers(0, rows, 500) + rng.uniform(0.75, 1.25, 500)) / rows * 2.0 - 1.0
    places = np.stack([x, y], axis=1).astype(np.float32)
    places = places[(np.abs(places) < 0.99).all(axis=1)]
    here = heights(scene, places)
    for axis in range(2):
        ahead, behind = places.copy(), places.copy()
        ahead[:, axis] += step
        behind[:, axis] -= step
        slope = (heights(scene, ahead)[:, 0] - heights(scene, behind)[:, 0]) / (ahead - behind)[:, axis]
        # float32 rounds heights by 6e-8, a step of 1/512 makes 2e-5 of it
        np.testing.assert_allclose(here[:, 1 + axis], slope, rtol=1e-4, atol=2e-4)
    renderer.close()
