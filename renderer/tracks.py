"""Rigid motions: their keys for the kernels, and their poses at one time in float64 on the host."""

from __future__ import annotations

import numpy as np
import warp as wp

from scenes.canonical import RigidTrack

_STILL = RigidTrack(0.0, 1.0, np.zeros((1, 3)), np.array([[0.0, 0.0, 0.0, 1.0]]))


def _angle(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    # by the chord: well conditioned for near keys, where an arc cosine is not
    return 2.0 * np.arcsin(np.clip(np.linalg.norm(b - a, axis=-1) / 2.0, 0.0, 1.0))


class TrackTable:
    """The unique tracks of a scene; index 0 stands for "does not move".

    Tracks are added, then :meth:`finish` lays out their keys; after that the table does not change.
    """

    def __init__(self, device: str) -> None:
        self.device = device
        self.tracks: list[RigidTrack] = [_STILL]
        self.rows: list[dict] = [{"first_key": 0, "key_count": 1, "start_s": 0.0, "interval_s": 1.0}]
        self._index: dict[int, int] = {}

    def add(self, track: RigidTrack | None) -> int:
        """Index of a track; the same object gets the same index."""
        if track is None:
            return 0
        if id(track) not in self._index:
            first = self.rows[-1]["first_key"] + self.rows[-1]["key_count"]
            self._index[id(track)] = len(self.tracks)
            self.tracks.append(track)
            self.rows.append(
                {
                    "first_key": first,
                    "key_count": len(track.translation),
                    "start_s": track.start_s,
                    "interval_s": track.interval_s,
                }
            )
        return self._index[id(track)]

    def finish(self) -> None:
        """Joins the keys of all tracks into tables."""
        columns = ("first_key", "key_count", "start_s", "interval_s")
        self._first, count, self._start_s, self._interval_s = (np.array([row[c] for row in self.rows]) for c in columns)
        self._last = count - 1
        self._translation = np.concatenate([track.translation for track in self.tracks]).astype(np.float64)
        self._rotation = np.concatenate([track.rotation for track in self.tracks]).astype(np.float64)
        # across the border of two tracks the angle is meaningless, and never read with a fraction above zero
        self._key_angle = np.append(_angle(self._rotation[:-1], self._rotation[1:]), 0.0)

    def keys(self) -> tuple[wp.array, wp.array, wp.array]:
        """Translations (float64), rotations and angles to the next key (float32) of all tracks, on the device."""
        return (
            wp.array(self._translation, dtype=wp.vec3d, device=self.device),
            wp.array(self._rotation.astype(np.float32), dtype=wp.quat, device=self.device),
            wp.array(self._key_angle.astype(np.float32), dtype=wp.float32, device=self.device),
        )

    def evaluate(self, time_s: float) -> tuple[np.ndarray, np.ndarray]:
        """Poses of all tracks at one time.

        Args:
            time_s: animation time, seconds.

        Returns:
            Translations ``(tracks, 3)`` in scene units and unit quaternions ``(tracks, 4)`` as ``(x, y, z, w)``,
            float64.
        """
        at = np.clip((time_s - self._start_s) / self._interval_s, 0.0, self._last)
        index = np.minimum(at.astype(np.int64), np.maximum(self._last - 1, 0))
        fraction = (at - index)[:, None]
        a = self._first + index
        b = np.minimum(a + 1, self._first + self._last)
        translation = (1.0 - fraction) * self._translation[a] + fraction * self._translation[b]
        angle = np.where(b > a, self._key_angle[a], 0.0)[:, None]
        small = angle < 1.0e-9
        sine = np.where(small, 1.0, np.sin(angle))
        weight_a = np.where(small, 1.0 - fraction, np.sin((1.0 - fraction) * angle) / sine)
        weight_b = np.where(small, fraction, np.sin(fraction * angle) / sine)
        rotation = weight_a * self._rotation[a] + weight_b * self._rotation[b]
        return translation, rotation / np.linalg.norm(rotation, axis=1, keepdims=True)

    def poses(self, time_s: float) -> tuple[wp.array, wp.array]:
        """Translations and rotations of all tracks at one time, float32, on the device."""
        translation, rotation = self.evaluate(time_s)
        return (
            wp.array(translation.astype(np.float32), dtype=wp.vec3, device=self.device),
            wp.array(rotation.astype(np.float32), dtype=wp.quat, device=self.device),
        )
