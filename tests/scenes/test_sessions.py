"""Sessions: what is driven is kept to the bit, and stands for a scene wherever a scene is asked for."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from scenes import catalog
from scenes.animation import pose_at
from scenes.canonical import RigidTrack, SceneError
from scenes.retiming import STILL, Motions, after, instance_tracks, retimed
from scenes.sessions import Session, read_session

rng = np.random.default_rng(3)


def random_track(keys: int, start_s: float, interval_s: float) -> RigidTrack:
    turns = np.cumsum(rng.uniform(-0.4, 0.4, (keys, 3)), axis=0)
    rotation = Rotation.from_rotvec(turns).as_quat()
    signs = np.cumprod(np.concatenate([[1.0], np.sign((rotation[1:] * rotation[:-1]).sum(axis=1))]))
    return RigidTrack(start_s, interval_s, rng.normal(size=(keys, 3)), rotation * signs[:, None])


def keys(count: int) -> tuple[np.ndarray, np.ndarray]:
    turns = Rotation.from_rotvec(np.linspace(0.0, 0.3, count)[:, None] * [0.0, 0.0, 1.0])
    return rng.normal(size=(count, 3)), turns.as_quat()


def session(**changes) -> Session:
    given = {"scene": "fly-by", "phase": 0.25, "camera_path": "", "interval_s": 1 / 120, "seen": {"policy": "tsar"}}
    given |= dict(zip(("translation", "rotation"), keys(5), strict=True))
    given |= {"animation_s": np.array([0.0, 0.01, 0.02, 0.02, 1.0])}
    return Session(**{**given, **changes})


def write(path: Path, one: Session) -> Path:
    path.write_text(json.dumps(one.facts()))
    return path


def test_motions_together_are_those_one_by_one() -> None:
    tracks = [random_track(7, -0.5, 0.25), STILL, random_track(2, 1.0, 0.1), random_track(1, 0.0, 1.0)]
    times_s = np.array([-2.0, -0.5, -0.3, 0.99, 1.04, 1.05, 30.0])
    translation, rotation = Motions(tracks).at(times_s)
    for number, track in enumerate(tracks):
        for key, time_s in enumerate(times_s):
            expected = pose_at(track, float(time_s))
            assert np.allclose(Rotation.from_quat(rotation[number, key]).as_matrix(), expected[:3, :3], atol=1e-12)
            assert np.allclose(translation[number, key], expected[:3, 3], atol=1e-12)


def test_motions_follow_each_other() -> None:
    outer, inner = keys(4), keys(4)
    translation, rotation = after(outer, inner)
    point = np.array([0.3, -1.0, 2.0])
    expected = Rotation.from_quat(outer[1]).apply(Rotation.from_quat(inner[1]).apply(point) + inner[0]) + outer[0]
    assert np.allclose(Rotation.from_quat(rotation).apply(point) + translation, expected, atol=1e-12)


def test_a_session_is_a_scene_with_that_motion(tmp_path: Path) -> None:
    one = session()
    found, losses = catalog.load_any(write(tmp_path / "a.session", one))
    plain = catalog.load("fly-by", 0.25)
    track = found.camera.track
    assert losses == () and track is not None and found.duration_s == pytest.approx(4 / 120)
    assert (track.translation == one.translation).all() and track.interval_s == one.interval_s
    before, now = instance_tracks(plain), instance_tracks(found)
    assert len(before) == len(now) > 0
    for old, new in zip(before, now, strict=True):
        for key, animation_s in enumerate(one.animation_s):
            assert np.allclose(pose_at(new, key / 120), pose_at(old, animation_s), atol=1e-9)
    shared = [
        [id(a.track) == id(b.track) for b in scene.instances for a in scene.instances] for scene in (plain, found)
    ]
    assert shared[0] == shared[1], "what moved together still does"


def test_its_file_keeps_every_bit(tmp_path: Path) -> None:
    one = session()
    read = read_session(write(tmp_path / "a.session", one))
    for name in ("animation_s", "translation", "rotation"):
        assert getattr(read, name).tobytes() == getattr(one, name).tobytes()
    assert (read.scene, read.phase, read.interval_s, read.seen) == (one.scene, 0.25, 1 / 120, {"policy": "tsar"})
    assert one.seconds == pytest.approx(4 / 120)


def test_a_scene_file_is_looked_for_beside_the_session(tmp_path: Path) -> None:
    from scenes.loading import asset

    (tmp_path / "box.xml").write_bytes(asset("cornell-box/cornell-box.xml").read_bytes())
    one = session(scene="box.xml", phase=0.0)
    found, _ = catalog.load_any(write(tmp_path / "a.session", one))
    assert len(found.instances) > 3 and len(found.camera.track.translation) == 5


def test_cameras_that_cannot_move_are_refused() -> None:
    import dataclasses

    from scenes.canonical import EnvironmentCamera

    scene = dataclasses.replace(catalog.load("fly-by"), camera=EnvironmentCamera())
    with pytest.raises(SceneError, match="perspective or orthographic camera.*EnvironmentCamera"):
        retimed(scene, 0.1, np.zeros(5), keys(5))


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ("nonsense", "cannot be read"),
        ("[]", "tsar session 1"),
        ('{"kind": "tsar session 2"}', "tsar session 1"),
        ('{"kind": "tsar session 1"}', "expected a field"),
        ("[" * 100_000, "cannot be read"),
        (json.dumps({**session().facts(), "animation_s": [1.0]}), "translation"),
        (json.dumps({**session().facts(), "animation_s": [float("nan")] * 5}), "non-finite"),
        (json.dumps({**session().facts(), "rotation": [[0.0, 0.0, 0.0, 2.0]] * 5}), "unit quaternions"),
        (json.dumps({**session().facts(), "interval_s": 0.0}), "interval_s"),
        (json.dumps({**session().facts(), "interval_s": float("inf")}), "interval_s"),
        (json.dumps({**session().facts(), "interval_s": 10**400}), "cannot be read"),
        (json.dumps({**session().facts(), "animation_s": [10**400] * 5}), "cannot be read"),
        (json.dumps({**session().facts(), "scene": "b.session"}), "another session"),
        (json.dumps({**session().facts(), "scene": "flyby"}), "nearest: fly-by"),
    ],
)
def test_bad_files_are_named(tmp_path: Path, content: str, said: str) -> None:
    path = tmp_path / "bad.session"
    path.write_text(content)
    with pytest.raises(ValueError, match=said) as caught:
        catalog.load_any(path)
    assert "\n" not in str(caught.value)


def test_a_session_has_its_own_phase(tmp_path: Path) -> None:
    with pytest.raises(SceneError, match="no phase"):
        catalog.load_any(write(tmp_path / "a.session", session()), 0.5)
    with pytest.raises(SceneError, match="missing.session"):
        catalog.load_any(tmp_path / "missing.session")
