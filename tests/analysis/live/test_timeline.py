"""The camera's drive and the keys that renderers see: what is settled stays, and what is driven is what is recorded."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import analysis.live.timeline as timelines
from analysis.live import camera as cameras
from analysis.live.camera import Drive, at_rest, later, moved, riding, turned
from analysis.live.timeline import INTERVAL_S, KEYS, PAST, Timeline
from scenes import catalog
from scenes.animation import camera_to_world, pose_at
from scenes.canonical import RigidTrack, Scene

EYE, TARGET = np.array([4.0, -3.0, 2.0]), np.array([0.0, 1.0, 1.0])


@pytest.fixture
def drive() -> Drive:
    return at_rest(camera_to_world(EYE, TARGET))


@pytest.fixture(scope="module")
def scene() -> Scene:
    return catalog.load("chase")


def test_it_looks_round_about_its_own_place(drive: Drive) -> None:
    now = turned(turned(drive, 0.3, 0.0), -0.1, 0.2)
    assert np.allclose(now.eye, EYE)
    right, up, ahead = now.axes
    assert abs(right @ drive.up) < 1e-12 and up @ drive.up > 0, "the horizon is level"
    bearing = [np.arctan2(axes[1], axes[0]) for axes in (drive.axes[2], ahead)]
    assert bearing[1] - bearing[0] == pytest.approx(0.2) and np.allclose(np.cross(right, up), -ahead, atol=1e-12)
    steep = [np.arcsin(axes[2]) for axes in (drive.axes[2], ahead)]
    assert steep[1] - steep[0] == pytest.approx(0.2)


def test_it_never_turns_over(drive: Drive) -> None:
    for sign in (1, -1):
        now = turned(drive, 0.0, sign * 10.0)
        assert np.arcsin(now.axes[2] @ drive.up) == pytest.approx(sign * cameras.STEEPEST_RAD)
        assert now.axes[1] @ drive.up > 0


def test_it_goes_round_what_lies_ahead(drive: Drive) -> None:
    distance = float(np.linalg.norm(TARGET - EYE))
    now = turned(drive, 1.0, 0.1, distance)
    assert np.allclose(now.eye + distance * now.axes[2], TARGET) and np.linalg.norm(now.eye - EYE) > 1.0


def test_it_goes_where_it_is_told(drive: Drive) -> None:
    right, up, ahead = drive.axes
    assert np.allclose(moved(drive, (1.0, 2.0, 3.0)).eye, EYE + right + 2 * up + 3 * ahead)
    going = Drive(**{**vars(drive), "velocity": (0.0, 0.0, 2.0), "turning": (0.5, 0.0)})
    once, twice = later(going, 0.1), later(later(going, 0.05), 0.05)
    assert np.allclose(once.axes, twice.axes) and np.linalg.norm(once.eye - EYE) == pytest.approx(0.2)


def test_beginning_and_ending_to_ride_keeps_its_place(drive: Drive) -> None:
    own = np.array([5.0, 1.0, -2.0]), Rotation.from_rotvec([0.1, -0.4, 0.9]).as_quat()
    rider = turned(moved(drive, (0.5, 0.0, 1.0)), 0.2, 0.1)
    whole = cameras.outside(True, (own[0][None], own[1][None]), (rider.translation[None], rider.rotation[None]))
    free = riding(rider, own, False)
    assert np.allclose(free.translation, whole[0][0]) and not free.rides
    again = riding(free, own, True)
    assert np.allclose(again.translation, rider.translation)
    assert np.allclose(abs(again.rotation @ rider.rotation), 1.0)
    assert riding(free, own, False) is free


def camera_at(timeline: Timeline, time_s: float) -> np.ndarray:
    start_s, translation, rotation = timeline.keys()
    return pose_at(RigidTrack(start_s, INTERVAL_S, translation[0], rotation[0]), time_s)


def test_what_is_settled_stays(scene: Scene) -> None:
    """A sample of any time finds the same pose whenever it is traced from that time on."""
    timeline, rng = Timeline(scene), np.random.default_rng(0)
    seen, now_s = [], 0.0
    for step in range(60):
        timeline.advance(now_s)
        seen.append((now_s, camera_at(timeline, now_s)))
        x, y, z = rng.normal(size=3)
        timeline.change(lambda drive, x=x, y=y, z=z: Drive(**{**vars(drive), "velocity": (x, y, z), "turning": (y, z)}))
        if step == 30:
            timeline.ride(False)
        now_s += float(rng.exponential(0.02))
    timeline.advance(now_s)
    for time_s, pose in seen:
        assert np.allclose(pose, camera_at(timeline, time_s), rtol=0.0, atol=1e-9), time_s
    assert len({pose.tobytes() for _, pose in seen}) > 50


def test_undriven_it_is_the_scene(scene: Scene) -> None:
    timeline = Timeline(scene)
    for now_s in (0.1, 0.5, 0.9):
        timeline.advance(now_s)
    start_s, translation, rotation = timeline.keys()
    assert translation.shape[1] == KEYS and start_s + (PAST - 1) * INTERVAL_S >= 0.9
    own = scene.camera.track
    for time_s in (0.0, 0.25, 0.9, 1.5):  # the last is a guess
        assert np.allclose(camera_at(timeline, time_s), pose_at(own, time_s), atol=1e-3)
    track = next(one.track for one in scene.instances if one.track is not None)
    first = RigidTrack(start_s, INTERVAL_S, translation[1], rotation[1])
    assert np.allclose(pose_at(first, 0.8), pose_at(track, 0.8), atol=1e-3)


def test_the_animation_stops_goes_on_and_jumps(scene: Scene) -> None:
    timeline = Timeline(scene)
    animation, end_s = timeline.animation, scene.duration_s
    assert end_s > 1.0
    timeline.advance(0.5)
    assert animation.at_s == pytest.approx(0.5, abs=INTERVAL_S)
    animation.playing = False
    timeline.advance(1.0)
    assert animation.at_s == pytest.approx(0.5, abs=INTERVAL_S)
    timeline.scrub(99.0)
    assert animation.at_s == end_s
    timeline.scrub(end_s - 0.25)
    animation.playing, animation.speed = True, 2.0
    timeline.advance(1.5)
    assert animation.at_s == pytest.approx(0.75, abs=0.03), "it began again"
    animation.repeats = False
    timeline.advance(60.0)
    assert animation.at_s == end_s


def test_a_session_holds_what_was_driven(scene: Scene) -> None:
    timeline = Timeline(scene)
    timeline.advance(0.2)
    begin = timeline.count
    timeline.change(lambda drive: Drive(**{**vars(drive), "velocity": (0.0, 0.0, 3.0), "rides": False}))
    timeline.advance(1.2)
    session = timeline.session(begin, scene="chase", phase=0.0, camera_path="")
    assert session.seconds == pytest.approx(1.0, abs=0.02)
    gone = session.translation[-1] - session.translation[0]
    assert np.linalg.norm(gone) == pytest.approx(3.0 * session.seconds)
    assert np.allclose(np.diff(session.animation_s), INTERVAL_S)
    assert np.array_equal(session.translation[-1], timeline.keys()[1][0, PAST - 1])


def test_a_recording_is_not_cut_as_long_as_a_session_can_hold_it(scene: Scene, monkeypatch) -> None:
    monkeypatch.setattr(timelines, "KEPT_MOST", 240)
    monkeypatch.setattr(timelines, "KEYS_MOST", 960)
    monkeypatch.setattr(timelines, "_DROPPED", 60)
    timeline = Timeline(scene)
    timeline.animation.playing = False
    timeline.advance(1.0)
    begin, timeline.recording = timeline.count - 1, True
    for second in range(2, 7):
        timeline.advance(float(second))
    facts = {"scene": "chase", "phase": 0.0, "camera_path": ""}
    assert timeline.seconds(begin) == pytest.approx(5.0, abs=0.02)
    assert timeline.session(begin, **facts).seconds == pytest.approx(timeline.seconds(begin))
    for second in range(7, 20):
        timeline.advance(float(second))
    assert 5.9 < timeline.seconds(begin) <= 960 * INTERVAL_S, "no more keys than a session may have"
    assert timeline.session(begin, **facts).seconds == pytest.approx(timeline.seconds(begin))
    timeline.recording = False
    for second in range(20, 40):
        timeline.advance(float(second))
    assert timeline.seconds(0) < 4.0
