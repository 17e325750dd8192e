"""Rigid motion at each sample's own time."""

import dataclasses

import numpy as np
import pytest
import torch

from renderer.trace import Renderer
from renderer.tracks import TrackTable
from scenes.canonical import RigidTrack
from tests.oracles.brute_force_tracer import track_matrix
from tests.renderer.builders import batch, driving_scene, grid, turning_track


@pytest.mark.parametrize("time_s", [-5.0, -0.2, 0.1, 0.25, 0.9999, 1.0, 3.0])
def test_pose_on_the_host_is_scipys(time_s: float) -> None:
    track = turning_track(4)
    table = TrackTable("cpu")
    table.add(turning_track(5, keys=1))
    assert table.add(track) == 2
    table.finish()
    translation, rotation = (values[2] for values in table.evaluate(time_s))
    matrix = track_matrix(track, time_s)
    np.testing.assert_allclose(translation, matrix[:3, 3], atol=1e-12)
    x, y, z, w = rotation
    np.testing.assert_allclose(
        [1 - 2 * (y * y + z * z), 2 * (x * y + z * w), 2 * (x * z - y * w)], matrix[:3, 0], atol=1e-12
    )


def _frozen(time_s: float):
    """The driving scene with every track replaced by its pose."""
    scene = driving_scene()
    still = tuple(
        dataclasses.replace(i, to_world=track_matrix(i.track, time_s) @ i.to_world, track=None) for i in scene.instances
    )
    camera = scene.camera
    camera = dataclasses.replace(camera, to_world=track_matrix(camera.track, time_s) @ camera.to_world, track=None)
    return dataclasses.replace(scene, instances=still, camera=camera)


@pytest.mark.parametrize("time_s", [-1.0, 0.0, 0.33, 2.0])
def test_moving_scene_is_the_still_scene_at_its_pose(driving, time_s: float) -> None:
    moving, still = driving.render_frame(time_s, 64, 64), Renderer(_frozen(time_s)).render_frame(0.0, 64, 64)
    differing = (moving - still).abs().amax(-1) > 1e-3
    assert differing.float().mean() < 0.01
    assert (moving - driving.render_frame(0.7, 64, 64)).abs().amax(-1).gt(1e-3).float().mean() > 0.2


def test_times_per_sample_agree_with_one_time_per_batch(driving) -> None:
    """The kernel's own poses and those from the host show the same picture to rounding."""
    position = grid(32)
    times = np.array([0.05, 0.4, 0.81])
    mixed = driving.trace(batch(np.concatenate([position] * 3), np.repeat(times, len(position)))).color.reshape(
        3, -1, 3
    )
    for number, time_s in enumerate(times):
        single = driving.trace(batch(position, time_s)).color.reshape(-1, 3)
        differing = (mixed[number] - single).abs().amax(-1) > 1e-3
        assert differing.float().mean() < 0.005


def test_long_times_keep_their_precision() -> None:
    """A fast wheel after an hour: the key and the fraction are found in float64."""
    keys = 36001
    turns = np.arange(keys) * 0.4
    sign = np.stack([np.zeros(keys), np.zeros(keys), np.sin(turns / 2), np.cos(turns / 2)], -1)
    track = RigidTrack(0.0, 0.1, np.zeros((keys, 3)), sign)
    scene = driving_scene()
    moving = dataclasses.replace(scene.instances[2], track=track)
    scene = dataclasses.replace(scene, instances=(*scene.instances[:2], moving))
    renderer = Renderer(scene)
    time_s = 3599.9517
    times = np.full(32 * 32, time_s)
    times[0] = 0.0  # forces poses per sample
    got = renderer.trace(batch(grid(32), times)).color.reshape(-1, 3)[1:]
    expected = renderer.trace(batch(grid(32), time_s)).color.reshape(-1, 3)[1:]
    assert ((got - expected).abs().amax(-1) > 1e-3).float().mean() < 0.005
    assert torch.isfinite(got).all()
