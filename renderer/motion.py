"""Motion that is defined while a scene is rendered: replacement of the keys of its rigid motions, in place."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from jaxtyping import Float64
from numpy.typing import NDArray

from renderer.tables.tracks import angles_between
from renderer.trace import Renderer
from scenes.canonical import RigidTrack, Scene


def tracks_of(scene: Scene) -> list[RigidTrack]:
    """The rigid motions of a scene, each once: first that of the camera, if it has one, then those of instances."""
    return list({id(track): track for track in _all(scene) if track is not None}.values())


def _all(scene: Scene) -> Iterator[RigidTrack | None]:
    yield getattr(scene.camera, "track", None)
    yield from (instance.track for instance in scene.instances)


class Motion:
    """The rigid motions of a renderer's scene. It changes the data of the renderer in place.

    Keys may be replaced by equally many others between batches, but not while a batch is rendered.

    Attributes:
        tracks: motions of the given scene, in the order of :func:`tracks_of`.
    """

    def __init__(self, renderer: Renderer, scene: Scene) -> None:
        """Finds the keys.

        Args:
            renderer: renderer of ``scene``.
            scene: scene that was given to the renderer.

        Raises:
            ValueError: its motions have different numbers of keys.
        """
        self.tracks, traced, table = tracks_of(scene), tracks_of(renderer.scene), renderer.buffers.tracks
        keys = {len(track.translation) for track in self.tracks}
        if len(keys) != 1:
            raise ValueError(f"motion: expected motions of one number of keys, got {sorted(keys)}")
        self._keys, self._data = keys.pop(), renderer.buffers.data
        # the renderer may have moved the scene near its origin
        self._shift = np.stack([b.translation[0] - a.translation[0] for a, b in zip(self.tracks, traced, strict=True)])
        row = {id(track): number for number, track in enumerate(table.tracks)}
        self._order = np.argsort([row[id(track)] for track in traced])
        self._rows = self._data.tracks.numpy().copy()
        self._translation, self._rotation, self._angle = (
            np.array(one.numpy()) for one in (self._data.key_translation, self._data.key_rotation, self._data.key_angle)
        )

    def replace(
        self,
        start_s: float,
        translation: Float64[NDArray, "tracks keys 3"],
        rotation: Float64[NDArray, "tracks keys 4"],
    ) -> None:
        """Replaces the keys of all motions; their interval is unchanged.

        Args:
            start_s: time of the first keys, seconds.
            translation, rotation: keys as in :class:`scenes.canonical.RigidTrack`, in the order of ``tracks``.

        Raises:
            ValueError: the shapes differ from these.
        """
        expected = (len(self.tracks), self._keys)
        if translation.shape != (*expected, 3) or rotation.shape != (*expected, 4):
            given = translation.shape, rotation.shape
            raise ValueError(f"motion: expected keys {(*expected, 3)} and {(*expected, 4)}, got {given[0]}, {given[1]}")
        first = len(self._angle) - len(self.tracks) * self._keys  # the static track comes before
        moved = (translation + self._shift[:, None])[self._order].reshape(-1, 3)
        turned = rotation[self._order].reshape(-1, 4)
        self._rows["start_s"][1:] = start_s
        self._translation[first:], self._rotation[first:] = moved, turned
        # the angle between the last key of a motion and the first of the next is only read with fraction zero
        self._angle[first:-1] = angles_between(turned[:-1], turned[1:])
        data = self._data
        data.tracks.assign(self._rows)
        data.key_translation.assign(self._translation)
        data.key_rotation.assign(self._rotation)
        data.key_angle.assign(self._angle)
