"""Rigid motion at each sample's own time."""

import dataclasses

import numpy as np
import pytest
import torch
from scipy.spatial.transform import Rotation

from renderer.trace import Renderer
from scenes.canonical import Instance, Matte, PerspectiveCamera, RigidTrack, Scene, Sphere
from tests.oracles.brute_force_tracer import track_matrix
from tests.renderer.builders import WHITE, batch, driving_scene, grid, turning_track


@pytest.mark.parametrize("time_s", [-5.0, -0.2, 0.1, 0.25, 0.9999, 1.0, 3.0])
def test_poses_are_scipys(time_s: float) -> None:
    tracks = [turning_track(5, keys=1), turning_track(4)]
    renderer = Renderer(Scene(PerspectiveCamera(), tuple(Instance(Sphere(), Matte(WHITE), track=t) for t in tracks)))
    view = renderer._view(1.0, 64.0)
    renderer._pose(view, time_s)
    for number, track in enumerate(tracks, start=1):
        matrix = track_matrix(track, time_s)
        np.testing.assert_allclose(view.pose_translation.numpy()[number], matrix[:3, 3], atol=1e-6)
        turn = Rotation.from_quat(view.pose_rotation.numpy()[number]).as_matrix()
        np.testing.assert_allclose(turn, matrix[:3, :3], atol=1e-6)


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


@pytest.mark.parametrize("in_turn", [False, True], ids=["one time a packet", "times in turn"])
def test_a_sample_does_not_depend_on_the_times_of_others(driving, in_turn: bool) -> None:
    """Poses found once for a batch, once for a packet, and by each sample are the same bits."""
    position = grid(32)
    times = np.array([0.05, 0.4, 0.81])
    order = np.arange(3 * len(position)).reshape(3, -1)
    order = order.T.reshape(-1) if in_turn else order.reshape(-1)
    place, at = np.concatenate([position] * 3), np.repeat(times, len(position))
    mixed = driving.trace(batch(place[order], at[order])).color.reshape(-1, 3)
    single = torch.cat([driving.trace(batch(position, time_s)).color.reshape(-1, 3) for time_s in times])
    assert torch.equal(mixed, single[torch.from_numpy(order)])


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
    at_its_pose = dataclasses.replace(moving, to_world=track_matrix(track, time_s) @ moving.to_world, track=None)
    still = dataclasses.replace(scene, instances=(*scene.instances[:2], at_its_pose))
    expected = Renderer(still).trace(batch(grid(32), time_s)).color.reshape(-1, 3)[1:]
    assert ((got - expected).abs().amax(-1) > 1e-3).float().mean() < 0.005
    assert torch.isfinite(got).all()
