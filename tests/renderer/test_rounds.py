"""Pictures in rounds: known errors, tiles that stop, runs that continue; and their layers."""

from __future__ import annotations

import copy
import dataclasses

import numpy as np
import pytest

from renderer.film.files import read_exr
from renderer.film.layers import write_layers
from renderer.guides import render_guides
from renderer.rounds import ROUNDS_LEAST, Rounds, render_rounds
from renderer.sampling.plan import SamplePlan
from renderer.trace import Renderer
from scenes.canonical import ConstantTexture, Instance, Matte, PerspectiveCamera, PointLight, Rectangle, Scene
from tests.renderer.builders import driving_scene, look_at, place

PLAN = SamplePlan(4, "random")
SIZE = 48, 32


@pytest.fixture(scope="module")
def renderer() -> Renderer:
    return Renderer(driving_scene(), threads=2)


def test_the_error_is_that_between_pictures_of_other_seeds(renderer: Renderer) -> None:
    """Half the mean square of their difference, in encoded colour."""
    made = [
        render_rounds(renderer, dataclasses.replace(PLAN, seed=seed), 16, *SIZE, 0.4) for seed in (1, 1000, 2000, 3000)
    ]
    coded = np.stack([np.sqrt(np.clip(one.image.numpy(), 0.0, 1.0)) for one in made])
    assert made[0].error == pytest.approx(float(np.sqrt(coded.var(axis=0, ddof=1).mean())), rel=0.15)
    assert (made[0].samples == 64).all() and made[0].variance.shape == (32, 48, 3)


def test_good_tiles_stop_and_the_others_reach_the_target(renderer: Renderer) -> None:
    target = 0.6 * render_rounds(renderer, PLAN, ROUNDS_LEAST, *SIZE, 0.4).error
    made = render_rounds(renderer, PLAN, 64, *SIZE, 0.4, error_target=target)
    counts = np.unique(made.samples)
    assert counts.min() >= 4 * ROUNDS_LEAST and counts.max() > counts.min()
    tiles = np.sqrt(made.variance.numpy().reshape(2, 16, 3, 16, 3).mean(axis=(1, 3, 4)))
    assert (tiles[made.samples.numpy()[::16, ::16] < 256] <= target).all()


def test_an_interrupted_picture_goes_on_to_the_same_bits(renderer: Renderer) -> None:
    kept: list[Rounds] = []
    whole = render_rounds(
        renderer, PLAN, 8, *SIZE, 0.4, error_target=0.006, done=lambda _, s: kept.append(copy.deepcopy(s))
    )
    for state in kept[:-1]:
        again = render_rounds(
            Renderer(driving_scene(), threads=1), PLAN, 8, *SIZE, 0.4, error_target=0.006, state=state
        )
        assert (again.image == whole.image).all() and again.error == whole.error
    part = render_rounds(renderer, PLAN, 8, *SIZE, 0.4, error_target=0.006, crop=(20, 3, 9, 20))
    assert (part.image == whole.image[3:23, 20:29]).all()


def test_layers_tell_what_a_picture_shows() -> None:
    tilted = place((0.0, 0.0, -3.0), (0.0, 0.4, 0.0), (1.0, 1.0, 1.0))
    scene = Scene(
        PerspectiveCamera(look_at((0, 0, 0), (0, 0, -1)), 60.0),
        (Instance(Rectangle(), Matte(ConstantTexture((0.2, 0.4, 0.6))), tilted),),
        (PointLight((0, 0, 1), (1, 1, 1)),),
    )
    found = render_guides(Renderer(scene), 33, 33, 0.0)
    middle = (16, 16)
    assert found.depth[middle] == pytest.approx(3.0, rel=1e-3) and np.isinf(found.depth[0, 0])
    np.testing.assert_allclose(found.normal[middle], (np.sin(0.4), 0.0, np.cos(0.4)), rtol=1e-5, atol=1e-6)
    np.testing.assert_allclose(found.albedo[middle], (0.2, 0.4, 0.6), rtol=1e-5)
    assert found.instance[middle] == 0 and found.instance[0, 0] == -1
    assert (found.albedo[0, 0] == 0.0).all() and found.point[middle][2] == pytest.approx(-3.0, rel=1e-3)


def test_layers_of_a_file_have_their_channels(tmp_path) -> None:
    import OpenEXR

    picture = np.random.default_rng(0).random((5, 7, 3), dtype=np.float32)
    layers = {"": picture, "depth": picture[..., 0], "normal": picture, "motion": picture[..., :2], "variance": picture}
    write_layers(tmp_path / "a.exr", layers)
    np.testing.assert_array_equal(read_exr(tmp_path / "a.exr"), picture)
    with OpenEXR.File(str(tmp_path / "a.exr"), separate_channels=True) as file:
        planes = {name: channel.pixels for name, channel in file.channels().items()}
    np.testing.assert_array_equal(planes["normal.Z"], picture[..., 2])
    endings = {"normal": "XYZ", "motion": "XY", "variance": "RGB"}
    vectors = {f"{name}.{ending}" for name, parts in endings.items() for ending in parts}
    assert planes.keys() == {"R", "G", "B", "Z"} | vectors
