"""Motion of the parts of a model: rigid motion at uniform times, and the time at which everything else is drawn."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float64
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from scenes.animation import continuous_quaternions
from scenes.arithmetic import inverse, product
from scenes.canonical import RigidTrack, SceneError
from scenes.formats.losses import LossReport

Poses = Float64[NDArray, "keys 4 4"]

_INTERVAL_S = 1.0 / 120.0
_KEYS_MOST = 1 << 16
_UNEVEN_MOST = 1e-3  # deviation of a rotation from an orthogonal matrix


class Pose:
    """The time at which a model is drawn where its motion is not rigid: skins, morph targets, growth, lights.

    Attributes:
        time_s: time since the start of the animation, seconds.
        counts: whether something in the model depends on it.
    """

    def __init__(self, time_s: float, report: LossReport) -> None:
        self.time_s, self.counts, self._report = time_s, False, report

    def add(self, where: str, what: str, part: str = "the pose") -> None:
        """Notes something that is drawn as it is at this time; a loss, since it stands still in a moving picture."""
        self.counts = True
        self._report.add(where, what, f"{part} at {self.time_s:g} s")


def uniform_times(last_s: float, place: str = "animation") -> NDArray[np.float64]:
    """Times of keys from 0 to ``last_s``, seconds, at most 1/120 s apart; none if nothing moves.

    Raises:
        SceneError: the motion needs more than 65,536 keys.
    """
    if not last_s < _KEYS_MOST * _INTERVAL_S:
        raise SceneError(f"cannot be read: {place}: expected at most {_KEYS_MOST} keys, got {last_s:g} s")
    steps = int(np.ceil(last_s / _INTERVAL_S - 1e-9))
    return np.linspace(0.0, last_s, steps + 1) if steps > 0 else np.zeros(0)


def rigid_track(world: Poses, times_s: NDArray[np.float64], name: str, pose: Pose) -> RigidTrack | None:
    """The rigid motion of a node from its first pose on; None if the motion is not rigid.

    Args:
        world: transforms from the node to the world.
        times_s: their times, uniform.
        name: name of the node, for the loss.
        pose: receives motion that is not rigid.
    """
    if np.linalg.det(world[0, :3, :3]) == 0.0:
        pose.add(name, "an animation that begins without extent")
        return None
    moved = product(world, inverse(world[0]))
    turn = moved[:, :3, :3]
    if not np.abs(product(turn, np.swapaxes(turn, 1, 2)) - np.eye(3)).max() <= _UNEVEN_MOST:
        pose.add(name, "an animation that scales or shears")
        return None
    rotation = continuous_quaternions(Rotation.from_matrix(turn).as_quat())
    return RigidTrack(0.0, float(times_s[1] - times_s[0]), moved[:, :3, 3], rotation)
