"""Rigid motions of a scene as rows of the tables that kernels read."""

from __future__ import annotations

import numpy as np
import warp as wp

from scenes.arithmetic import arcsin
from scenes.canonical import RigidTrack

_STILL = RigidTrack(0.0, 1.0, np.zeros((1, 3)), np.array([[0.0, 0.0, 0.0, 1.0]]))


def angles_between(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Angles between quaternions ``(n, 4)``, radians."""
    # from the chord, which is well conditioned for close keys, unlike an arc cosine
    return 2.0 * arcsin(np.clip(np.linalg.norm(b - a, axis=-1) / 2.0, 0.0, 1.0))


class TrackTable:
    """The unique tracks of a scene; index 0 means static."""

    def __init__(self, device: str) -> None:
        self.device = device
        self.tracks: list[RigidTrack] = [_STILL]
        self.rows: list[dict] = [{"first_key": 0, "key_count": 1, "start_s": 0.0, "interval_s": 1.0}]
        self._index: dict[int, int] = {}

    def add(self, track: RigidTrack | None) -> int:
        """Adds a track and returns its index; the same object gets the same index."""
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

    def keys(self) -> tuple[wp.array, wp.array, wp.array]:
        """Translations (float64), rotations and angles to the next key (float32) of all tracks, on the device."""
        translation = np.concatenate([track.translation for track in self.tracks]).astype(np.float64)
        rotation = np.concatenate([track.rotation for track in self.tracks]).astype(np.float64)
        # the angle between the last key of a track and the first of the next is meaningless, but only read with
        # fraction zero
        angle = np.append(angles_between(rotation[:-1], rotation[1:]), 0.0)
        return (
            wp.array(translation, dtype=wp.vec3d, device=self.device),
            wp.array(rotation.astype(np.float32), dtype=wp.quat, device=self.device),
            wp.array(angle.astype(np.float32), dtype=wp.float32, device=self.device),
        )
