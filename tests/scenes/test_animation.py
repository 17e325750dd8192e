"""Tracks hold what their pose function says, and paths are driven at constant speed along their heading."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from scenes.animation import (
    UP,
    Path,
    Pose,
    Times,
    attached,
    camera_to_world,
    continuous_quaternions,
    look_at,
    pose_at,
    sample_track,
)
from scenes.canonical import RigidTrack, SceneError

BENDS = ((4.0, 6.0, 0.9), (12.0, 5.0, -1.4))
WINDING = Path((1.0, -2.0), 0.4, 8.0, BENDS)


def tumbling(time_s: Times) -> Pose:
    """Turns about a skew axis, several times round, while it moves along a curve."""
    axis = np.array([1.0, -2.0, 0.5]) / np.linalg.norm([1.0, -2.0, 0.5])
    moves = np.stack([np.cos(time_s), np.sin(time_s), 0.3 * time_s], axis=-1)
    return moves, Rotation.from_rotvec(7.0 * np.asarray(time_s)[:, None] * axis)


def expected(time_s: float) -> np.ndarray:
    translation, rotation = tumbling(np.array([time_s]))
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = rotation.as_matrix()[0], translation[0]
    return matrix


def test_poses_at_the_keys_are_those_of_the_function() -> None:
    track = sample_track(tumbling, -1.0, 2.0, 0.1)
    assert len(track.translation) == 31 and track.start_s == -1.0
    for key in range(31):
        assert pose_at(track, -1.0 + 0.1 * key) == pytest.approx(expected(-1.0 + 0.1 * key), abs=1e-9)


@given(st.floats(-1.0, 2.0))
def test_poses_in_between_are_close(time_s: float) -> None:
    """Turning about a fixed axis is exact; the chord of the curve is off by less than its sagitta."""
    track = sample_track(tumbling, -1.0, 2.0, 0.02)
    found, exact = pose_at(track, time_s), expected(time_s)
    assert found[:3, :3] == pytest.approx(exact[:3, :3], abs=1e-9)
    assert np.linalg.norm(found[:3, 3] - exact[:3, 3]) <= 0.02**2 / 8.0 + 1e-12


def test_poses_are_held_outside() -> None:
    track = sample_track(tumbling, 0.0, 1.0, 0.1)
    assert pose_at(track, -5.0) == pytest.approx(expected(0.0)) and pose_at(track, 5.0) == pytest.approx(expected(1.0))
    single = RigidTrack(3.0, 1.0, track.translation[4:5], track.rotation[4:5])
    for time_s in (0.0, 3.0, 9.0):
        assert pose_at(single, time_s) == pytest.approx(expected(0.4), abs=1e-9)


@pytest.mark.parametrize(("end_s", "keys"), [(1.0, 11), (1.01, 12), (0.05, 2), (0.3, 4)])
def test_the_last_key_reaches_the_end(end_s: float, keys: int) -> None:
    track = sample_track(tumbling, 0.0, end_s, 0.1)
    assert len(track.translation) == keys


def test_quaternions_become_continuous_and_stay_the_same_rotations() -> None:
    turns = Rotation.from_rotvec(np.linspace(0.0, 20.0, 60)[:, None] * [0.0, 0.6, 0.8]).as_quat()
    signs = np.random.default_rng(0).choice([-1.0, 1.0], 60)[:, None]
    mixed = turns * signs
    assert (np.einsum("ij,ij->i", mixed[1:], mixed[:-1]) < 0.0).any(), "there is something to repair"
    smooth = continuous_quaternions(mixed)
    assert (np.einsum("ij,ij->i", smooth[1:], smooth[:-1]) > 0.0).all()
    assert smooth[0] == pytest.approx(mixed[0])
    assert (Rotation.from_quat(smooth) * Rotation.from_quat(turns).inv()).magnitude() == pytest.approx(0.0, abs=1e-7)


@given(st.tuples(*[st.floats(-20.0, 20.0)] * 3), st.floats(-3.0, 3.0))
def test_look_at_puts_the_target_straight_ahead(offset: tuple[float, float, float], roll_rad: float) -> None:
    eye = np.array([1.0, 2.0, 3.0])
    target = eye + np.array(offset) + np.array([30.0, 0.0, 0.0])
    local = look_at(eye, target, roll_rad).inv().apply(target - eye)
    assert local == pytest.approx([0.0, 0.0, -np.linalg.norm(target - eye)], abs=1e-9)


@pytest.mark.parametrize("height", [5.0, -5.0])
def test_a_camera_may_look_straight_down_or_up(height: float) -> None:
    """As one does that is a little nearer to -y."""
    place = np.array([0.0, 0.0, height])
    matrix = camera_to_world(place, np.zeros(3))
    assert np.linalg.det(matrix) == pytest.approx(1.0) and matrix[:3, 3] == pytest.approx(place)
    assert matrix[:3, 2] == pytest.approx((0.0, 0.0, np.sign(height))) and matrix[:3, 0] == pytest.approx((1, 0, 0))
    near = camera_to_world(place + np.array([0.0, -1e-4, 0.0]), np.zeros(3))
    assert near == pytest.approx(matrix, abs=2e-4)
    both = look_at(np.stack([place, place + np.array([0.0, -1e-4, 0.0])]), np.zeros((2, 3))).as_matrix()
    assert both == pytest.approx(np.stack([matrix[:3, :3], near[:3, :3]]))


@pytest.mark.parametrize("eye", [(0.0, 0.0, 1.0), (np.nan, 0.0, 0.0), (np.inf, 0.0, 0.0)])
def test_a_camera_that_looks_nowhere_is_refused(eye: tuple[float, float, float]) -> None:
    with pytest.raises(SceneError, match="expected finite points that differ"):
        camera_to_world(np.array(eye), np.array([0.0, 0.0, 1.0]))


def test_look_at_is_upright_and_rolls() -> None:
    eye, target = np.array([5.0, 1.0, 4.0]), np.array([-2.0, 3.0, 0.5])
    straight = look_at(eye, target)
    right, above, _ = straight.as_matrix().T
    assert right[2] == pytest.approx(0.0, abs=1e-12) and above[2] > 0.0
    assert np.linalg.det(straight.as_matrix()) == pytest.approx(1.0)
    assert (straight.inv() * look_at(eye, target, 0.3)).as_rotvec() == pytest.approx([0.0, 0.0, 0.3])
    many = look_at(np.stack([eye, target]), np.stack([target, eye]))
    assert many.as_matrix()[0] == pytest.approx(straight.as_matrix())
    matrix = camera_to_world(eye, target)
    assert matrix[:3, :3] == pytest.approx(straight.as_matrix()) and matrix[:3, 3] == pytest.approx(eye)


def test_heading_before_within_and_after_bends() -> None:
    heading = WINDING.heading(np.array([-3.0, 4.0, 7.0, 10.0, 11.9, 14.5, 17.0, 60.0]))
    whole = [0.4, 0.4, 0.4 + 0.45, 0.4 + 0.9, 0.4 + 0.9, 0.4 + 0.9 - 0.7, 0.4 - 0.5, 0.4 - 0.5]
    assert heading == pytest.approx(whole)


def test_curvature_is_the_derivative_of_heading() -> None:
    distance, step = np.linspace(-1.0, 20.0, 400), 1e-5
    slope = (WINDING.heading(distance + step) - WINDING.heading(distance - step)) / (2.0 * step)
    assert WINDING.curvature(distance) == pytest.approx(slope, abs=1e-6)
    assert WINDING.curvature(np.array([7.0]))[0] == pytest.approx(2.0 * 0.9 / 6.0), "twice the mean in the middle"


@pytest.mark.parametrize("path", [WINDING, Path((0.0, 3.0), 1.0, 8.0), Path((0.0, 0.0), 0.4, 8.0, BENDS, 3.0)])
def test_speed_is_constant_and_along_the_heading(path: Path) -> None:
    time_s, step = np.linspace(-0.5, 3.0, 300), 0.01
    places = [path.pose(time_s + offset)[0] for offset in (-step, step)]
    velocity = (places[1] - places[0]) / (2.0 * step)
    assert np.linalg.norm(velocity, axis=1) == pytest.approx(8.0, rel=1e-3)
    ahead = path.pose(time_s)[1].apply([1.0, 0.0, 0.0])
    assert velocity / 8.0 == pytest.approx(ahead, abs=5e-3)
    assert velocity[:, 2] == pytest.approx(0.0)


def test_a_path_starts_where_it_should() -> None:
    place, rotation = WINDING.pose(np.array([0.0]))
    assert place[0] == pytest.approx([1.0, -2.0, 0.0], abs=1e-6)
    assert rotation.apply(UP)[0] == pytest.approx(UP)
    later = Path(WINDING.start, WINDING.heading_rad, WINDING.speed, WINDING.bends, advance=2.0)
    time_s = np.array([0.0, 0.5, 1.5])
    assert later.pose(time_s)[0] == pytest.approx(WINDING.pose(time_s + 0.25)[0], abs=1e-9)


def test_positions_do_not_depend_on_what_else_is_asked_for() -> None:
    alone = np.concatenate([WINDING.position(np.array([at])) for at in (-2.0, 6.3, 15.1)])
    assert WINDING.position(np.array([-2.0, 6.3, 15.1])) == pytest.approx(alone, abs=1e-9)


def test_an_attached_part_moves_with_its_parent_and_turns_on_its_own() -> None:
    offset = np.array([1.0, 0.5, -0.2])

    def turn(time_s: Times) -> Rotation:
        return Rotation.from_rotvec(np.asarray(time_s)[:, None] * [0.0, 3.0, 0.0])

    part = attached(tumbling, offset, turn)
    time_s = np.array([0.0, 0.4, 1.7])
    translation, rotation = part(time_s)
    for row, time in enumerate(time_s.tolist()):
        parent = expected(time)
        assert translation[row] == pytest.approx(parent[:3, :3] @ offset + parent[:3, 3])
        local = parent[:3, :3].T @ rotation.as_matrix()[row]
        assert Rotation.from_matrix(local).as_rotvec() == pytest.approx(
            Rotation.from_rotvec([0.0, 3.0 * time, 0.0]).as_rotvec(), abs=1e-9
        )
