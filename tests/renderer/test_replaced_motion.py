"""Motion that is replaced while a scene is rendered gives the pictures of a scene that had it from the start."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
import torch
from scipy.spatial.transform import Rotation

from renderer.motion import Motion, tracks_of
from renderer.trace import Renderer
from scenes import catalog
from scenes.animation import camera_to_world
from scenes.canonical import (
    ConstantTexture,
    DirectionalLight,
    Instance,
    Mesh,
    PerspectiveCamera,
    Phong,
    RigidTrack,
    Scene,
    Sphere,
)

KEYS = 4


def motion(seed: int) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    turns = Rotation.from_rotvec(0.1 * rng.normal(size=(KEYS, 3))).as_quat()
    return 0.3 * rng.normal(size=(KEYS, 3)), turns * np.sign(turns[:, 3:])


def scene(seed: int, place: float = 0.0, start_s: float = 0.0) -> Scene:
    """Two spheres and a mesh that move, two of them together, seen by a camera that moves."""
    tracks = [
        RigidTrack(start_s, 0.5, t + np.array([place, 0.0, 0.0]), q) for t, q in (motion(seed + i) for i in range(3))
    ]
    corners = np.array([[-1, -1, 0], [1, -1, 0], [0, 1, 0.5]], np.float32)
    mesh = Mesh(corners, np.array([[0, 1, 2]], np.int32))
    at = np.eye(4)
    at[:3, 3] = 0.4, 0.2, 0.1
    parts = (
        Instance(Sphere(0.5), Phong(ConstantTexture((0.8, 0.2, 0.1))), track=tracks[0], name="a"),
        Instance(mesh, Phong(ConstantTexture((0.2, 0.8, 0.1))), track=tracks[1], name="b"),
        Instance(Sphere(0.3), Phong(ConstantTexture((0.2, 0.2, 0.9))), at, track=tracks[0], name="c"),
    )
    eye = PerspectiveCamera(camera_to_world(np.array([0.0, -4.0, 1.0]), np.zeros(3)), track=tracks[2])
    return Scene(eye, parts, (DirectionalLight((0.3, 1.0, -0.5), (1.0, 1.0, 1.0)),), ambient=(0.2, 0.2, 0.2))


def replaced(motion: Motion, wanted: Scene) -> None:
    tracks = tracks_of(wanted)
    keys = (np.stack([getattr(track, name) for track in tracks]) for name in ("translation", "rotation"))
    motion.replace(tracks[0].start_s, *keys)


@pytest.mark.parametrize("place", [0.0, 4096.0], ids=["near", "far from the origin"])
def test_replaced_keys_are_those_of_another_scene(place: float) -> None:
    given, wanted = scene(1, place), scene(7, place, start_s=10.0)
    moving, fresh = (Renderer(one, threads=1) for one in (given, wanted))
    before = moving.render_frame(10.6, 32, 32)
    replaced(Motion(moving, given), wanted)
    for time_s in (9.0, 10.6, 11.2, 20.0):
        image = moving.render_frame(time_s, 32, 32)
        assert torch.equal(image, fresh.render_frame(time_s, 32, 32))
        a, b = (one.viewpoint(time_s) for one in (moving, fresh))
        assert torch.equal(a.translation, b.translation) and torch.equal(a.rotation, b.rotation)
    assert not torch.equal(before, moving.render_frame(10.6, 32, 32))


def test_driving_scenes_take_their_own_keys_back() -> None:
    from scenes.retiming import Motions, instance_tracks, with_keys

    plain = catalog.load("fly-by")
    times_s, own = np.arange(8) / 8.0, instance_tracks(plain)
    camera = tuple(one[0] for one in Motions([RigidTrack(0.0, 1.0, *(k[:2] for k in motion(3)))]).at(times_s))
    wanted = with_keys(plain, 0.0, 1 / 8, camera, Motions(own).at(times_s))  # type: ignore[arg-type]
    other = with_keys(plain, 0.0, 1 / 8, camera, Motions(own).at(times_s + 1.0))  # type: ignore[arg-type]
    moving, fresh = (Renderer(one, threads=1) for one in (other, wanted))
    replaced(Motion(moving, other), wanted)
    assert torch.equal(moving.render_frame(0.3, 32, 32), fresh.render_frame(0.3, 32, 32))


def test_keys_of_other_numbers_are_refused() -> None:
    given = scene(1)
    renderer = Renderer(given, threads=1)
    motion = Motion(renderer, given)
    with pytest.raises(ValueError, match=r"expected keys \(3, 4, 3\)"):
        motion.replace(0.0, np.zeros((3, 5, 3)), np.zeros((3, 5, 4)))
    track = given.instances[1].track
    assert track is not None
    longer = RigidTrack(0.0, 1.0, track.translation[:2], track.rotation[:2])
    mixed = (given.instances[0], dataclasses.replace(given.instances[1], track=longer))
    with pytest.raises(ValueError, match="one number of keys"):
        Motion(renderer, dataclasses.replace(given, instances=mixed))
