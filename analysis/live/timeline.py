"""What happens when in a live view: the camera's drive, the animation, and the keys that renderers see of both.

Keys lie at multiples of :data:`INTERVAL_S`. A key is settled, for good, once the time of the key before it has come:
what samples of any time find does not change after that time. Later keys are a guess: the camera stays with what it
rides on, and the animation goes on.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from analysis.live import camera as cameras
from analysis.live.camera import Drive
from scenes.canonical import Scene
from scenes.retiming import Keys, Motions, camera_track, instance_tracks, steady, still_keys, with_keys
from scenes.sessions import KEYS_MOST, Session

INTERVAL_S = 1.0 / 120.0
KEYS, PAST = 512, 384
"""Keys that a renderer sees at a time, and how many of them are settled: 3.2 s back, 1.1 s ahead."""
KEPT_MOST = 72_000
"""Settled keys that are kept while nothing is recorded: ten minutes."""
_DROPPED = 1200


@dataclass
class Playback:
    """Where the scene's own time is and how it goes on. Changes in place.

    Attributes:
        duration_s: of the scene; 0 for a still.
        at_s: its time now, seconds.
        playing, repeats: whether it goes on, and begins again at its end.
        speed: seconds of it in a second.
    """

    duration_s: float
    at_s: float = 0.0
    playing: bool = True
    repeats: bool = True
    speed: float = 1.0

    def ahead(self, seconds: NDArray[np.floating]) -> NDArray[np.float64]:
        """Its times so many seconds from now."""
        if not self.playing or self.duration_s <= 0.0:
            return np.full(seconds.shape, self.at_s)
        times = np.asarray(self.at_s + self.speed * seconds, np.float64)
        return np.mod(times, self.duration_s) if self.repeats else np.minimum(times, self.duration_s)


class Timeline:
    """The keys of a scene that is driven through. Changes in place; calls from several threads take turns.

    Attributes:
        scene: with the keys, for a renderer.
        recording: whether as many keys are kept as a session can hold, which are those of more than two hours.
    """

    def __init__(self, scene: Scene) -> None:
        """Begins at time 0, at the start of the animation.

        Raises:
            SceneError: the scene's camera cannot move.
        """
        self._own_camera = Motions([camera_track(scene)])
        tracks = instance_tracks(scene)
        self._own = Motions(tracks) if tracks else None
        self.animation = Playback(scene.duration_s)
        self.drive = cameras.at_rest(np.asarray(scene.camera.to_world, np.float64))
        self._lock = threading.RLock()
        self._first = -PAST + 1
        """Number of the first key that a renderer sees."""
        drive, still = self.drive, np.zeros(KEYS)
        inner = np.tile(drive.translation, (KEYS, 1)), np.tile(drive.rotation, (KEYS, 1))
        self._camera, self._instances = self._keys_at(still, inner)
        self.recording = False
        self._settled: list[tuple[float, NDArray[np.float64], NDArray[np.float64]]] = []
        self._dropped = 0
        self._keep(still[:1], (self._camera[0][:1], self._camera[1][:1]))
        self.scene = with_keys(scene, self._first * INTERVAL_S, INTERVAL_S, self._camera, self._instances)

    def advance(self, now_s: float) -> bool:
        """Settles keys up to the one after a time, seconds; whether there were new ones."""
        with self._lock:
            count = int(now_s / INTERVAL_S) + 1 - self._newest
            if count <= 0:
                return False
            self._camera, self._instances = (
                _rolled(window, new, ahead)
                for window, new, ahead in zip(
                    (self._camera, self._instances), self._settle(count), self._keys_ahead(KEYS - PAST), strict=True
                )
            )
            self._first += count
            return True

    @property
    def _newest(self) -> int:
        """Number of the newest settled key; the first has number 0."""
        return self._dropped + len(self._settled) - 1

    def keys(self) -> tuple[float, NDArray[np.float64], NDArray[np.float64]]:
        """What a renderer sees now: time of the first key, seconds, translations ``(tracks, keys, 3)`` and rotations
        ``(tracks, keys, 4)`` of the camera and of all instances."""
        with self._lock:
            translation, rotation = (
                np.concatenate([a[None], b]) for a, b in zip(self._camera, self._instances, strict=True)
            )
            return self._first * INTERVAL_S, translation, rotation

    def change(self, change: Callable[[Drive], Drive]) -> None:
        """Drives the camera otherwise from now on."""
        with self._lock:
            self.drive = change(self.drive)

    def ride(self, rides: bool) -> None:
        """Lets the camera ride with the scene's own camera, or not."""
        own = self._own_camera.at(np.array([self.animation.at_s]))
        self.change(lambda drive: cameras.riding(drive, (own[0][0, 0], own[1][0, 0]), rides))

    def reset(self) -> None:
        """Puts the camera back to where the scene has it."""
        self.change(lambda drive: cameras.at_rest(drive.to_world))

    def scrub(self, at_s: float) -> None:
        """Takes the animation to one of its times, seconds."""
        with self._lock:
            self.animation.at_s = float(np.clip(at_s, 0.0, max(self.animation.duration_s, 0.0)))

    def seconds(self, begin: int) -> float:
        """Of the session from a key to the newest, as far as it was kept."""
        return INTERVAL_S * (self._newest - max(begin, self._dropped))

    @property
    def count(self) -> int:
        """Of the keys settled so far."""
        return self._newest + 1

    def session(self, begin: int, **facts: Any) -> Session:
        """What happened from a key to the newest, as far as it was kept.

        Args:
            begin: number of its first key.
            facts: scene, phase and camera path, and what was seen.
        """
        with self._lock:
            kept = self._settled[max(begin - self._dropped, 0) :]
            animation_s, translation, rotation = (np.array(part) for part in zip(*kept, strict=True))
            return Session(
                interval_s=INTERVAL_S, animation_s=animation_s, translation=translation, rotation=rotation, **facts
            )

    def _settle(self, count: int) -> tuple[Keys, Keys]:
        """The next keys, for good."""
        times_s = self.animation.ahead(INTERVAL_S * np.arange(1, count + 1))
        driven = []
        for _ in range(count if self.drive.moves else 1):
            self.drive = cameras.later(self.drive, INTERVAL_S)
            driven.append(self.drive)
        translation, rotation = (
            np.array([getattr(drive, name) for drive in driven]) for name in ("translation", "rotation")
        )
        inner = np.broadcast_to(translation, (count, 3)), np.broadcast_to(rotation, (count, 4))
        found = self._keys_at(times_s, inner)
        self.animation.at_s = float(times_s[-1])
        self._keep(times_s, found[0])
        return found

    def _keep(self, times_s: NDArray[np.float64], camera: Keys) -> None:
        self._settled += list(zip(times_s.tolist(), *camera, strict=True))
        over = len(self._settled) - (KEYS_MOST - _DROPPED if self.recording else KEPT_MOST)
        if over > _DROPPED:
            del self._settled[:over]
            self._dropped += over

    def _keys_ahead(self, count: int) -> tuple[Keys, Keys]:
        """Guessed keys of the camera and of instances, from the next one on."""
        inner = np.tile(self.drive.translation, (count, 1)), np.tile(self.drive.rotation, (count, 1))
        return self._keys_at(self.animation.ahead(INTERVAL_S * np.arange(1, count + 1)), inner)

    def _keys_at(self, times_s: NDArray[np.float64], inner: Keys) -> tuple[Keys, Keys]:
        place, turn = self._own_camera.at(times_s)
        camera = cameras.outside(self.drive.rides, (place[0], turn[0]), inner)
        return camera, self._own.at(times_s) if self._own is not None else still_keys(len(times_s))


def _rolled(window: Keys, new: Keys, ahead: Keys) -> Keys:
    """A window of settled keys and of guesses after new keys were settled."""
    translation, rotation = (
        np.concatenate([np.concatenate([a[..., :PAST, :], b], axis=-2)[..., -PAST:, :], c], axis=-2)
        for a, b, c in zip(window, new, ahead, strict=True)
    )
    return translation, steady(rotation)
