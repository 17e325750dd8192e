"""The same bits for any number of threads, order of the batch, and way of requesting a picture."""

import numpy as np
import pytest
import torch

from renderer.trace import Renderer
from scenes.canonical import DirectionalLight, Instance, Matte, PerspectiveCamera, Rectangle, Scene, Sphere
from tests.renderer.builders import WHITE, batch, driving_scene, grid, look_at, place
from tsar.types import FrameletBatch


@pytest.mark.parametrize("mixed_times", [False, True])
def test_threads_do_not_change_a_bit(mixed_times: bool) -> None:
    position = grid(120)
    times = np.linspace(0, 1, len(position)) if mixed_times else 0.4
    answers = [Renderer(driving_scene(), threads=count).trace(batch(position, times, 16)) for count in (1, 2, 3)]
    for answer in answers[1:]:
        assert torch.equal(answer.color, answers[0].color)
        assert answer.counters == answers[0].counters


def test_batch_order_does_not_change_a_bit(driving) -> None:
    one = batch(grid(64), np.linspace(0, 1, 64 * 64), 16)
    order = torch.from_numpy(np.random.default_rng(0).permutation(one.level.shape[0]))
    other = FrameletBatch(one.level[order], one.index[order], one.position[order], one.time_s[order])
    first, second = driving.trace(one), driving.trace(other)
    assert torch.equal(first.color[order], second.color)
    assert first.counters == second.counters


def test_framelets_and_frames_share_their_pixels() -> None:
    renderer = Renderer(driving_scene(), footprint_resolution_px=40)
    frame = renderer.render_frame(0.3, 40, 40)
    assert torch.equal(renderer.trace(batch(grid(40), 0.3, 16)).color.reshape(40, 40, 3), frame)


def test_wide_and_tall_frames_hold_the_square_one_in_their_middle(driving) -> None:
    square = driving.render_frame(0.3, 32, 32)
    wide, tall = driving.render_frame(0.3, 64, 32), driving.render_frame(0.3, 32, 96)
    assert wide.shape == (32, 64, 3) and tall.shape == (96, 32, 3)
    for part in (wide[:, 16:48], tall[32:64]):
        assert ((part - square).abs().amax(-1) > 1e-3).float().mean() < 0.01


@pytest.mark.parametrize("samples", [3, 4, 8])
def test_supersampling_is_the_mean_of_a_finer_frame(driving, samples: int) -> None:
    fine = driving.render_frame(0.3, 17 * samples, 11 * samples)
    coarse = driving.render_frame(0.3, 17, 11, samples_per_axis=samples)
    expected = fine.reshape(11, samples, 17, samples, 3).mean(dim=(1, 3))
    assert ((coarse - expected).abs().amax(-1) > 1e-3).float().mean() < 0.02


def test_ranges_do_not_change_a_bit(monkeypatch) -> None:
    renderer = Renderer(driving_scene(), threads=2, packets=False)
    whole = renderer.render_frame(0.3, 70, 50, 2)
    monkeypatch.setattr("renderer.trace._RANGE", 48)
    assert torch.equal(renderer.render_frame(0.3, 70, 50, 2), whole)
    one = Renderer(driving_scene(), threads=1, packets=False)
    assert torch.equal(one.render_frame(0.3, 70, 50, 2), whole)


@pytest.mark.parametrize("samples", [1, 2, 4])
def test_threads_do_not_change_a_bit_of_a_frame(samples: int) -> None:
    one, three = (Renderer(driving_scene(), threads=threads).render_frame(0.3, 70, 50, samples) for threads in (1, 3))
    assert torch.equal(one, three)


def test_an_empty_batch_is_answered() -> None:
    answer = Renderer(driving_scene()).trace(
        FrameletBatch(
            *(torch.zeros(0, dtype=torch.int64),) * 2, torch.zeros(0, 16, 2), torch.zeros(0, 16, dtype=torch.float64)
        )
    )
    assert answer.color.shape == (0, 16, 3) and answer.counters["primary_rays"] == 0


def test_ray_counts_are_exact() -> None:
    """A floor that fills the lower half and a ball in the sky: one shadow ray per lit hit."""
    floor = Instance(Rectangle(), Matte(WHITE), place((0, -1, 0), (-np.pi / 2, 0, 0), (1e4, 1e4, 1e4)))
    ball = Instance(Sphere(0.5), Matte(WHITE), place((0, 1.5, -3)))
    scene = Scene(
        PerspectiveCamera(look_at((0, 0, 0), (0, 0, -1)), 90.0),
        (floor, ball),
        (DirectionalLight((0, -1, 0), (1, 1, 1)),),
    )
    counters = Renderer(Scene(scene.camera, (floor,), scene.lights)).trace(batch(grid(32))).counters
    assert counters == {"primary_rays": 1024, "shadow_rays": 512, "reflection_rays": 0}
    colors = Renderer(scene).trace(batch(grid(32)))
    assert colors.counters["shadow_rays"] > 0 and colors.color.isfinite().all()
