"""Retiming of scenes: all rigid motions are evaluated together and resampled at uniform times."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import numpy as np
from jaxtyping import Float64
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from scenes.arithmetic import rotation_between
from scenes.canonical import OrthographicCamera, PerspectiveCamera, RigidTrack, Scene, SceneError

Keys = tuple[Float64[NDArray, "... keys 3"], Float64[NDArray, "... keys 4"]]
"""Translations, and unit quaternions ``(x, y, z, w)``."""

STILL = RigidTrack(0.0, 1.0, np.zeros((1, 3)), np.array([[0.0, 0.0, 0.0, 1.0]]))
"""The track of a static object."""


class Motions:
    """Rigid motions that are evaluated together."""

    def __init__(self, tracks: Sequence[RigidTrack]) -> None:
        """Takes at least one track."""
        counts = np.array([len(track.translation) for track in tracks])
        self._first = (np.cumsum(counts) - counts)[:, None]
        self._last = (counts - 1)[:, None]
        self._start_s = np.array([track.start_s for track in tracks])[:, None]
        self._interval_s = np.array([track.interval_s for track in tracks])[:, None]
        self._translation = np.concatenate([track.translation for track in tracks])
        self._rotation = np.concatenate([track.rotation for track in tracks])

    def at(self, times_s: Float64[NDArray, " keys"]) -> Keys:
        """Poses at times, seconds: ``(tracks, keys, 3)`` and ``(tracks, keys, 4)``, up to the sign of quaternions."""
        key = np.clip((times_s - self._start_s) / self._interval_s, 0.0, self._last)
        low = np.minimum(key.astype(np.int64), np.maximum(self._last - 1, 0))
        share, a = key - low, self._first + low
        b = a + (self._last > 0)
        start = self._translation[a]
        translation = start + share[..., None] * (self._translation[b] - start)
        between = rotation_between(
            self._rotation[a].reshape(-1, 4), self._rotation[b].reshape(-1, 4), share.reshape(-1)
        )
        return translation, between.as_quat().reshape(*share.shape, 4)


def steady(rotation: Float64[NDArray, "... keys 4"]) -> Float64[NDArray, "... keys 4"]:
    """The same rotations with signs such that neighbouring keys have a non-negative dot product; the first keys keep
    their signs."""
    dots = (rotation[..., 1:, :] * rotation[..., :-1, :]).sum(axis=-1)
    signs = np.cumprod(np.where(dots < 0.0, -1.0, 1.0), axis=-1)
    return np.concatenate([rotation[..., :1, :], rotation[..., 1:, :] * signs[..., None]], axis=-2)


def after(outer: Keys, inner: Keys) -> Keys:
    """Composition of rigid motions, ``outer(inner(x))``, key by key; broadcast over leading axes."""
    (place, turn), (offset, own) = outer, inner
    shape = np.broadcast_shapes(turn.shape, own.shape)
    first, second = (Rotation.from_quat(np.array(np.broadcast_to(q, shape)).reshape(-1, 4)) for q in (turn, own))
    moved = first.apply(np.array(np.broadcast_to(offset, (*shape[:-1], 3))).reshape(-1, 3)).reshape(*shape[:-1], 3)
    return place + moved, (first * second).as_quat().reshape(shape)


def instance_tracks(scene: Scene) -> list[RigidTrack]:
    """The rigid motions of instances, each once."""
    return list({id(one.track): one.track for one in scene.instances if one.track is not None}.values())


def camera_track(scene: Scene) -> RigidTrack:
    """The rigid motion of the camera.

    Raises:
        SceneError: the kind of camera does not support motion.
    """
    if not isinstance(scene.camera, PerspectiveCamera | OrthographicCamera):
        expected = "a perspective or orthographic camera, which can be moved"
        raise SceneError(f"camera: expected {expected}, got {type(scene.camera).__name__}")
    return scene.camera.track or STILL


def with_keys(scene: Scene, start_s: float, interval_s: float, camera: Keys, instances: Keys) -> Scene:
    """The scene with new keys for all moving instances and for the camera.

    Args:
        scene: scene with a camera that can move.
        start_s, interval_s: time of the first keys, and interval between keys, seconds.
        camera: ``(keys, 3)`` and ``(keys, 4)``.
        instances: ``(tracks, keys, ...)`` in the order of :func:`instance_tracks`.

    Raises:
        SceneError: the camera cannot move, or keys are invalid.
    """
    camera_track(scene)
    own = instance_tracks(scene)
    translation, rotation = instances[0], steady(instances[1])
    made = {
        id(track): RigidTrack(start_s, interval_s, translation[number], rotation[number])
        for number, track in enumerate(own)
    }
    moved = tuple(
        one if one.track is None else dataclasses.replace(one, track=made[id(one.track)]) for one in scene.instances
    )
    seen = RigidTrack(start_s, interval_s, camera[0], steady(camera[1]))
    duration_s = interval_s * (len(camera[0]) - 1)
    eye = dataclasses.replace(scene.camera, track=seen)  # type: ignore[call-arg]
    return dataclasses.replace(scene, camera=eye, instances=moved, duration_s=duration_s)


def still_keys(count: int) -> Keys:
    """The keys of no instances, as arrays ``(0, count, 3)`` and ``(0, count, 4)``."""
    return np.zeros((0, count, 3)), np.zeros((0, count, 4))


def retimed(scene: Scene, interval_s: float, animation_s: Float64[NDArray, " keys"], camera: Keys) -> Scene:
    """The scene with its animation retimed and its camera driven.

    Args:
        scene: scene with a camera that can move.
        interval_s: interval between keys, seconds; the first key is at 0.
        animation_s: the scene's own time at each key, seconds.
        camera: rigid motion of the camera at each key.

    Raises:
        SceneError: the camera cannot move, or keys are invalid.
    """
    own = instance_tracks(scene)
    instances = Motions(own).at(animation_s) if own else still_keys(len(animation_s))
    return with_keys(scene, 0.0, interval_s, camera, instances)
